"""Product-space model: finite elements on cell × θ (sections 3.1, 4.2, 4.3).

This differs from the paper in: 1. The interface is a set of curved element faces, not the sign of z
at quadrature points (`interface="sign"` is the paper's eq. 13). 2. The fluctuation is fixed on the
whole line of one periodic corner over θ.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from typing import ClassVar, cast

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell.cell import (
    LOADS,
    THREE_LOADS,
    AnyPhase,
    Cell,
    Interphase,
    Phase,
    thickness_of,
)
from alphacut.rve.cell.outline import Outline, circle, is_round
from alphacut.rve.cell.settings import (
    require_compressible,
    require_interphase,
    require_mesh_size,
    require_parts,
)
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.prism_grid import RING_THICKNESS, LevelFunction, reference_radius
from alphacut.rve.mesh.square import REFINEMENTS
from alphacut.rve.prism.error_estimate import with_errors
from alphacut.rve.prism.modulus_basis import TOLERANCE, ModulusBasis, modulus_basis
from alphacut.rve.prism.own_mesh import NamedPhases, level_set_phases, mesh_phases, own_mesh_problem
from alphacut.rve.prism.problem import FoldedMeshError, PrismProblem, SliceStrains
from alphacut.rve.result.checks import ROUND_OFF, checks_within_limits, mean, stress_checks
from alphacut.rve.result.moduli import moduli_of_energies
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies, StressCurve
from alphacut.rve.solver.krylov import Solutions, SolverOptions, solve
from alphacut.stochastic import RadiusMap, ThetaLaw

ROUGH_MESH = 0.1
"""Relative violation of a bound that a user's mesh may have, whose error nobody knows."""
INTERFACES = ("conforming", "sign")
Seconds = dict[str, float]


@dataclass(frozen=True)
class PrismModel:
    """Product-space finite elements: quadratic serendipity prisms around the cone.

    Args:
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1 (paper: 12).
        interface: "conforming", or "sign" for a mesh that ignores the interface (first order in h,
            too stiff: for comparison, or with `level_set`).
        petsc: PETSc options without their prefix `rve_`; they override the default solver's.
        parallel: Whether all MPI ranks work on one cell together; if not each works on its own.
        stiffness: Whether to solve a third load, for the whole planar stiffness.
        estimate: Whether to declare the errors, measured against the series, or the slices where
            that has no formula.
        moduli: Least and greatest modulus of the particle, in Pa, between which samples of a map
            are projected on two solutions; None: each is solved.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
        mesh: File of Gmsh with the user's mesh, which is solved as it is; see `solve`.
        level_set: Function z(x1, x2, θ) that is negative in the particles, any number of them, for
            interface "sign"; see `solve`.

    Raises:
        RefusedError: An option out of range or unknown.

    Example:
        >>> from alphacut.rve import Phase
        >>> from alphacut.stochastic import HermiteMap
        >>> model = PrismModel(mesh_size=0.5, layers=2, estimate=False)
        >>> [result] = model.solve(HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), [Phase(80e9)])
        >>> 20e9 < result.modulus < 26e9
        True
    """

    mesh_size: float = 0.15
    layers: int = 12
    interface: str = "conforming"
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    stiffness: bool = False
    estimate: bool = True
    moduli: tuple[float, float] | None = None
    outline: Outline = circle
    mesh: Path | str = ""
    level_set: LevelFunction | None = None
    name: ClassVar[str] = "prism"

    def __post_init__(self) -> None:
        """Refuse a mesh size, number of layers, interface or level set that is not allowed."""
        require_mesh_size(self.mesh_size)
        if self.layers < 1:
            raise RefusedError("the number of layers", self.layers, "1 or more")
        if self.interface not in INTERFACES:
            raise RefusedError("the interface", repr(self.interface), ", ".join(INTERFACES))
        if self.level_set is not None and (self.mesh or self.interface != "sign"):
            value = "beside a mesh" if self.mesh else f"beside interface {self.interface!r}"
            raise RefusedError("level set", value, "interface 'sign' without a mesh")

    def solve(
        self,
        radius_map: RadiusMap | ThetaLaw,
        matrix: AnyPhase | Mapping[str, AnyPhase],
        inclusions: Sequence[AnyPhase] = (),
        interphase: Interphase | None = None,
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness for each of `inclusions`, in their order, on one mesh.

        On the user's mesh, or with a level set, there is one result, without a declared error, with
        energies in the order of the materials.

        Args:
            radius_map: Radius of the particle over θ; on the user's mesh the law of θ.
            matrix: Material of the matrix; on the user's mesh all materials by physical group, with
                a level set by "matrix" and "inclusion".
            inclusions: Materials of the particle, each of which is solved.
            interphase: Ring around the particle, if there is one.

        Raises:
            ConvergenceError: The linear solver stopped early.
            CertificateError: A property that every right result has is violated.
            FoldedMeshError: The map bends more than the layers can follow.
            MeshError: The user's mesh is no cell of prisms.
            RefusedError: A Poisson's ratio is above 0.45, or a radius does not fit, or law and
                phases are not those of the mesh.
        """
        if self.mesh or self.level_set is not None:
            return [self._solve_own_mesh(radius_map, matrix)]
        matrix = cast("Phase", matrix)
        radius_map = cast("RadiusMap", radius_map)
        require_parts(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        require_interphase(interphase, self.outline)
        seconds: Seconds = {}
        with timed(seconds, "mesh"):
            problem = self.problem(radius_map, thickness_of(interphase))
        with timed(seconds, "solve"):
            # reduced basis that serves all inclusions; beside a ring each one is solved
            basis = None if interphase else self._basis(problem, matrix, inclusions)
        results = []
        for inclusion in inclusions:
            cell = Cell(matrix, inclusion, radius_map, self.outline, interphase)
            if basis is not None and isinstance(inclusion, Phase):
                strains, residual = basis.project(inclusion.modulus), basis.error
                iterations = basis.iterations
            else:
                strains, solved = self._solve_system(
                    problem, cell.stiffness, self.loads(cell), seconds
                )
                iterations, residual = solved.iterations, solved.residual
            result = replace(
                self._result(strains, cell, residual),
                unknowns=problem.numbering.size,
                iterations=iterations,
                seconds={**seconds, "total": sum(seconds.values())},
            )
            results.append(result)
            seconds = {}
        return results

    def _solve_own_mesh(self, law: object, phases: object) -> HomogenisedStiffness:
        """Homogenised stiffness on the mesh of a file or with a level set, without errors."""
        seconds: Seconds = {}
        with timed(seconds, "mesh"):
            problem, named = self.mesh_problem(law, phases)
        loads, stiffness = THREE_LOADS, [phase.stiffness for phase in named.phases]
        strains, solved = self._solve_system(problem, stiffness, loads, seconds)
        checks = _checks(strains, stiffness, loads, named.phases) | {"residual": solved.residual}
        energies = energies_of(strains, named.phases, loads)
        order = list(named.order)  # of the user
        return HomogenisedStiffness(
            _stress_curve(strains, stiffness, loads),
            self.name,
            str(self.options),
            unknowns=problem.numbering.size,
            iterations=solved.iterations,
            seconds={**seconds, "total": sum(seconds.values())},
            checks=checks_within_limits(checks, discretisation=ROUGH_MESH),
            energies=PhaseEnergies(energies.values[order], energies.errors[order]),
        )

    def mesh_problem(self, law: object, phases: object) -> tuple[PrismProblem, NamedPhases]:
        """Problem on the mesh of a file or with a level set, and its law and phases; cached.

        Raises:
            MeshError: The file holds no cell of prisms.
            RefusedError: Law or phases are not those of the mesh.
        """
        if self.level_set is None:
            problem = own_mesh_problem(self.mesh, self.parallel)
            named = mesh_phases(problem.form.grid, law, phases)
        else:
            named = level_set_phases(self.level_set, law, phases)
            mesh = (self.mesh_size, 0.0, circle, REFINEMENTS[0], self.layers, self.parallel)
            problem = _cached_problem(*mesh, 0.0)
        problem.move(named.law)
        return problem, named

    def problem(self, radius_map: RadiusMap, thickness: float = 0.0) -> PrismProblem:
        """Mesh and form for a radius map; cached, so that the next map moves the same mesh.

        Args:
            radius_map: Radius of the particle over θ.
            thickness: Of the interphase, 0 for none.

        Raises:
            FoldedMeshError: The map bends more than the layers can follow.
            RefusedError: A radius does not fit into the cell.
        """
        radius = reference_radius(radius_map, self.outline, thickness)
        if self.interface != "conforming":
            return self._moved_problem(radius_map, 0.0, REFINEMENTS[0])
        if is_round(self.outline):
            return self._moved_problem(radius_map, radius, REFINEMENTS[0], thickness)
        for refinement in REFINEMENTS[:-1]:  # shorter edges where elements at bends fold
            with suppress(FoldedMeshError):
                return self._moved_problem(radius_map, radius, refinement)
        return self._moved_problem(radius_map, radius, REFINEMENTS[-1])

    def _moved_problem(
        self, radius_map: RadiusMap, radius: float, refinement: float, thickness: float = 0.0
    ) -> PrismProblem:
        """Problem on the mesh of a reference radius, with its nodes moved to a map."""
        mesh = (self.mesh_size, radius, self.outline, refinement, self.layers, self.parallel)
        problem = _cached_problem(*mesh, RING_THICKNESS if thickness else 0.0)
        problem.move(radius_map, thickness)
        return problem

    @property
    def options(self) -> SolverOptions:
        """The linear solver with what overrides it."""
        return SolverOptions(self.petsc)

    def loads(self, cell: Cell) -> Array:
        """Macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3) (eq. 15): two or three.

        Two give E and ν of a cell with the symmetry of the square; others need three.
        """
        return LOADS if cell.square and not self.stiffness else THREE_LOADS

    def _basis(
        self, problem: PrismProblem, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> ModulusBasis | None:
        """Reduced basis for samples that differ only in the modulus of isotropic inclusions.

        None if samples differ otherwise, a modulus lies outside the range `self.moduli`, or the
        error of the basis exceeds `TOLERANCE`: each sample is then solved.
        """
        if not (isinstance(matrix, Phase) and self.moduli and self.interface == "conforming"):
            return None
        phases = [phase for phase in inclusions if isinstance(phase, Phase)]
        poisson_ratios = {phase.poisson for phase in phases}
        moduli = [phase.modulus for phase in phases]
        if len(phases) < len(inclusions) or len(poisson_ratios) > 1 or self.petsc:
            return None
        low, high = self.moduli
        is_within = low * (1 - ROUND_OFF) <= min(moduli) and max(moduli) <= high * (1 + ROUND_OFF)
        if low == high or not is_within:
            return None
        cell = Cell(matrix, inclusions[0], problem.map, self.outline)
        basis = modulus_basis(problem, matrix, poisson_ratios.pop(), self.moduli, self.loads(cell))
        return basis if basis.error <= TOLERANCE else None

    def _solve_system(
        self,
        problem: PrismProblem,
        stiffness: Sequence[Array],
        strains: Array,
        seconds: Seconds,
    ) -> tuple[SliceStrains, Solutions]:
        """Solve for macroscopic strains, shape (loads, 3): mean strains of slices, and solutions.

        Wall times are added to those of the stages in `seconds`.
        """
        with timed(seconds, "assemble"):
            problem.assemble(stiffness)
            loads = problem.loads(strains)
        is_homogeneous = all(np.array_equal(phase, stiffness[0]) for phase in stiffness)
        if is_homogeneous:  # without fluctuation
            zeros = [load.duplicate() for load in loads]
            solutions = Solutions(zeros, iterations=(0,) * len(loads), residual=0.0)
        else:
            with timed(seconds, "setup"):
                ksp = problem.solver(self.options)
            with timed(seconds, "solve"):
                solutions = solve(ksp, loads)
        with timed(seconds, "solve"):
            fluctuations = [problem.field(vector) for vector in solutions.vectors]
            means = problem.slice_strains(list(zip(strains, fluctuations, strict=True)))
        return means, solutions

    def _result(self, strains: SliceStrains, cell: Cell, residual: float) -> HomogenisedStiffness:
        """Homogenised stiffness from mean strains of slices, with declared errors and checks.

        Args:
            strains: Of the slices, under `loads(cell)`.
            cell: The cell solved.
            residual: Relative residual of the linear system.
        """
        loads = self.loads(cell)
        result = HomogenisedStiffness(
            _stress_curve(strains, cell.stiffness, loads),
            self.name,
            str(self.options),
            cell=cell,
            energies=energies_of(strains, cell.phases, loads),
        )
        if self.estimate:
            result = with_errors(result)
        allowed = 2 * result.largest_error if result.errors else self._mesh_tolerance
        checks = _checks(strains, cell.stiffness, loads, cell.phases) | {"residual": residual}
        return replace(
            result, checks=checks_within_limits(checks, discretisation=ROUND_OFF + allowed)
        )

    @property
    def _mesh_tolerance(self) -> float:
        """Relative error of the stiffness to allow for in checks where none is declared."""
        return 0.1 * self.mesh_size ** (3 if self.interface == "conforming" else 1)


def energies_of(strains: SliceStrains, phases: Sequence[AnyPhase], loads: Array) -> PhaseEnergies:
    """Energies of the phases under macroscopic strains `loads` (n, 3); their errors are nan."""
    parts = strains.energy_parts([phase.stiffness_parts for phase in phases])
    values = moduli_of_energies(parts, loads)
    return PhaseEnergies(values, np.full(values.shape, np.nan))


def _stress_curve(strains: SliceStrains, stiffness: Sequence[Array], loads: Array) -> StressCurve:
    """Homogenised stress at each θ, with the stiffness if there are three loads."""
    stress = strains.stress(stiffness)
    by_theta = stress @ np.linalg.inv(loads).T if len(loads) == 3 else None
    return StressCurve(
        strains.theta, strains.weights, s11=stress[:, 0, 0], s12=stress[:, 2, 1], stiffness=by_theta
    )


def _checks(
    strains: SliceStrains,
    stiffness: Sequence[Array],
    loads: Array,
    phases: Sequence[AnyPhase],
) -> dict[str, float]:
    """Relative violations of Hill–Mandel, symmetry and bounds, by their names in `WHAT`."""
    stress, energy = strains.stress(stiffness), strains.energy(stiffness)
    work = loads @ mean(strains.weights, stress)
    return {
        "hill_mandel": float(abs(work.T - energy).max() / abs(energy).max()),
        **stress_checks(stress, loads, strains.fractions, strains.weights, phases),
    }


@contextmanager
def timed(seconds: Seconds, stage: str) -> Iterator[None]:
    """Context that adds its wall time to that of a stage in `seconds`."""
    started = perf_counter()
    try:
        yield
    finally:
        seconds[stage] = seconds.get(stage, 0.0) + perf_counter() - started


@lru_cache(maxsize=2)
def _cached_problem(
    size: float,
    radius: float,
    outline: Outline,
    refinement: float,
    layers: int,
    parallel: bool,
    thickness: float,
) -> PrismProblem:
    """Mesh, form and numbering for any map with this reference radius; see `extrude`."""
    comm = MPI.COMM_WORLD if parallel else MPI.COMM_SELF
    grid = extrude(
        size=size,
        radius=radius,
        layers=layers,
        outline=outline,
        refinement=refinement,
        thickness=thickness,
        comm=comm,
    )
    return PrismProblem(grid, comm)
