"""Error of a product-space result, estimated from coarser companions: twice the mesh size, half the layers."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rve.result import Homogenised, StressCurve
from stochastic import RadiusMap

ORDER = 2.0  # taken for E in mesh size and layer height, to be on the safe side; quadratic wedges reach 3 to 4
SAFETY = 5.0


def estimate(
    radius_map: RadiusMap, results: Sequence[Homogenised], rough: Sequence[Homogenised], thick: Sequence[Homogenised], *, mesh_size: float
) -> list[dict[str, float]]:
    """Relative error of E from space and from θ, for each result.

    Args:
        radius_map: The map.
        results: What is to be judged.
        rough: The same on a mesh of twice the size.
        thick: The same on that mesh with half the layers.
        mesh_size: Of the results, in halves of the cell's side.
    """
    unseen = 3 * _unresolved(radius_map, results[0].curve, mesh_size)
    finer = max(1.1, np.sqrt(results[0].unknowns / rough[0].unknowns))  # a coarse mesh cannot always be made twice as coarse
    thinner = max(1.1, rough[0].unknowns / thick[0].unknowns)
    return [
        {"space": _carried(b, a, finer**ORDER) + unseen, "theta": _carried(c, b, thinner**ORDER)}
        for a, b, c in zip(results, rough, thick, strict=True)
    ]


def _carried(coarse: Homogenised, fine: Homogenised, gain: float) -> float:
    """Error of the finer of two results whose errors differ by the factor `gain`, with the safety factor."""
    return SAFETY * abs(coarse.modulus / fine.modulus - 1) / (gain - 1)


def _unresolved(radius_map: RadiusMap, curve: StressCurve, mesh_size: float) -> float:
    """Mean area fraction of particles so small beside the mesh that no refinement of it tells their error."""
    radius = radius_map(curve.theta)
    return float(curve.weights @ np.where(radius < mesh_size / 4, np.pi / 4 * radius**2, 0.0))
