"""Guaranteed α-cuts of the constants of a mesh from a file.

The stiffness of a cell rises, as a quadratic form, with that of each of its phases. So the cell of
the softest phases of an α-cut bounds it from below, and that of the stiffest from above.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.fuzzy.result import Nature
from alphacut.rve.cell.cell import AnyPhase
from alphacut.rve.fuzzy_cell import FuzzyStiffness
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.model import ImageModel
from alphacut.rve.result.engineering_constants import NAMES
from alphacut.stochastic import ThetaDistribution

if TYPE_CHECKING:
    from alphacut.rve.prism.own_mesh import MeshModel  # DOLFINx takes seconds to import

NamedPhases = Mapping[str, AnyPhase]
"""Phases of a mesh by the names of its physical groups."""


def bounds_between(
    model: MeshModel, law: ThetaDistribution, extremes: Sequence[tuple[NamedPhases, NamedPhases]]
) -> list[StiffnessBounds]:
    """Return guaranteed bounds of the stiffness of a mesh for ranges of its phases.

    Args:
        model: The mesh.
        law: Distribution of θ.
        extremes: The softest and the stiffest phases of each range.

    Raises:
        FailedError: The cell is not solved, or the mesh is too coarse for a lower bound.
        RefusedError: The mesh is not allowed.
    """
    solved: dict[str, StiffnessBounds] = {}
    found = []
    for both in extremes:
        for phases in both:
            if repr(phases) not in solved:
                solved[repr(phases)] = model.bounds(law, phases)
        soft = solved[repr(both[0])]
        stiff = solved[repr(both[1])]
        if not soft.has_lower:
            what = "the mesh is too coarse for a lower bound of the stiffness"
            raise FailedError(what, "set mesh.refine = true, or mesh more finely")
        found.append(StiffnessBounds(soft.lower, stiff.upper))
    return found


def guaranteed_constants(bounds: Sequence[StiffnessBounds], average: str) -> dict[str, Array]:
    """Return guaranteed cuts of E, ν and the constants along the axes, in SI, by their names.

    Args:
        bounds: Bounds of the stiffness at rising levels.
        average: The average that E and ν are of.

    Returns:
        Lower and upper ends of "E", "nu", "E_x", "E_y", "nu_xy" and "G_xy" in plane strain, nested,
        shape (levels, 2) each.
    """
    cuts = ImageModel(average=average).cuts(bounds)
    found = {"E": np.array([cut.modulus for cut in cuts])}
    found["nu"] = np.array([cut.poisson for cut in cuts])
    along_axes = np.array([cut.constants for cut in cuts]).swapaxes(0, 1)
    return found | dict(zip(NAMES, along_axes, strict=True))


def with_guaranteed_cuts(
    stiffness: FuzzyStiffness, bounds: Sequence[StiffnessBounds], average: str
) -> FuzzyStiffness:
    """Return a fuzzy stiffness with guaranteed α-cuts in place of those that samples attain.

    Cuts of stresses and loss factors stay attained.

    Args:
        stiffness: α-cuts by samples.
        bounds: Bounds of the stiffness at its levels.
        average: The average that E and ν are of.
    """
    of_samples = stiffness.bounds
    changed = {
        name: getattr(of_samples, name).copy()
        for name in ("lower", "upper", "error", "lower_at", "upper_at")
    }
    natures = list(of_samples.natures or [of_samples.nature] * len(of_samples.outputs))
    for name, cuts in guaranteed_constants(bounds, average).items():
        column = of_samples.column(name)
        changed["lower"][:, column], changed["upper"][:, column] = cuts.T
        natures[column] = Nature.GUARANTEED
        for unknown in ("error", "lower_at", "upper_at"):
            changed[unknown][:, column] = np.nan
    bounded = replace(of_samples, **changed, natures=tuple(natures))
    return replace(stiffness, bounds=bounded, error={})
