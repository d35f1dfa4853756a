"""Models refined until their estimated error is within a tolerance: slices and prism."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.rve.slices.model import SlicesModel
from alphacut.rve.slices.theta_rule import extreme_radii, settle_rule
from alphacut.rve.table.build import PlanarSource, build_table
from alphacut.rve.table.interpolant import Table, TableRange
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

_SPACE_SHARE, _THETA_SHARE = 0.5, 0.1
_SKETCH = 1e-3  # accuracy of the table that the nodes in θ are counted by
_TRIES = 5


def refined_slices(
    radius_map: RadiusMap,
    matrix: Phase,
    inclusions: Sequence[Phase],
    *,
    tolerance: float,
    progress: Callable[[float], None] | None = None,
) -> list[Homogenised]:
    """Results whose estimated error is below `tolerance`.

    The mesh is as fine as the hardest radius and modulus ask for; nodes in θ are counted on a rough
    table, whose curve over r has the shape of the true one; what the slices then say of themselves
    decides, and refines further.

    Raises:
        RuntimeError: The tolerance is not reached in a few tries.
    """
    low, high = (float(r) for r in extreme_radii(radius_map))
    sizes, counts = [], []
    for poisson in {p.poisson for p in inclusions}:
        moduli = [p.modulus for p in inclusions if p.poisson == poisson]
        span = TableRange(matrix, poisson, (low, high), (min(moduli), max(moduli)))
        source = PlanarSource(span, _SPACE_SHARE * tolerance)
        source.moduli((), np.array(span.moduli))  # it chooses its mesh
        sizes.append(source.mesh_size)
        counts.append(
            _count_nodes(
                build_table(span, accuracy=_SKETCH),
                radius_map,
                np.array(moduli),
                _THETA_SHARE * tolerance,
            )
        )
    model = SlicesModel(mesh_size=min(sizes), points=max(counts), progress=progress)
    for _ in range(_TRIES):
        results = model.solve(radius_map, matrix, inclusions)
        if max(r.largest_error for r in results) <= tolerance:
            break
        worst = max(results, key=lambda r: r.largest_error).errors
        if worst["theta"].max() > worst["space"].max():
            model = replace(model, points=model.points + 3)
        else:
            model = replace(model, mesh_size=0.8 * model.mesh_size)
    return results


def _count_nodes(table: Table, radius_map: RadiusMap, moduli: Array, accuracy: float) -> int:
    """Nodes in θ that bring the mean of the table's curve within `accuracy`."""

    def stiffness_at(radii: Array) -> Array:
        return table.stiffness(radii, moduli)

    curves, *_ = settle_rule(radius_map, stiffness_at, points=None, accuracy=max(accuracy, 1e-13))
    return max(2, min(curves[0].theta.size, 64))


_COARSEST, _FINEST, _MOST_LAYERS = 0.25, 0.05, 100
_FINER_MESH, _MORE_LAYERS = 2**0.5, 1.5


def refined_prism(
    radius_map: RadiusMap,
    matrix: Phase,
    inclusions: Sequence[Phase],
    *,
    tolerance: float,
    stiffness: bool = False,
) -> list[Homogenised]:
    """Results at the coarsest mesh and layers whose estimated error is below `tolerance`.

    Raises:
        RuntimeError: The finest mesh leaves more.
    """
    from alphacut.rve.prism.model import PrismModel
    from alphacut.rve.prism.system import FoldedMeshError

    size, layers = _COARSEST, 6
    while True:
        try:
            model = PrismModel(size, layers, stiffness=stiffness, estimate=True)
            results = model.solve(radius_map, matrix, inclusions)
        except FoldedMeshError:
            if layers >= _MOST_LAYERS:
                raise
            layers = round(layers * _MORE_LAYERS)
            continue
        worst = max(results, key=lambda r: r.largest_error)
        if worst.largest_error <= tolerance:
            return [
                replace(
                    r,
                    reason="; ".join(
                        filter(None, [f"mesh size {size:.3g}, {layers} layers", r.reason])
                    ),
                )
                for r in results
            ]
        if size <= _FINEST or layers >= _MOST_LAYERS:
            raise RuntimeError(
                f"mesh size {size:.3g} with {layers} layers leaves a relative error of"
                f" {worst.largest_error:.1e}"
            )
        if np.nanmax(worst.errors["theta"]) > np.nanmax(worst.errors["space"]):
            layers = round(layers * _MORE_LAYERS)
        else:
            size = max(_FINEST, size / _FINER_MESH)
