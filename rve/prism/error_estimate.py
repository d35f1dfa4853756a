"""Error of a product-space result, estimated from companions on other meshes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.rve.cell import Phase
from alphacut.rve.result import Homogenised, StressCurve
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.slices.curve import modulus_error
from alphacut.stochastic import RadiusMap

# taken for E in mesh size and layer height, to be on the safe side; quadratic wedges reach 3 to 4
ORDER = 2.0
SAFETY = 5.0
_ROUGH = 0.25  # mesh size above which a coarser mesh would tell nothing


def companion_size(mesh_size: float) -> float:
    """Mesh size of the companion: twice as coarse, or twice as fine where that is no mesh."""
    return 2 * mesh_size if mesh_size <= _ROUGH else mesh_size / 2


def space_error(results: Sequence[Homogenised], companions: Sequence[Homogenised]) -> list[float]:
    """Relative error of E from the mesh, for each result, from companions of another mesh size."""
    return [
        _gap(own, other, (own.unknowns / other.unknowns) ** (ORDER / 2))
        for own, other in zip(results, companions, strict=True)
    ]


def theta_error(results: Sequence[Homogenised], thick: Sequence[Homogenised]) -> list[float]:
    """Relative error of E from the layers, from companions with half of them."""
    return [
        _gap(own, other, (own.unknowns / other.unknowns) ** ORDER)
        for own, other in zip(results, thick, strict=True)
    ]


def _gap(own: Homogenised, other: Homogenised, gain: float) -> float:
    """Error of `own`, with the safety factor, where that of `other` is `gain` times as large."""
    return SAFETY * abs(other.modulus / own.modulus - 1) / max(abs(gain - 1), 0.1)


def unresolved(
    radius_map: RadiusMap, curve: StressCurve, phases: tuple[Phase, Phase], *, mesh_size: float
) -> float:
    """Relative change of E, tenfold, by particles too small for the mesh."""
    radius = radius_map(curve.theta)
    small = radius < mesh_size / 4
    if not small.any():
        return 0.0
    matrix, inclusion = phases
    cells, bare = (
        square_stiffness(radius[small], matrix, [inclusion], loads=("hydrostatic", "shear")),
        matrix.stiffness,
    )
    change = np.zeros_like(radius)
    change[small] = np.maximum(
        abs(cells.bulk[:, 0] / (bare[0, 0] + bare[0, 1]) - 1),
        abs(cells.shear[:, 0] / bare[2, 2] - 1),
    )
    return 10 * modulus_error(curve, change)
