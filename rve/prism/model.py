"""Product-space model: finite elements on cell × θ (sections 3.1, 4.2, 4.3).

This differs from the paper in: 1. The interface is a set of curved element faces, not the sign of z
at quadrature points (`LevelSetModel` takes the paper's eq. 13). 2. The fluctuation is fixed on the
whole line of one periodic corner over θ.

The product space has no θ-derivative, so its exact solution at each θ is that of a two-dimensional
unit cell. Its declared error is the distance from a reference that solves those, plus that
reference's: the multipole series for circles of isotropic phases, slices of order 4 for all others.
Neither shares elements or mesh with the prisms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from time import perf_counter
from typing import ClassVar, Self, TypeVar

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, is_number, require, require_numbers
from alphacut.rve.cell.cell import (
    LOADS,
    STRAIN,
    THREE_LOADS,
    AnyPhase,
    Cell,
    Phase,
    require_compressible,
    require_mesh_size,
    require_solve_arguments,
)
from alphacut.rve.cell.outline import Outline, circle, is_round, require_outline
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.prism_grid import PrismGrid, reference_radius
from alphacut.rve.mesh.square import REFINEMENTS
from alphacut.rve.prism.cell_fields import CellFields
from alphacut.rve.prism.fields import solved_fields
from alphacut.rve.prism.modulus_basis import TOLERANCE, ModulusBasis, modulus_basis
from alphacut.rve.prism.problem import FoldedMeshError, PrismProblem, Solved
from alphacut.rve.prism.slices import SliceProblem
from alphacut.rve.result.cell_model import Resolution
from alphacut.rve.result.checks import ROUND_OFF, checks_within_limits, mean, stress_checks
from alphacut.rve.result.moduli import AVERAGES, AXES, axial_moduli
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies, StressCurve
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel
from alphacut.rve.solver.form import energies_by_phase, total_energy
from alphacut.rve.solver.krylov import SolverOptions, require_petsc, solve
from alphacut.stochastic import RadiusMap

AnyProblem = TypeVar("AnyProblem", PrismProblem, SliceProblem)

SERIES_ACCURACY = 1e-9  # relative, of a reference by the series
SLICES_POINTS = 14  # nodes in θ of a reference by slices


cached_grid = lru_cache(maxsize=2)(extrude)  # prisms for any map with one reference radius


@dataclass(frozen=True)
class PrismModel:
    """Product-space finite elements: quadratic serendipity prisms around the cone of a radius map.

    Args:
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1 (paper: 12).
        petsc: PETSc options without their prefix `rve_`; they override the default solver's.
        parallel: Whether all MPI ranks work on one cell together; if not each works on its own.
        stiffness: Whether to solve a third load, for the whole planar stiffness.
        estimate: Whether to declare the errors.
        modulus_range: Least and greatest Young's modulus of the particle, in Pa, between which
            samples of a map are projected on two solutions; None: each is solved.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
    """

    mesh_size: float = 0.15
    layers: int = 12
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    stiffness: bool = False
    estimate: bool = True
    modulus_range: tuple[float, float] | None = None
    outline: Outline = circle
    name: ClassVar[str] = "prism"
    convention: ClassVar[str] = AVERAGES[AXES]
    is_exact: ClassVar[bool] = False

    def __post_init__(self) -> None:
        require_prisms(self.mesh_size, self.layers)
        require_petsc(self.petsc)
        require_outline(self.outline)
        if self.modulus_range is not None:
            require_numbers("modulus_range", self.modulus_range)
            is_range = len(self.modulus_range) == 2
            require(is_range, "modulus_range", self.modulus_range, "least and greatest, in Pa")

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """The prisms of a resolution; see `CellModel`."""
        return cls(
            resolution.mesh_size,
            resolution.layers,
            petsc=resolution.petsc,
            parallel=resolution.parallel,
            stiffness=resolution.whole_stiffness,
            estimate=resolution.estimate,
            outline=resolution.outline,
        )

    @property
    def errors_by_reference(self) -> bool:
        """Whether errors are declared; see `CellModel`."""
        return self.estimate

    def for_samples(self, moduli: tuple[float, float] | None, *, energies: bool) -> Self:
        """Prisms without declared errors, whose samples share solutions; see `CellModel`."""
        return replace(self, estimate=False, modulus_range=moduli)

    def coarser(self) -> Self:
        """Prisms on triangles twice as large."""
        return replace(self, mesh_size=min(2 * self.mesh_size, 1.0))

    def solve(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness for each of `inclusions`, in their order, on one mesh.

        Raises:
            ConvergenceError: The linear solver stopped early.
            CertificateError: A property that every right result has is violated.
            FoldedMeshError: The map bends more than the layers can follow.
            RefusedError: A Poisson's ratio is above 0.45, or a radius does not fit.
        """
        require_solve_arguments(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        started = perf_counter()
        problem = self._moved_slices(radius_map) if self.by_slices else self.problem(radius_map)
        basis = self._basis(problem, matrix, inclusions)  # serves all inclusions
        results = []
        for inclusion in inclusions:
            cell = Cell(matrix, inclusion, radius_map, self.outline)
            loads = self.loads(cell)
            if basis is not None and isinstance(inclusion, Phase):
                solved = basis.project(inclusion.modulus)
            else:
                solved = solve_sample(problem, cell.stiffness, loads, options=self.options)
            result = prism_result(solved, problem.numbering.size, cell.phases, loads, self.options)
            result = replace(result, cell=cell, seconds=perf_counter() - started)
            if self.estimate:
                result = with_distance(result, _reference_result(cell))
            # of a mesh of triangles of order 2 where no error is declared
            allowed = 2 * result.largest_error if result.errors else 0.1 * self.mesh_size**3
            checks = checks_within_limits(result.checks, discretisation=ROUND_OFF + allowed)
            results.append(replace(result, checks=checks))
            started = perf_counter()
        return results

    def fields(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> CellFields:
        """Displacements and stresses at the nodes, of one inclusion; the cell is solved for them.

        Raises:
            As `solve`, and RefusedError of several inclusions.
        """
        require_solve_arguments(radius_map, matrix, inclusions, isotropic=False)
        require(len(inclusions) == 1, "inclusions", len(inclusions), "one, for fields")
        cell = Cell(matrix, inclusions[0], radius_map, self.outline)
        problem = self.problem(radius_map)
        return solved_fields(problem, cell.stiffness, self.loads(cell), self.options)

    def problem(self, radius_map: RadiusMap) -> PrismProblem:
        """DOLFINx's mesh and form for a map; cached, so that the next map moves the same mesh.

        Raises:
            FoldedMeshError: The map bends more than the layers can follow.
            RefusedError: A radius does not fit into the cell.
        """
        return self._moved(radius_map, partial(cached_problem, parallel=self.parallel))

    @property
    def by_slices(self) -> bool:
        """Whether the form is assembled over slices, on one rank, or over prisms.

        Over slices the stiffness is an operator without entries, which the preconditioner along θ
        takes and others of PETSc do not.
        """
        return self.options.by_levels and not self.parallel

    @property
    def solver_text(self) -> str:
        """How the cell is assembled and solved."""
        return self.options.described("slices" if self.by_slices else "prisms")

    def _moved_slices(self, radius_map: RadiusMap) -> SliceProblem:
        return self._moved(radius_map, cached_slices)

    def _moved(
        self, radius_map: RadiusMap, cached: Callable[[PrismGrid], AnyProblem]
    ) -> AnyProblem:
        """Problem on the mesh of a map's reference radius, with its nodes moved to the map."""
        radius = reference_radius(radius_map, self.outline)

        def on_mesh(refinement: float) -> AnyProblem:
            grid = cached_grid(
                size=self.mesh_size,
                radius=radius,
                layers=self.layers,
                outline=self.outline,
                refinement=refinement,
                parallel=self.parallel,
            )
            problem = cached(grid)
            problem.move(radius_map)
            return problem

        if is_round(self.outline):
            return on_mesh(REFINEMENTS[0])
        for refinement in REFINEMENTS[:-1]:  # shorter edges where elements at bends fold
            with suppress(FoldedMeshError):
                return on_mesh(refinement)
        return on_mesh(REFINEMENTS[-1])

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
        self, problem: object, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> ModulusBasis | None:
        """Reduced basis for samples that differ only in the modulus of isotropic inclusions."""
        if not (isinstance(problem, SliceProblem) and self.modulus_range):
            return None
        (low, high), phases = self.modulus_range, [x for x in inclusions if isinstance(x, Phase)]
        are_alike = len(phases) == len(inclusions) and len({x.poisson for x in phases}) == 1
        within = low * (1 - ROUND_OFF), high * (1 + ROUND_OFF)
        if low == high or not are_alike:
            return None
        if not all(within[0] <= phase.modulus <= within[1] for phase in phases):
            return None
        loads = self.loads(Cell(matrix, inclusions[0], problem.map, self.outline))
        basis = modulus_basis(
            problem,
            matrix,
            poisson=phases[0].poisson,
            ends=self.modulus_range,
            strains=loads,
            options=self.options,
        )
        return basis if basis.error <= TOLERANCE else None


def require_prisms(mesh_size: float, layers: int) -> None:
    """Refuse a mesh size or a number of layers that is not allowed."""
    require_mesh_size(mesh_size)
    if not (is_number(layers, whole=True) and layers >= 1):
        allowed = "1 or more" if is_number(layers, whole=True) else "a whole number, 1 or more"
        raise RefusedError("the number of layers", repr(layers), allowed)


def solve_sample(
    problem: PrismProblem | SliceProblem,
    stiffness: Sequence[Array],
    strains: Array,
    *,
    options: SolverOptions,
) -> Solved:
    """Solve eq. 7 for the phases' stiffness in Pa, at the map to which the problem was moved.

    The problem holds what comes before: mesh, constraint and form.

    Args:
        problem: Over prisms or over slices.
        stiffness: Of each phase, (3, 3), in Pa.
        strains: Macroscopic strains ε̄, shape (loads, 3).
        options: PETSc's, with the default solver's.

    Raises:
        ConvergenceError: The tolerance of the residual, relative to the load, was not reached.
    """
    matrix = problem.assemble(stiffness)  # K of a(u, v) = ∫ f_Θ C ε(u) : ε(v)
    loads = problem.loads(strains)  # F = −∫ f_Θ C ε̄ : ε(v)
    solver = problem.solver(options, matrix, loads=len(loads))
    solutions = solve(solver, loads)  # K U = F
    means = problem.slice_strains(strains, solutions.vectors)  # of ε̄ + ε(u), over each slice
    return Solved(means, solutions.iterations, solutions.residual)


def prism_result(
    solved: Solved, unknowns: int, phases: Sequence[AnyPhase], loads: Array, options: SolverOptions
) -> HomogenisedStiffness:
    """Stress over θ, energies and checks (Hill–Mandel, symmetry, bounds), as measured.

    `loads` are macroscopic strains, (2 or 3, 3); three give the whole plane stiffness.
    """
    strains = solved.strains
    stiffness = [phase.stiffness for phase in phases]
    stress, energy = strains.stress(stiffness), total_energy(strains.products, stiffness)
    by_theta = stress @ np.linalg.inv(loads).T if len(loads) == 3 else None
    work = loads @ mean(strains.weights, stress)
    energies = energies_by_phase(strains.products, phases, loads)
    return HomogenisedStiffness(
        StressCurve(strains.theta, strains.weights, stress[:, 0, 0], stress[:, 2, 1], by_theta),
        PrismModel.name,
        str(options),
        unknowns,
        solved.iterations,
        energies=PhaseEnergies(energies, np.full(energies.shape, np.nan)),
        checks={
            "hill_mandel": float(abs(work.T - energy).max() / abs(energy).max()),
            **stress_checks(stress, loads, strains.fractions, strains.weights, phases),
            "residual": solved.residual,
        },
    )


def _reference_result(cell: Cell) -> HomogenisedStiffness:
    """Result of the series, or of slices where it has no formula; more accurate than prisms."""
    matrix, inclusion = cell.matrix, cell.inclusion
    if cell.square and isinstance(matrix, Phase) and isinstance(inclusion, Phase):
        series = SeriesModel(accuracy=SERIES_ACCURACY, energies=True)
        return series.solve(cell.radius_map, matrix, [inclusion])[0]
    slices = SlicesModel(points=SLICES_POINTS, outline=cell.outline)
    return slices.solve(cell.radius_map, matrix, [inclusion])[0]


def with_distance(
    result: HomogenisedStiffness, reference: HomogenisedStiffness, safety: float = 1.0
) -> HomogenisedStiffness:
    """Copy of a result with declared errors: `safety` times its distance from a reference.

    The declared error of the reference, if there is one, is added.
    """
    moduli, reference_moduli = _mean_moduli(result.curve), _mean_moduli(reference.curve)
    if len(moduli) == 1:  # two loads: s11 is along x1
        reference_moduli = reference_moduli[1:2]
    ratios = moduli / reference_moduli
    distance = (np.maximum(ratios, 1 / ratios) - 1).max(axis=0)  # nan where not computed
    reference_errors = reference.modulus_errors if reference.errors else 0.0
    error = np.asarray((1 + safety * distance) * (1 + reference_errors) - 1)
    energies = result.energies
    if energies is not None and reference.energies is not None:
        # what one part gains another loses, so that the distance of one can be small by chance
        distances = abs(energies.values - reference.energies.values).max(axis=(0, 1), keepdims=True)
        energy_errors = safety * np.broadcast_to(distances, energies.values.shape)
        if reference.errors:
            energy_errors = energy_errors + reference.energies.errors
        energies = PhaseEnergies(energies.values, energy_errors)
    return replace(result, errors={"space": error}, energies=energies)


def _mean_moduli(curve: StressCurve) -> Array:
    """Mean C11 + C12, C11 − C12 and C33 over θ by `axial_moduli`; of two loads with C11 alone."""
    s11, s12 = curve.mean
    if curve.stiffness is None:
        return np.array([[s11 / STRAIN, np.nan, s12 / (2 * STRAIN)]])
    return axial_moduli(mean(curve.weights, curve.stiffness), square=False)


@lru_cache(maxsize=2)
def cached_problem(grid: PrismGrid, *, parallel: bool) -> PrismProblem:
    """Mesh, form and numbering on a grid of `cached_grid`."""
    return PrismProblem(grid, MPI.COMM_WORLD if parallel else MPI.COMM_SELF)


cached_slices = lru_cache(maxsize=2)(SliceProblem)
