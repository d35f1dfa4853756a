"""The user's mesh with its law of θ and its materials, refused where they do not fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import cast

import numpy as np

from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell import AnyPhase, Phase, VoigtPhase
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.columns import from_first_rank
from alphacut.rve.mesh.file import read_grid
from alphacut.rve.mesh.gmsh_prisms import NAMES
from alphacut.rve.mesh.prism_grid import FixedCell, LevelFunction, LevelSet, PrismGrid
from alphacut.rve.prism.problem import PrismProblem
from alphacut.rve.settings import require_compressible
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


def require_own_mesh(grid: PrismGrid, law: object, phases: object) -> NamedPhases:
    """Refuse a law of another support, and materials that are not those of the physical groups.

    Raises:
        RefusedError: One does not fit.
    """
    return _in_order(require_law(grid, law), grid.names, phases)


def require_level_set(z: LevelFunction, law: object, phases: object) -> NamedPhases:
    """Refuse what is no law, and materials that are not those of matrix and particles.

    Raises:
        RefusedError: One does not fit.
    """
    if not hasattr(law, "pdf"):
        raise RefusedError("law of θ", type(law).__name__, "a law, as TruncatedNormal(-3, 3)")
    return _in_order(LevelSet(cast("ThetaLaw", law), z), NAMES[:2], phases)


def _in_order(law: FixedCell, names: Sequence[str], phases: object) -> NamedPhases:
    """Materials in the order of the mesh, whose phases have these names."""
    named = require_phases(names, phases)
    order = tuple(names.index(name) for name in named)
    return NamedPhases(law, tuple(named[name] for name in names), order)


def require_phases(names: Sequence[str], phases: object) -> Mapping[str, AnyPhase]:
    """Refuse materials that are not those of the phases of a mesh.

    Raises:
        RefusedError: One is missing or has another name.
    """
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


def require_law(grid: PrismGrid, law: object) -> FixedCell:
    """Refuse a law of another support than the levels of the mesh.

    Raises:
        RefusedError: It is one, or no law.
    """
    assert grid.fixed is not None
    theta = grid.fixed[:, 2]
    ends = np.array([theta.min(), theta.max()])
    support = np.array([getattr(law, end, np.nan) for end in ("lower", "upper")])
    if not abs(support - ends).max() <= SAME_LEVEL * np.ptp(ends) or not hasattr(law, "pdf"):
        value = f"on {support[0]:g} … {support[1]:g}"
        allowed = f"laws on {ends[0]:g} … {ends[1]:g}, the lowest and the highest level of the mesh"
        raise RefusedError("law of θ", value, allowed)
    return FixedCell(cast("ThetaLaw", law))


def own_mesh_problem(path: Path | str, parallel: bool) -> PrismProblem:
    """Problem on the user's mesh, cached for the next materials.

    Raises:
        RefusedError: There is no such file, or it is none of Gmsh.
        MeshError: It is no cell of prisms.
    """
    path = Path(path)
    if not path.is_file():
        raise RefusedError("mesh.file", path, "a file of Gmsh")
    return _problem(str(path), path.stat().st_mtime_ns, parallel)


@lru_cache(maxsize=2)
def _problem(path: str, _changed: int, parallel: bool) -> PrismProblem:
    comm = MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    return PrismProblem(from_first_rank(comm, partial(read_grid, path)), comm)
