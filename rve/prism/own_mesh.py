"""The user's mesh with its law of θ and its materials, refused where they do not fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import cast

import numpy as np

from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell.cell import AnyPhase, Phase, VoigtPhase
from alphacut.rve.cell.settings import require_compressible
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.columns import from_first_rank
from alphacut.rve.mesh.file import read_grid
from alphacut.rve.mesh.gmsh_prisms import NAMES
from alphacut.rve.mesh.prism_grid import FixedCell, LevelFunction, LevelSet, PrismGrid
from alphacut.rve.prism.problem import PrismProblem
from alphacut.stochastic import ThetaLaw

SAME_LEVEL = 1e-6
"""Distance of an end of the law from the mesh's that is none, over the support."""


@dataclass(frozen=True)
class NamedPhases:
    """Law and materials of a mesh.

    Args:
        law: Law of θ.
        phases: Materials in the order of the mesh.
        order: Number in the mesh of each material in the order of the user.
    """

    law: FixedCell
    phases: tuple[AnyPhase, ...]
    order: tuple[int, ...]


def mesh_phases(grid: PrismGrid, law: object, phases: object) -> NamedPhases:
    """Law and materials of a mesh from a file, in its order of phases, or a refusal."""
    return _order_phases(mesh_law(grid, law), grid.names, phases)


def level_set_phases(z: LevelFunction, law: object, phases: object) -> NamedPhases:
    """Law and materials of a cell with a level set z < 0 in the particles, or a refusal."""
    if not hasattr(law, "pdf"):
        raise RefusedError("law of θ", type(law).__name__, "a law, as TruncatedNormal(-3, 3)")
    return _order_phases(LevelSet(cast("ThetaLaw", law), z), NAMES[:2], phases)


def _order_phases(law: FixedCell, names: Sequence[str], phases: object) -> NamedPhases:
    """Materials in the order of `names`, those of the mesh, checked."""
    named = _checked_phases(names, phases)
    order = tuple(names.index(name) for name in named)
    return NamedPhases(law, tuple(named[name] for name in names), order)


def _checked_phases(names: Sequence[str], phases: object) -> Mapping[str, AnyPhase]:
    """The materials by name, if they are one for each name of the phases of a mesh."""
    listed = ", ".join(names)
    if not isinstance(phases, Mapping):
        value = type(phases).__name__
        raise RefusedError("phases of the mesh", value, f"{{name: phase}} for the groups {listed}")
    for name in (*phases, *names):
        if name not in phases or name not in names:
            value = repr(name) if name in phases else f"without {name!r}"
            raise RefusedError("phase", value, f"one for each physical group: {listed}")
        if not isinstance(phases[name], Phase | VoigtPhase):
            raise RefusedError(f"phase {name!r}", repr(phases[name]), "a Phase or a VoigtPhase")
    require_compressible(*phases.values())
    return phases


def mesh_law(grid: PrismGrid, law: object) -> FixedCell:
    """The law of θ for a mesh from a file, whose levels span its support.

    Raises:
        RefusedError: It has another support, or is no law.
    """
    assert grid.fixed is not None
    theta = grid.fixed[:, 2]
    low, high = theta.min(), theta.max()
    lower, upper = getattr(law, "lower", np.nan), getattr(law, "upper", np.nan)
    tolerance = SAME_LEVEL * (high - low)
    is_same = abs(lower - low) <= tolerance and abs(upper - high) <= tolerance
    if not is_same or not hasattr(law, "pdf"):
        value = f"on {lower:g} … {upper:g}"
        allowed = f"laws on {low:g} … {high:g}, the lowest and the highest level of the mesh"
        raise RefusedError("law of θ", value, allowed)
    return FixedCell(cast("ThetaLaw", law))


def own_mesh_problem(path: Path | str, parallel: bool) -> PrismProblem:
    """Problem on the mesh of a Gmsh file; cached as long as the file does not change.

    Raises:
        RefusedError: There is no such file, or it is none of Gmsh.
        MeshError: Its elements are no prisms that fill a periodic cell.
    """
    path = Path(path)
    if not path.is_file():
        raise RefusedError("mesh.file", path, "a file of Gmsh")
    return _problem(str(path), path.stat().st_mtime_ns, parallel)


@lru_cache(maxsize=2)
def _problem(path: str, _changed: int, parallel: bool) -> PrismProblem:
    comm = MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    return PrismProblem(from_first_rank(comm, partial(read_grid, path)), comm)
