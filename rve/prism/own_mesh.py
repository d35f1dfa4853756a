"""Prisms of the user's own: a mesh from a file, or particles by a level set.

Both take the law of θ and the materials by name, and give one result; only a mesh that is refined
declares an error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from pathlib import Path
from time import perf_counter
from typing import ClassVar, cast

from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import THREE_LOADS, AnyPhase, Phase, VoigtPhase, require_compressible
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.columns import from_first_rank
from alphacut.rve.mesh.file import read_grid, refined
from alphacut.rve.mesh.prism_grid import NAMES, FixedCell, LevelFunction, LevelSet, PrismGrid
from alphacut.rve.prism.cell_fields import CellFields
from alphacut.rve.prism.fields import solved_fields
from alphacut.rve.prism.model import (
    cached_grid,
    cached_problem,
    prism_result,
    require_prisms,
    with_distance,
)
from alphacut.rve.prism.problem import PrismProblem, solve_over_prisms
from alphacut.rve.result.cell_model import NamedPhasesModel
from alphacut.rve.result.checks import checks_within_limits
from alphacut.rve.result.moduli import AVERAGES, AXES
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies
from alphacut.rve.solver.krylov import SolverOptions, require_petsc
from alphacut.stochastic import ThetaDistribution
from alphacut.stochastic.theta.distribution import require_distribution

ROUGH_MESH = 0.1
"""Relative violation of a bound that a user's mesh may have, whose error nobody knows."""
REFINEMENT_SAFETY = 2.5
"""Error of the finer mesh over its distance from the coarser one: 1/(2^q − 1) where energies
converge with order q. That is 1/15 for smooth fields, 1 for those that are singular as at the tip
of a crack, and 2.4 for q = 1/2; q is less where phases of high contrast meet crosswise."""
SAME_LEVEL = 1e-6
"""Distance of an end of the law from the mesh's that is none, over the support."""


class _NamedModel(NamedPhasesModel):
    """A model whose materials have names."""

    petsc: Mapping[str, str]
    name: ClassVar[str] = "prism"
    convention: ClassVar[str] = AVERAGES[AXES]

    def problem_of(self, law: object, phases: object) -> tuple[PrismProblem, dict[str, AnyPhase]]:
        """Problem moved to the law, and the materials in the mesh's order, both checked."""
        raise NotImplementedError

    @property
    def options(self) -> SolverOptions:
        """The linear solver with what overrides it."""
        return SolverOptions(self.petsc)

    @property
    def solver_text(self) -> str:
        """How the cell is assembled and solved; see `AnyModel`."""
        return self.options.described("prisms")

    def solve(
        self, law: ThetaDistribution, phases: Mapping[str, AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness, one result in a list; energies in the order of `phases`.

        Args:
            law: Law of θ.
            phases: Materials by the name of their physical group, or of a level set "matrix" and
                "inclusion".

        Raises:
            MeshError: The mesh is no cell of prisms.
            RefusedError: Law or phases are not those of the mesh.
        """
        started = perf_counter()
        problem, named = self.problem_of(law, phases)
        stiffness = [phase.stiffness for phase in named.values()]
        solved = solve_over_prisms(problem, stiffness, THREE_LOADS, options=self.options)
        result = prism_result(solved, list(named.values()), THREE_LOADS, self.options)
        energies = cast("PhaseEnergies", result.energies)
        order = [list(named).index(name) for name in phases]
        return [
            replace(
                result,
                seconds=perf_counter() - started,
                checks=checks_within_limits(result.checks, discretisation=ROUGH_MESH),
                energies=PhaseEnergies(energies.values[order], energies.errors[order]),
            )
        ]

    def fields(self, law: ThetaDistribution, phases: Mapping[str, AnyPhase]) -> CellFields:
        """Displacements and stresses at the nodes under three unit strains, solved for them.

        Arguments and errors are those of `solve`.
        """
        problem, named = self.problem_of(law, phases)
        stiffness = [phase.stiffness for phase in named.values()]
        return solved_fields(problem, stiffness, THREE_LOADS, self.options)


@dataclass(frozen=True)
class MeshModel(_NamedModel):
    """The user's mesh of 15-node prisms, solved as it is.

    With `refine` it is solved twice: as it is, and with each prism split into eight of its own
    curved shape, whose result is returned. The declared error is `REFINEMENT_SAFETY` times the
    distance of both; it is that of the geometry that the file has.

    Args:
        file: File of Gmsh.
        refine: Whether to refine the mesh once, for a declared error.
        petsc: PETSc options without their prefix `rve_`.
        parallel: Whether all MPI ranks work on one cell together.
    """

    file: Path | str
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    refine: bool = False

    def solve(
        self, law: ThetaDistribution, phases: Mapping[str, AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """As `_NamedModel.solve`, with declared errors if refined."""
        results = super().solve(law, phases)
        if not self.refine:
            return results
        [coarse] = replace(self, refine=False).solve(law, phases)
        return [with_distance(result, coarse, safety=REFINEMENT_SAFETY) for result in results]

    def __post_init__(self) -> None:
        require_petsc(self.petsc)

    def problem_of(self, law: object, phases: object) -> tuple[PrismProblem, dict[str, AnyPhase]]:
        """Problem on the mesh, moved to the law, with law and materials checked."""
        problem = self.cached_problem()
        problem.move(mesh_law(problem.grid, law))
        return problem, in_order_of(problem.grid.names, phases)

    def cached_problem(self) -> PrismProblem:
        """Problem on the mesh, cached as long as the file does not change."""
        if not isinstance(self.file, str | Path) or not Path(self.file).is_file():
            raise RefusedError("mesh.file", self.file, "path of a file of Gmsh")
        path = Path(self.file)
        return _mesh_problem(str(path), path.stat().st_mtime_ns, self.parallel, self.refine)


@lru_cache(maxsize=2)
def _mesh_problem(path: str, _changed: int, parallel: bool, refine: bool) -> PrismProblem:
    comm = MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    read = partial(read_grid, path)
    grid = from_first_rank(read) if parallel else read()
    return PrismProblem(refined(grid) if refine else grid, comm)


@dataclass(frozen=True)
class LevelSetModel(_NamedModel):
    """Particles of any number and shape by the sign of a function, on a mesh that ignores them.

    The error is of first order in the mesh size, the result too stiff.

    Args:
        z: Takes x1, x2 and θ; negative in the particles, positive in the matrix, such as a
            distance. A mask, or a function that has one sign in the whole cell, is refused.
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1.
        petsc: PETSc options without their prefix `rve_`.
        parallel: Whether all MPI ranks work on one cell together.
    """

    z: LevelFunction
    mesh_size: float = 0.15
    layers: int = 12
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False

    def __post_init__(self) -> None:
        require_prisms(self.mesh_size, self.layers)
        require_petsc(self.petsc)

    def problem_of(self, law: object, phases: object) -> tuple[PrismProblem, dict[str, AnyPhase]]:
        """Problem on a cached mesh."""
        require_distribution(law)
        named = in_order_of(NAMES, phases)
        size, layers, parallel = self.mesh_size, self.layers, self.parallel
        grid = cached_grid(size=size, radius=0.0, layers=layers, parallel=parallel)
        problem = cached_problem(grid, parallel=self.parallel)
        problem.move(LevelSet(cast("ThetaDistribution", law), self.z))
        return problem, named


def in_order_of(names: Sequence[str], phases: object) -> dict[str, AnyPhase]:
    """Materials in the order of `names`, those of the mesh: one for each, or a refusal."""
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
    return {name: phases[name] for name in names}


def mesh_law(grid: PrismGrid, law: object) -> FixedCell:
    """The law of θ for a mesh from a file, whose levels span its support, or a refusal."""
    assert grid.fixed is not None
    theta = grid.fixed[:, 2]
    low, high = theta.min(), theta.max()
    require_distribution(law)
    lower, upper = cast("ThetaDistribution", law).lower, cast("ThetaDistribution", law).upper
    tolerance = SAME_LEVEL * (high - low)
    is_same = abs(lower - low) <= tolerance and abs(upper - high) <= tolerance
    if not is_same:
        value = f"on {lower:g} … {upper:g}"
        allowed = f"laws on {low:g} … {high:g}, the lowest and the highest level of the mesh"
        raise RefusedError("law of θ", value, allowed)
    return FixedCell(cast("ThetaDistribution", law))
