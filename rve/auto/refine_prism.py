"""Product-space model refined until its estimated error is small enough."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised
from alphacut.stochastic import RadiusMap

_COARSEST, _FINEST, _MOST_LAYERS = 0.25, 0.05, 100
_FINER_MESH, _MORE_LAYERS = 2**0.5, 1.5


def refined_prism(
    radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase], *, tolerance: float
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
            results = PrismModel(mesh_size=size, layers=layers, estimate=True).solve(
                radius_map, matrix, inclusions
            )
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
