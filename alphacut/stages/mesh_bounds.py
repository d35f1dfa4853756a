"""Guaranteed bounds of the constants of a mesh from a file, where a case has `mesh.bounds`.

The stiffness of a cell rises, as a quadratic form, with that of each of its phases. So the cell of
the softest phases of an α-cut bounds it from below, and that of the stiffest from above.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.case.material import MeshedCell
from alphacut.fuzzy.result import Nature
from alphacut.rve.fuzzy_cell import FuzzyStiffness
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.model import ImageModel
from alphacut.rve.result.engineering_constants import NAMES
from alphacut.rve.result.moduli import ISOTROPIC
from alphacut.stages.cell import CellProblem
from alphacut.stochastic import ThetaDistribution


def bounds_of_mesh(
    problem: CellProblem, levels: Sequence[float | None], *, parallel: bool = False
) -> list[StiffnessBounds]:
    """Return guaranteed bounds of the stiffness of a mesh from a file at α-levels.

    Args:
        problem: A cell with a mesh from a file.
        levels: Levels of the phases' moduli; None for the nominal ones.
        parallel: Whether all MPI ranks work on one cell together.

    Raises:
        FailedError: The cell is not solved, or the mesh is too coarse for a lower bound.
        RefusedError: A library is missing, or the mesh is not allowed.
    """
    from alphacut.rve.prism.own_mesh import MeshModel  # DOLFINx takes seconds to import

    cell = cast("MeshedCell", problem.cell)
    model = cast("MeshModel", problem.model(parallel=parallel))
    law = cast("ThetaDistribution", problem.nominal_radius)
    solved: dict[str, StiffnessBounds] = {}
    found = []
    for level in levels:
        ends = []
        for phases in cell.extreme_phases(level):
            key = repr(phases)
            if key not in solved:
                solved[key] = model.bounds(law, phases)
            ends.append(solved[key])
        soft, stiff = ends
        if not soft.has_lower:
            what = "the mesh is too coarse for a lower bound of the stiffness"
            raise FailedError(what, "set mesh.refine = true, or mesh more finely")
        found.append(StiffnessBounds(soft.lower, stiff.upper))
    return found


def guaranteed_constants(
    problem: CellProblem, bounds: Sequence[StiffnessBounds]
) -> dict[str, Array]:
    """Return guaranteed cuts of E, ν and the constants along the axes, in SI, by their names.

    Args:
        problem: The cell, for the average that E and ν are of.
        bounds: Bounds of the stiffness at rising levels.

    Returns:
        Lower and upper ends of "E", "nu", "E_x", "E_y", "nu_xy" and "G_xy" in plane strain, nested,
        shape (levels, 2) each.
    """
    cuts = ImageModel(average=problem.average or ISOTROPIC).cuts(bounds)
    found = {"E": np.array([cut.modulus for cut in cuts])}
    found["nu"] = np.array([cut.poisson for cut in cuts])
    along_axes = np.array([cut.constants for cut in cuts]).swapaxes(0, 1)
    return found | dict(zip(NAMES, along_axes, strict=True))


def with_guaranteed_cuts(problem: CellProblem, stiffness: FuzzyStiffness) -> FuzzyStiffness:
    """Return a fuzzy stiffness with guaranteed α-cuts in place of those that samples attain.

    Cuts of stresses and loss factors stay attained.

    Args:
        problem: A cell with a mesh from a file.
        stiffness: α-cuts by samples, whose levels are used.

    Raises:
        FailedError: The cell is not solved, or the mesh is too coarse for a lower bound.
    """
    of_samples = stiffness.bounds
    levels = [float(level) for level in of_samples.alpha]
    constants = guaranteed_constants(problem, bounds_of_mesh(problem, levels))
    changed = {
        name: getattr(of_samples, name).copy()
        for name in ("lower", "upper", "error", "lower_at", "upper_at")
    }
    natures = list(of_samples.natures or [of_samples.nature] * len(of_samples.outputs))
    for name, cuts in constants.items():
        column = of_samples.column(name)
        changed["lower"][:, column], changed["upper"][:, column] = cuts.T
        natures[column] = Nature.GUARANTEED
        for unknown in ("error", "lower_at", "upper_at"):
            changed[unknown][:, column] = np.nan
    bounds = replace(of_samples, **changed, natures=tuple(natures))
    return replace(stiffness, bounds=bounds, error={})
