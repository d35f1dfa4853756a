"""The product-space model with its error estimated from coarser meshes, and refined until that is small enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rve.cell import Phase
from rve.result import Homogenised, StressCurve
from stochastic import RadiusMap

_COARSEST, _FINEST, _MOST_LAYERS = 0.25, 0.05, 100
_FINER_MESH, _MORE_LAYERS = 2**0.5, 1.5
_ORDER = 2.0  # of E in mesh size and layer height; quadratic wedges reach 3 to 4


def refined_prism(radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], *, tolerance: float) -> list[Homogenised]:
    """Results at the coarsest mesh and layers whose estimated error is below `tolerance`.

    Raises:
        RuntimeError: The finest mesh leaves more.
    """
    size, layers = _COARSEST, 6
    while True:
        results = prism_with_error(radius_map, matrix, inclusions, mesh_size=size, layers=layers)
        worst = max(results, key=lambda r: r.estimated_error)
        if worst.estimated_error <= tolerance:
            return results
        if size <= _FINEST or layers >= _MOST_LAYERS:
            raise RuntimeError(f"mesh size {size:.3g} with {layers} layers leaves a relative error of {worst.estimated_error:.1e}")
        if worst.error["theta"] > worst.error["space"]:
            layers = round(layers * _MORE_LAYERS)
        else:
            size = max(_FINEST, size / _FINER_MESH)


def prism_with_error(
    radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], *, mesh_size: float, layers: int
) -> list[Homogenised]:
    """Prism results with the error that a mesh of twice the size and half the layers let them expect.

    Args:
        radius_map: The map.
        matrix: Material outside the particle.
        inclusions: Materials of the particle.
        mesh_size: Triangle size in halves of the cell's side, in (0, 0.7].
        layers: At least 2.
    """
    from rve.prism import PrismModel

    def solve(size: float, count: int) -> list[Homogenised]:
        return PrismModel(mesh_size=size, layers=count).solve(radius_map, matrix, inclusions)

    fine = solve(mesh_size, layers)
    rough_size, fewer = min(1.0, 2 * mesh_size), max(1, layers // 2)
    rough = solve(rough_size, layers)
    thick = solve(rough_size, fewer)
    unseen = 3 * _unresolved(radius_map, fine[0].curve, mesh_size)
    space = [_carried(a, b, (rough_size / mesh_size) ** _ORDER) + unseen for a, b in zip(rough, fine, strict=True)]
    theta = [_carried(a, b, (layers / fewer) ** _ORDER) for a, b in zip(thick, rough, strict=True)]
    return [
        replace(r, error={"space": s, "theta": t}, reason=f"mesh size {mesh_size:.3g}, {layers} layers")
        for r, s, t in zip(fine, space, theta, strict=True)
    ]


def _carried(coarse: Homogenised, fine: Homogenised, gain: float) -> float:
    """Error of the finer of two results whose errors differ by the factor `gain`, fivefold for safety."""
    return 5 * abs(coarse.modulus / fine.modulus - 1) / (gain - 1)


def _unresolved(radius_map: RadiusMap, curve: StressCurve, mesh_size: float) -> float:
    """Mean area fraction of particles so small beside the mesh that no refinement of it tells their error."""
    radius = radius_map(curve.theta)
    return float(curve.weights @ np.where(radius < mesh_size / 4, np.pi / 4 * radius**2, 0.0))
