"""Prisms of the user's own: a mesh from a file or of DOLFINx, or particles by a level set.

Both take the law of θ and the materials by name, and give one result; only a mesh that is refined
declares an error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, cast

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.rve.cell.cell import THREE_LOADS, AnyPhase, Phase, VoigtPhase, require_compressible
from alphacut.rve.cell.lattice import Arrangement, lattice_of
from alphacut.rve.fenicsx import MPI
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.mesh.columns import from_first_rank
from alphacut.rve.mesh.file import checked_grid, read_grid, refined
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.mesh.plane import PlaneMesh
from alphacut.rve.mesh.prism_grid import NAMES, FixedCell, LevelFunction, LevelSet, PrismGrid
from alphacut.rve.prism.cell_fields import CellFields
from alphacut.rve.prism.dolfinx_mesh import plane_of_dolfinx
from alphacut.rve.prism.fields import solved_fields
from alphacut.rve.prism.mesh_bounds import mesh_bounds
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

if TYPE_CHECKING:
    import dolfinx

MAX_CROSSWISE = 10.0
"""Contrast of phases that meet crosswise from which on no error is declared. In a checkerboard of
conductivities 1 and c energies converge with order (8/π) atan(1/√c), which is 1/2 at c = 25."""


class _NamedModel(NamedPhasesModel):
    """A model whose materials have names."""

    petsc: Mapping[str, str]
    name: ClassVar[str] = "prism"
    convention: ClassVar[str] = AVERAGES[AXES]

    def moved_problem(self, distribution: object) -> PrismProblem:
        """Return the problem on the mesh, moved to the distribution of θ, which is checked."""
        raise NotImplementedError

    def named_phases(self, problem: PrismProblem, phases: object) -> dict[str, AnyPhase]:
        """Return the materials in the order of the problem's phases, checked."""
        return in_order_of(problem.grid.names, phases)

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
        """Return the homogenised stiffness of a mesh with named phases, one result in a list.

        Args:
            law: Distribution of the random number θ, the third coordinate of the mesh.
            phases: Materials by the name of their physical group, or of a level set "matrix" and
                "inclusion". Energies of the result are in the order of this mapping.

        Returns:
            One HomogenisedStiffness under three loads, so with the whole plane `stiffness`. It
            declares no error.

        Raises:
            MeshError: The file holds no mesh of a cell of prisms.
            RefusedError: The file cannot be read, the distribution or the phases are not those of
                the mesh, a level set has one sign, the density of θ is zero at a quadrature point,
                or PETSc does not use an option.
            FoldedMeshError: An element folds.
            ConvergenceError: The linear solver did not reach its tolerance.
            CertificateError: Bounds of the stiffness are violated by more than a tenth, or symmetry
                is violated.
        """
        started = perf_counter()
        problem = self.moved_problem(law)
        named = self.named_phases(problem, phases)
        materials = list(named.values())
        stiffness = [phase.stiffness for phase in materials]
        solved = solve_over_prisms(problem, stiffness, THREE_LOADS, options=self.options)
        result = prism_result(solved, materials, THREE_LOADS, self.options)
        energies = cast("PhaseEnergies", result.energies)
        # Problems number phases as the mesh does, the user's mapping may have another order.
        order = [list(named).index(name) for name in phases]
        # Nobody knows the error of a user's mesh. Bounds that it violates by more than a tenth show
        # a mistake.
        checks = checks_within_limits(result.checks, discretisation=0.1)
        return [
            replace(
                result,
                seconds=perf_counter() - started,
                checks=checks,
                energies=PhaseEnergies(energies.values[order], energies.errors[order]),
            )
        ]

    def fields(self, law: ThetaDistribution, phases: Mapping[str, AnyPhase]) -> CellFields:
        """Solve the cell and return displacements and stresses at the nodes, under three loads.

        The macroscopic strains (ε11, ε22, 2 ε12) are (0.01, 0.01, 0), (0, 0, 0.02) and (0.01,
        −0.01, 0).

        Args:
            law: Distribution of the random number θ.
            phases: Materials by the name of their physical group, or of a level set "matrix" and
                "inclusion".

        Returns:
            Total displacements, in halves of the cell's side, and stresses in Pa for each load.
            Nodes where phases meet stand once for each phase.

        Raises:
            MeshError: The file holds no mesh of a cell of prisms.
            RefusedError: The file, the distribution, the phases, the level set or an option of
                PETSc is not allowed.
            FoldedMeshError: An element folds.
            ConvergenceError: The linear solver did not reach its tolerance.
        """
        problem = self.moved_problem(law)
        named = self.named_phases(problem, phases)
        stiffness = [phase.stiffness for phase in named.values()]
        return solved_fields(problem, stiffness, THREE_LOADS, self.options)


@dataclass(frozen=True)
class MeshModel(_NamedModel):
    """The user's mesh of 15-node prisms, solved as it is, or of triangles that are extruded.

    Plane triangles are extruded along θ over the support of its distribution, in one layer, which
    is exact for phases that do not depend on θ. They have three or six nodes; those of three are
    made quadratic and keep their straight sides, so that a round particle is the polygon that the
    file has.

    With `refine` it is solved twice: as it is, and with each prism split into eight of its own
    curved shape, whose result is returned. The declared error is 2.5 times the distance of both; it
    is that of the geometry that the file has. No error is declared where phases more than 10 times
    as stiff as others meet these crosswise: two meshes do not tell how slowly results converge
    there. `bounds` holds there too.

    Args:
        file: File of Gmsh; its cell is a parallelogram or regular hexagon of any size and place. Or
            triangles in memory, as `from_dolfinx` gives them.
        refine: Whether to refine the mesh once, for a declared error.
        petsc: PETSc options without their prefix `rve_`.
        parallel: Whether all MPI ranks work on one cell together.
    """

    file: Path | str | PlaneMesh
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    refine: bool = False

    def __post_init__(self) -> None:
        """RefusedError unless `petsc` is a table of options without dash, and `refine` a bool."""
        require_petsc(self.petsc)
        require(isinstance(self.refine, bool), "refine", repr(self.refine), "True or False")

    @classmethod
    def from_dolfinx(
        cls,
        mesh: dolfinx.mesh.Mesh,
        cell_tags: dolfinx.mesh.MeshTags,
        names: Mapping[int, str] | None = None,
        **options: Any,
    ) -> Self:
        """Return the model of a plane mesh of DOLFINx, which is extruded along θ.

        Args:
            mesh: Triangles with straight sides or of order 2 on one process, which fill a
                parallelogram or regular hexagon and have the same nodes on opposite sides.
            cell_tags: A tag for each cell, which names its phase.
            names: Names of the phases by tag; "group TAG" for tags that are not in it.
            options: `petsc`, `parallel` and `refine` of the model.

        Raises:
            RefusedError: The mesh has other cells or is distributed over processes, a cell has no
                tag, a name is of no tag, or an option is not allowed.

        Example:
            >>> from alphacut.rve.fenicsx import MPI, dolfinx
            >>> mesh = dolfinx.mesh.create_unit_square(MPI.COMM_SELF, 2, 2)
            >>> cells = np.arange(8, dtype=np.int32)
            >>> tags = dolfinx.mesh.meshtags(mesh, 2, cells, (cells > 3).astype(np.int32))
            >>> model = MeshModel.from_dolfinx(mesh, tags, {0: "soft", 1: "hard"})
            >>> model.file.names
            ('soft', 'hard')
        """
        return cls(plane_of_dolfinx(mesh, cell_tags, names or {}), **options)

    def solve(
        self, law: ThetaDistribution, phases: Mapping[str, AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Return the homogenised stiffness of the mesh, one result in a list.

        With `refine` the cell is solved on the mesh and on one with each prism split into eight.
        The result is that of the finer mesh, and its declared error is 2.5 times the distance of
        both; it declares none where phases of high contrast meet crosswise.

        Args:
            law: Distribution of the random number θ; its support is the range of the third
                coordinate.
            phases: Materials by the name of their physical group.

        Raises:
            MeshError: The file holds no mesh of a cell of prisms, or one that cannot be refined.
            RefusedError: The file, the distribution, the phases or an option of PETSc is not
                allowed.
            FoldedMeshError: An element folds.
            ConvergenceError: The linear solver did not reach its tolerance.
            CertificateError: A bound of the stiffness is violated by more than a tenth.
        """
        results = super().solve(law, phases)
        if not self.refine:
            return results
        grid = self.moved_problem(law).grid
        stiffness = [phase.stiffness for phase in in_order_of(grid.names, phases).values()]
        if max_contrast(stiffness) > MAX_CROSSWISE and meet_crosswise(grid, stiffness):
            return results
        [coarse] = replace(self, refine=False).solve(law, phases)
        # The error of the finer mesh over its distance from the coarser one is 1/(2^q − 1) where
        # energies converge with order q: 1/15 for smooth fields, 1 for fields that are singular as
        # at the tip of a crack, and 2.4 for q = 1/2. q is less only where phases of high contrast
        # meet crosswise.
        return [with_distance(result, coarse, safety=2.5) for result in results]

    def bounds(self, law: ThetaDistribution, phases: Mapping[str, AnyPhase]) -> StiffnessBounds:
        """Return guaranteed bounds of the mean stiffness over θ, for this mesh's geometry.

        Displacements bound it from above and stresses in equilibrium from below, both over the
        prisms of the mesh, or over those that each is split into with `refine`. Curved edges and
        the distribution of θ are counted. The distance of the bounds falls with the fourth power of
        the mesh size where fields are smooth, and more slowly at corners of particles.

        Args:
            law: Distribution of the random number θ, with its cumulative distribution function.
            phases: Materials by the name of their physical group.

        Raises:
            MeshError: The file holds no mesh of a cell of prisms, or middles of vertical edges do
                not lie half-way between levels.
            RefusedError: The file, the distribution, the phases or an option of PETSc is not
                allowed.
            FoldedMeshError: A prism cannot be shown to be unfolded.
            ConvergenceError: The linear solver did not reach its tolerance.
        """
        problem = self.moved_problem(law)
        named = self.named_phases(problem, phases)
        return mesh_bounds(problem, [phase.stiffness for phase in named.values()], self.options)

    def moved_problem(self, distribution: object) -> PrismProblem:
        """Return the problem on the mesh; see `_NamedModel`."""
        require_distribution(distribution)
        theta = cast("ThetaDistribution", distribution)
        problem = self.cached_problem((float(theta.lower), float(theta.upper)))
        problem.move(mesh_law(problem.grid, distribution))
        return problem

    def cached_problem(self, theta: tuple[float, float] = (0.0, 1.0)) -> PrismProblem:
        """Return the problem on the mesh, cached as long as the file does not change.

        Args:
            theta: Lowest and highest level of θ of extruded triangles.

        Raises:
            MeshError: It is no mesh of a cell.
            RefusedError: There is no such file, or it cannot be read.
        """
        source = self.file
        changed = 0
        if isinstance(source, str | Path) and Path(source).is_file():
            # The time of the last change is part of the cache's key: a new file is read anew.
            changed = Path(source).stat().st_mtime_ns
        elif not isinstance(source, PlaneMesh):
            raise RefusedError("mesh.file", source, "path of a file of Gmsh")
        read = _Read(source, changed, theta)
        return _mesh_problem(read, self.parallel, self.refine)


class _Read(NamedTuple):
    """A mesh that was changed at a time, in ns, with the levels of extruded triangles."""

    source: Path | str | PlaneMesh
    changed: int
    theta: tuple[float, float]

    def grid(self) -> PrismGrid:
        """Return the checked grid of the file, or of the triangles in memory."""
        if isinstance(self.source, PlaneMesh):
            return checked_grid(self.source.prisms(self.theta))
        return read_grid(self.source, self.theta)


@lru_cache(maxsize=2)
def _mesh_problem(read: _Read, parallel: bool, refine: bool) -> PrismProblem:
    """Return the problem on a mesh."""
    comm = MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    grid = from_first_rank(read.grid) if parallel else read.grid()
    return PrismProblem(refined(grid) if refine else grid, comm)


@dataclass(frozen=True)
class LevelSetModel(_NamedModel):
    """Particles of any number and shape by the sign of a function, on a mesh that ignores them.

    The error is of first order in the mesh size. Particles that are stiffer than the matrix make
    the result too stiff, as a rule; softer ones make it too stiff or too soft.

    Args:
        z: Takes x1, x2 and θ; negative in the particles, positive in the matrix, such as a
            distance. A mask, or a function that has one sign in the whole cell, is refused.
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1.
        petsc: PETSc options without their prefix `rve_`.
        parallel: Whether all MPI ranks work on one cell together.
        lattice: The cell, "square", "hexagonal", or a rectangle of the sides [a, b]; see
            `lattice_of`.
    """

    z: LevelFunction
    mesh_size: float = 0.15
    layers: int = 12
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    lattice: Arrangement = "square"

    def __post_init__(self) -> None:
        """RefusedError for a mesh size, layers, options or a lattice that are not allowed."""
        require_prisms(self.mesh_size, self.layers)
        lattice_of(self.lattice)
        require_petsc(self.petsc)

    def moved_problem(self, distribution: object) -> PrismProblem:
        """Return the cached problem on a plain mesh, with the phases of the level set.

        A later call moves the same object.

        Args:
            distribution: Distribution of the random number θ, which is checked.

        Raises:
            RefusedError: It is no distribution of θ, its density is zero at a quadrature point, or
                the level set does not give numbers or has one sign in the whole cell.
        """
        require_distribution(distribution)
        # A mesh without a particle serves all level sets.
        grid = cached_grid(
            size=self.mesh_size,
            radius=0.0,
            layers=self.layers,
            parallel=self.parallel,
            lattice=lattice_of(self.lattice),
        )
        problem = cached_problem(grid, parallel=self.parallel)
        problem.move(LevelSet(cast("ThetaDistribution", distribution), self.z))
        return problem

    def named_phases(self, problem: PrismProblem, phases: object) -> dict[str, AnyPhase]:
        """Return matrix and inclusion, which no part of the mesh is named by."""
        return in_order_of(NAMES, phases)


def in_order_of(names: Sequence[str], phases: object) -> dict[str, AnyPhase]:
    """Return the materials in the order of `names`, those of the mesh.

    Args:
        names: Names of the phases of the mesh.
        phases: What the user gave as materials by name.

    Raises:
        RefusedError: `phases` is no mapping, has a name that is not in `names` or lacks one, a
            value is neither a Phase nor a VoigtPhase, or a Poisson's ratio is above 0.45, where
            quadratic elements lock.
    """
    listed = ", ".join(names)
    if not isinstance(phases, Mapping):
        value = type(phases).__name__
        raise RefusedError("phases of the mesh", value, f"{{name: phase}} for the groups {listed}")
    allowed = f"one for each physical group: {listed}"
    cure = 'write the names of the mesh, or name its groups: addPhysicalGroup(3, …, name="matrix")'
    for name, phase in phases.items():
        if name not in names:
            raise RefusedError("phase", repr(name), allowed, cure)
        if not isinstance(phase, Phase | VoigtPhase):
            raise RefusedError(f"phase {name!r}", repr(phase), "a Phase or a VoigtPhase")
    for name in names:
        if name not in phases:
            raise RefusedError("phase", f"without {name!r}", allowed, cure)
    require_compressible(*phases.values())
    return {name: phases[name] for name in names}


def max_contrast(stiffness: Sequence[Array]) -> float:
    """Return the largest ratio of the energies of two phases under one strain.

    `stiffness` is that of each phase, positive definite, (3, 3) each, in one unit.
    """
    of_phases = np.array(stiffness)
    ratios = np.linalg.solve(of_phases[:, np.newaxis], of_phases)
    return float(np.linalg.eigvals(ratios).real.max())


def meet_crosswise(grid: PrismGrid, stiffness: Sequence[Array]) -> bool:
    """Return whether at some vertex stiff phases lie between softer ones more than once.

    Around such a vertex the stiffness has two maxima or more, as at the corner of a checkerboard.
    Fields are then arbitrarily singular at high contrast; elsewhere energies converge at least with
    the root of the mesh size (Petzoldt, Adv. Comput. Math. 16, 47, 2002, quasi-monotone
    coefficients).

    Args:
        grid: The mesh, of columns of prisms of one phase each.
        stiffness: Stiffness of each phase, (3, 3) each, in one unit; their traces order the phases.
    """
    plane = grid.plane
    # Nodes that the lattice leads from one to the other have one number, that of their unknown.
    number = unknowns(plane.points, plane.lattice)
    triangles = number[plane.triangles]
    rank = np.argsort(np.argsort([np.trace(of_phase) for of_phase in stiffness]))
    rank_of_triangle = rank[grid.phase[: len(triangles)]]
    edge_ends = number[plane.ends]
    for threshold in range(1, len(stiffness)):
        is_stiff = rank_of_triangle >= threshold
        # An edge between a stiff and a soft triangle has one stiff one.
        count = np.zeros(number.max() + 1, int)
        np.add.at(count, triangles[is_stiff, 3:], 1)
        # Each edge of the interface once, whose partner across the cell has the same number.
        middles, first = np.unique(number[plane.vertices :], return_index=True)
        on_interface = first[count[middles] == 1]
        # Two edges of the interface at a vertex bound one sector of stiff triangles. The corners of
        # the cell have the number −1, which counts as the last one.
        interfaces = np.zeros(number.max() + 2, int)
        np.add.at(interfaces, edge_ends[on_interface], 1)
        if interfaces.max() > 2:
            return True
    return False


def mesh_law(grid: PrismGrid, law: object) -> FixedCell:
    """Return the distribution of θ for a mesh from a file, in the place of a radius map.

    Args:
        grid: A mesh with the positions `fixed` of all nodes, whose third coordinate is θ; without
            them an AssertionError is raised.
        law: What the user gave as the distribution of θ.

    Returns:
        A map that has the distribution and no radii (NaN).

    Raises:
        RefusedError: `law` is no distribution of θ, or its support differs from the range of θ of
            the mesh by more than 1e-9 of that range.
    """
    assert grid.fixed is not None
    theta = grid.fixed[:, 2]
    low = theta.min()
    high = theta.max()
    require_distribution(law)
    distribution = cast("ThetaDistribution", law)
    # Ends that differ by less count as the same. That is far above the noise of Gmsh's coordinates,
    # and moves the geometry by less than the margin of guaranteed bounds.
    tolerance = 1e-9 * (high - low)
    distances = abs(distribution.lower - low), abs(distribution.upper - high)
    if max(distances) > tolerance:
        value = f"on {distribution.lower:.12g} … {distribution.upper:.12g}"
        allowed = f"laws on {low:.12g} … {high:.12g}, the lowest and the highest level of the mesh"
        cure = f"a case has radius.theta = [{low:.12g}, {high:.12g}]"
        raise RefusedError("law of θ", value, allowed, cure)
    return FixedCell(distribution)
