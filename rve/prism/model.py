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
from alphacut.rve.cell.lattice import Arrangement, lattice_of
from alphacut.rve.cell.outline import Outline, circle, is_round, require_outline
from alphacut.rve.fenicsx import MPI
from alphacut.rve.mesh.columns import extrude
from alphacut.rve.mesh.prism_grid import PrismGrid, reference_radius
from alphacut.rve.mesh.square import REFINEMENTS
from alphacut.rve.prism.cell_fields import CellFields
from alphacut.rve.prism.fields import solved_fields
from alphacut.rve.prism.modulus_basis import ModulusBasis, modulus_basis
from alphacut.rve.prism.problem import FoldedMeshError, PrismProblem, Solved, solve_over_prisms
from alphacut.rve.prism.slices import solve_sample
from alphacut.rve.result.cell_model import CellModel, Resolution
from alphacut.rve.result.checks import (
    ROUND_OFF,
    checks_within_limits,
    isotropy_check,
    mean,
    stress_checks,
)
from alphacut.rve.result.moduli import AVERAGES, AXES, axial_moduli
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies, StressCurve
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.slices.model import SlicesModel
from alphacut.rve.solver.form import energies_by_phase, total_energy
from alphacut.rve.solver.krylov import SolverOptions, require_petsc
from alphacut.stochastic import RadiusMap

T = TypeVar("T")

cached_grid = lru_cache(maxsize=2)(extrude)
"""Prisms for all maps with one reference radius; those of the last two calls are kept."""


@dataclass(frozen=True)
class PrismModel(CellModel):
    """Product-space finite elements: quadratic serendipity prisms around the cone of a radius map.

    Args:
        mesh_size: Edge length of the triangles, in halves of the cell's side, in (0, 1].
        layers: Layers in θ, at least 1 (paper: 12).
        petsc: PETSc options without their prefix `rve_`; they override the default solver's.
        parallel: Whether all MPI ranks work on one cell together; if not each works on its own.
        stiffness: Whether to solve a third load, for the whole planar stiffness.
        estimate: Whether to declare the errors.
        modulus_range: Smallest and largest Young's modulus of the particle, in Pa, between which
            samples of a map are projected on two solutions; None: each is solved.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
        lattice: "square", "hexagonal", or the sides [a, b] of a rectangle; see `lattice_of`.

    Example:
        >>> from alphacut.stochastic import HermiteMap
        >>> model = PrismModel(mesh_size=0.5, layers=4, estimate=False)
        >>> [result] = model.solve(HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), [Phase(80e9)])
        >>> f"{result.modulus / 1e9:.1f} GPa"
        '22.8 GPa'
    """

    mesh_size: float = 0.15
    layers: int = 12
    petsc: Mapping[str, str] = field(default_factory=dict)
    parallel: bool = False
    stiffness: bool = False
    estimate: bool = True
    modulus_range: tuple[float, float] | None = None
    outline: Outline = circle
    lattice: Arrangement = "square"
    name: ClassVar[str] = "prism"
    convention: ClassVar[str] = AVERAGES[AXES]

    def __post_init__(self) -> None:
        """Check the arguments.

        Raises:
            RefusedError: `mesh_size` is outside (0, 1], `layers` is no whole number of 1 or more,
                `petsc` is no table of options, `outline` is no function of an array of angles, or
                `modulus_range` is not a pair of finite numbers, or there is no such lattice. The
                order of the pair is not checked.
        """
        require_prisms(self.mesh_size, self.layers)
        require_petsc(self.petsc)
        require_outline(self.outline)
        lattice_of(self.lattice)
        if self.modulus_range is not None:
            require_numbers("modulus_range", self.modulus_range)
            is_range = len(self.modulus_range) == 2
            require(is_range, "modulus_range", self.modulus_range, "least and greatest, in Pa")

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """Return prisms with the mesh size, layers and solver that a resolution asks for.

        Args:
            resolution: How finely to solve. A third load is solved if it asks for the whole
                stiffness. Its `tolerance` and `energies` are not used: prisms have no error that is
                known before, and always give energies.

        Returns:
            A model without a `modulus_range`, which shares no solutions among samples.

        Raises:
            RefusedError: A value of the resolution is not allowed.
        """
        return cls(
            resolution.mesh_size,
            resolution.layers,
            petsc=resolution.petsc,
            parallel=resolution.parallel,
            stiffness=resolution.whole_stiffness,
            estimate=resolution.estimate,
            outline=resolution.outline,
            lattice=resolution.lattice,
        )

    @property
    def errors_by_reference(self) -> bool:
        """Whether errors are declared; see `AnyModel`."""
        return self.estimate

    def for_samples(self, moduli: tuple[float, float] | None, *, energies: bool) -> Self:
        """Return prisms without declared errors, whose samples share solutions; see `AnyModel`."""
        return replace(self, estimate=False, modulus_range=moduli)

    def coarser(self) -> Self:
        """Return prisms on triangles twice as large."""
        return replace(self, mesh_size=min(2 * self.mesh_size, 1.0))

    def solve(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Return the homogenised stiffness for each of `inclusions`, in their order, on one mesh.

        Args:
            radius_map: Radius r(θ) of the particle, in halves of the cell's side, with the
                distribution of the random number θ.
            matrix: Material outside the particle.
            inclusions: Materials of the particle, at least one.

        Returns:
            One HomogenisedStiffness for each inclusion: `modulus` and `poisson` of its average,
            `stiffness` in Pa, `errors` by name against a more accurate model if `estimate` is set,
            `energies` of the phases, `iterations` and `unknowns`. Properties that every right
            result has (symmetry, bounds of the stiffness) are in `checks`.

        Raises:
            ConvergenceError: The linear solver stopped before its tolerance was reached.
            CertificateError: A property that every right result has is violated.
            FoldedMeshError: The map bends more than the layers can follow, or the particle nearly
                touches the sides of the cell.
            RefusedError: Arguments are no map, phase and list of phases, a Poisson's ratio is above
                0.45, a radius does not fit into the cell, the density of θ is zero at a quadrature
                point, or PETSc does not use an option. With `estimate`, also what the more accurate
                model raises.
        """
        require_solve_arguments(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        lattice = lattice_of(self.lattice)
        cells = [Cell(matrix, one, radius_map, self.outline, lattice) for one in inclusions]
        return self._on_valid_grid(radius_map, lambda grid: self._solve_on(grid, cells))

    def _solve_on(self, grid: PrismGrid, cells: Sequence[Cell]) -> list[HomogenisedStiffness]:
        """Return the checked results of cells that differ in the inclusion alone, on one grid.

        All cells have the radius map, the matrix and the outline of the first one.

        Args:
            grid: Prisms at the reference radius of the map, which are moved to it.
            cells: At least one cell.

        Returns:
            One result for each cell in their order. The time for what they share counts for the
            first.

        Raises:
            FoldedMeshError: An element folds where the grid follows the map.
            ConvergenceError: The linear solver did not reach its tolerance.
            CertificateError: A result violates a bound or symmetry by more than its error allows.
            FailedError: The reference model, used with `estimate`, did not converge.
            RefusedError: The density of θ is zero at a quadrature point, PETSc does not use an
                option, or the reference model, used with `estimate`, refuses the cell.
        """
        started = perf_counter()
        basis = self._basis(grid, cells)
        results = []
        for cell in cells:
            loads = self.loads(cell)
            if basis is not None:
                assert isinstance(cell.inclusion, Phase)
                solved = basis.project(cell.inclusion.modulus)
            elif self.by_slices:
                solved = solve_sample(
                    grid, cell.radius_map, cell.stiffness, loads, options=self.options
                )
            else:
                problem = self._moved_prisms(grid, cell.radius_map)
                solved = solve_over_prisms(problem, cell.stiffness, loads, options=self.options)
            result = prism_result(solved, cell.phases, loads, self.options)
            result = replace(result, cell=cell, seconds=perf_counter() - started)
            if self.estimate:
                result = with_distance(result, _reference_result(cell, self.lattice))

            # Bounds of the stiffness may be violated by the error of the mesh. Where no error is
            # declared, 0.1 h³ stands for it, which is tuned. Energies of quadratic triangles
            # converge with h⁴ where fields are smooth, so in finer meshes 0.1 h³ exceeds the error
            # by more.
            allowed = 2 * result.largest_error if result.errors else 0.1 * self.mesh_size**3
            checks = {**result.checks, **isotropy_check(result)}
            checks = checks_within_limits(checks, discretisation=ROUND_OFF + allowed)
            results.append(replace(result, checks=checks))
            started = perf_counter()
        return results

    def fields(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> CellFields:
        """Solve the cell for one inclusion, and return displacements and stresses at the nodes.

        The macroscopic strains (ε11, ε22, 2 ε12) are (0.01, 0.01, 0) and (0, 0, 0.02), and also
        (0.01, −0.01, 0) if the model solves for the whole stiffness, a phase is anisotropic or the
        particle is no circle.

        Args:
            radius_map: Radius r(θ) of the particle, in halves of the cell's side, with the
                distribution of θ.
            matrix: Material outside the particle.
            inclusions: A list with the material of the particle.

        Returns:
            Total displacements, in halves of the cell's side, and stresses in Pa for each of these
            strains. Nodes of the interface stand twice, once for each phase.

        Raises:
            RefusedError: There is not exactly one inclusion, an argument is of the wrong kind, a
                radius does not fit into the cell, the density of θ is zero at a quadrature point,
                or PETSc does not use an option. Poisson's ratio is not limited here.
            FoldedMeshError: The map bends more than the layers can follow, or the particle nearly
                touches the sides of the cell.
            ConvergenceError: The linear solver did not reach its tolerance.
        """
        require_solve_arguments(radius_map, matrix, inclusions, isotropic=False)
        require(len(inclusions) == 1, "inclusions", len(inclusions), "one, for fields")
        lattice = lattice_of(self.lattice)
        cell = Cell(matrix, inclusions[0], radius_map, self.outline, lattice)
        problem = self.problem(radius_map)
        return solved_fields(problem, cell.stiffness, self.loads(cell), self.options)

    def problem(self, radius_map: RadiusMap) -> PrismProblem:
        """Return DOLFINx's mesh and form over prisms for a radius map.

        The object is cached: a later call with a map of the same reference radius moves the mesh of
        the object that was returned before.

        Args:
            radius_map: Radius r(θ) of the particle, in halves of the cell's side, with the
                distribution of θ.

        Raises:
            FoldedMeshError: The map bends more than the layers can follow, or the particle nearly
                touches the sides of the cell.
            RefusedError: It is no radius map, a radius does not fit into the cell, or the density
                of θ is zero at a quadrature point.
        """
        return self._on_valid_grid(radius_map, lambda grid: self._moved_prisms(grid, radius_map))

    @property
    def by_slices(self) -> bool:
        """Whether the form is assembled over slices, on one rank, and not over prisms.

        Over slices the stiffness is an operator without entries, which the preconditioner along θ
        takes and others of PETSc do not.
        """
        return self.options.by_levels and not self.parallel

    @property
    def solver_text(self) -> str:
        """How the cell is assembled and solved; see `AnyModel`."""
        return self.options.described("slices" if self.by_slices else "prisms")

    def _moved_prisms(self, grid: PrismGrid, radius_map: RadiusMap) -> PrismProblem:
        """Return the cached problem over the prisms of a grid, moved to a map."""
        problem = cached_problem(grid, parallel=self.parallel)
        problem.move(radius_map)
        return problem

    def _on_valid_grid(self, radius_map: RadiusMap, function: Callable[[PrismGrid], T]) -> T:
        """Return what a function of the grid returns, on a grid whose elements do not fold.

        The grid is meshed at the reference radius of a map (about the midpoint of its radii).
        Elements at the bends of an outline may fold where it is moved to the map, for which the
        function is to raise FoldedMeshError: it is then called again with a grid of shorter edges
        there, six times in all at most. For a circle it is called once.

        Args:
            radius_map: Radius r(θ) of the particle, with the distribution of θ.
            function: Takes a grid, which it must move to the map.

        Raises:
            FoldedMeshError: The function raised it on the last grid.
            RefusedError: It is no radius map, or a radius does not fit into the cell.
            Exception: Whatever else the function raises, at once.
        """
        lattice = lattice_of(self.lattice)
        radius = reference_radius(radius_map, self.outline, lattice)

        grid = partial(
            cached_grid,
            size=self.mesh_size,
            radius=radius,
            layers=self.layers,
            outline=self.outline,
            parallel=self.parallel,
            lattice=lattice,
        )
        if is_round(self.outline):
            return function(grid(refinement=REFINEMENTS[0]))
        for refinement in REFINEMENTS[:-1]:
            with suppress(FoldedMeshError):
                return function(grid(refinement=refinement))
        return function(grid(refinement=REFINEMENTS[-1]))

    @property
    def options(self) -> SolverOptions:
        """The linear solver with what overrides it."""
        return SolverOptions(self.petsc)

    def loads(self, cell: Cell) -> Array:
        """Return the macroscopic strains (ε11, ε22, 2 ε12), shape (loads, 3) (eq. 15): 2 or 3.

        Two give E and ν of a cell with the symmetry of the square; others need three.
        """
        return LOADS if cell.square and not self.stiffness else THREE_LOADS

    def _basis(self, grid: PrismGrid, cells: Sequence[Cell]) -> ModulusBasis | None:
        """Return a reduced basis for cells that differ in the inclusion's modulus alone.

        It holds the solutions at two moduli, from which the solutions at all moduli of
        `modulus_range` are projected.

        Args:
            grid: Prisms at the reference radius of the cells' common map.
            cells: Cells with the same map and matrix.

        Returns:
            The basis; None where `modulus_range` is not set or is a single value, the form is
            assembled over prisms and not over slices, an inclusion is not isotropic, Poisson's
            ratios differ, a modulus lies outside the range, or the energy that projection leaves
            out is too large.

        Raises:
            FoldedMeshError: An element folds where the grid follows the map.
            ConvergenceError: The linear solver did not reach its tolerance.
            RefusedError: The density of θ is zero at a quadrature point, or PETSc does not use an
                option.
        """
        if self.modulus_range is None or not self.by_slices:
            return None
        low, high = self.modulus_range
        inclusions = [x.inclusion for x in cells if isinstance(x.inclusion, Phase)]
        are_alike = len(inclusions) == len(cells) and len({x.poisson for x in inclusions}) == 1
        if low == high or not are_alike:
            return None
        moduli = [x.modulus for x in inclusions]
        if min(moduli) < low * (1 - ROUND_OFF) or max(moduli) > high * (1 + ROUND_OFF):
            return None
        basis = modulus_basis(
            grid,
            cells[0].radius_map,
            cells[0].matrix,
            poisson=inclusions[0].poisson,
            ends=self.modulus_range,
            strains=self.loads(cells[0]),
            options=self.options,
        )
        # Relative error of the energy. The error of E is at most half of it.
        tolerance = 2e-10
        return basis if basis.error <= tolerance else None


def require_prisms(mesh_size: float, layers: int) -> None:
    """Refuse a mesh size or a number of layers that is not allowed."""
    require_mesh_size(mesh_size)
    if not (is_number(layers, whole=True) and layers >= 1):
        allowed = "1 or more" if is_number(layers, whole=True) else "a whole number, 1 or more"
        raise RefusedError("the number of layers", repr(layers), allowed)


def prism_result(
    solved: Solved, phases: Sequence[AnyPhase], loads: Array, options: SolverOptions
) -> HomogenisedStiffness:
    """Return the homogenised stiffness of a solved cell, with its energies and checks.

    Args:
        solved: Mean strains of the phases on each slice of θ under each load, and what the solver
            did.
        phases: Materials, in the order of those of `solved`.
        loads: Macroscopic strains (ε11, ε22, 2 ε12), a row each, in this order: (s, s, 0), (0, 0, 2
            s) and, for the whole plane stiffness, (s, −s, 0). Shape (2, 3) or (3, 3).
        options: Options of the linear solver, for its name.

    Returns:
        Stress over θ: σ11 under the first load, σ12 under the second, and for three loads the
        stiffness (3, 3) at each θ. Strain energies by phase, whose errors are NaN. And `checks`:
        relative violations of the Hill-Mandel condition, of symmetry and of the bounds of Reuss,
        Voigt and Hashin-Shtrikman, and the residual of the solver. No limit is applied here.

    Raises:
        numpy.linalg.LinAlgError: Three loads are linearly dependent.
    """
    strains = solved.strains
    stiffness = [phase.stiffness for phase in phases]
    stress = strains.stress(stiffness)
    # `stress` has the shape (θ, component, load). With Σ its matrix at a θ and L = `loads`, Σ = C
    # Lᵀ, so C = Σ L⁻ᵀ.
    stiffness_by_theta = stress @ np.linalg.inv(loads).T if len(loads) == 3 else None
    curve = StressCurve(
        strains.theta,
        strains.weights,
        s11=stress[:, 0, 0],
        s12=stress[:, 2, 1],
        stiffness=stiffness_by_theta,
        error=solved.curve_error,
    )

    # By Hill and Mandel's lemma the work of mean stress in mean strain is the mean energy, for each
    # pair of loads; both have the shape (loads, loads). They come from different sums, so that a
    # wrong constraint or weight shows.
    work = loads @ mean(strains.weights, stress)
    energy = total_energy(strains.products, stiffness)
    checks = {"hill_mandel": float(abs(work.T - energy).max() / abs(energy).max())}
    checks |= stress_checks(stress, loads, strains.fractions, strains.weights, phases)
    checks["residual"] = solved.residual

    energies = energies_by_phase(strains.products, phases, loads)
    return HomogenisedStiffness(
        curve=curve,
        method=PrismModel.name,
        solver=str(options),
        unknowns=solved.unknowns,
        iterations=solved.iterations,
        energies=PhaseEnergies(energies, np.full(energies.shape, np.nan)),
        checks=checks,
    )


def _reference_result(cell: Cell, lattice: Arrangement) -> HomogenisedStiffness:
    """Return the result of a model that is more accurate than prisms, for the same cell.

    It is the multipole series for a circle of isotropic phases, and triangles of order 4 at single
    θ ("slices") for all others. The accuracy of the series (1e-9) and the number of nodes in θ of
    the slices (14) are chosen so that the reference's own error hardly counts.

    Args:
        cell: Two phases, the radius map and the outline of the particle.
        lattice: Arrangement of the particles.

    Raises:
        RefusedError: The slices cannot mesh the cell (particles that nearly touch), or the map has
            a jump.
        FailedError: The series, its rule in θ, or a linear system of the slices did not converge.
    """
    matrix = cell.matrix
    inclusion = cell.inclusion
    if isinstance(matrix, Phase) and isinstance(inclusion, Phase) and is_round(cell.outline):
        series = SeriesModel(accuracy=1e-9, energies=True, lattice=lattice)
        return series.solve(cell.radius_map, matrix, [inclusion])[0]
    slices = SlicesModel(points=14, outline=cell.outline, lattice=lattice)
    return slices.solve(cell.radius_map, matrix, [inclusion])[0]


def with_distance(
    result: HomogenisedStiffness, reference: HomogenisedStiffness, *, safety: float = 1.0
) -> HomogenisedStiffness:
    """Return a copy of a result with declared errors: its distance from a more accurate one.

    The moduli are C11 + C12, C11 − C12 and C33. With q a modulus over the same one of the
    reference, its distance is d = max(q, 1/q) − 1. Its declared relative error is (1 + safety · d)
    (1 + e) − 1, where e is the error that the reference declares, or 0 if it declares none. Where
    C11 and C22 differ, the larger distance of both axes counts. A modulus that was not computed has
    the error NaN.

    Args:
        result: Result with two or three loads.
        reference: More accurate result with three loads.
        safety: Factor of the distance, 1 or more where the reference has an error of similar size.

    Returns:
        The result with `errors` = {"space": array of shape (3,)}. If both results have energies, it
        also has their absolute errors: for each modulus `safety` times the largest distance of any
        energy in it, plus the reference's error if it declares one.
    """
    moduli = _mean_moduli(result.curve)
    reference_moduli = _mean_moduli(reference.curve)
    if len(moduli) == 1:
        # Two loads give C11 and no C22. The reference's three rows of moduli have the mean of C11
        # and C22, C11, and C22 in this order, so the second one is compared.
        reference_moduli = reference_moduli[1:2]
    ratios = moduli / reference_moduli
    distance = (np.maximum(ratios, 1 / ratios) - 1).max(axis=0)  # nan where not computed
    reference_errors = reference.modulus_errors if reference.errors else 0.0
    error = np.asarray((1 + safety * distance) * (1 + reference_errors) - 1)
    energies = result.energies
    if energies is not None and reference.energies is not None:
        # An energy of one phase can be near the reference by chance, though others are not: the
        # largest distance over the phases and over K and G counts for all.
        distances = abs(energies.values - reference.energies.values)
        largest = distances.max(axis=(0, 1), keepdims=True)
        energy_errors = safety * np.broadcast_to(largest, energies.values.shape)
        if reference.errors:
            energy_errors = energy_errors + reference.energies.errors
        energies = PhaseEnergies(energies.values, energy_errors)
    return replace(result, errors={"space": error}, energies=energies)


def _mean_moduli(curve: StressCurve) -> Array:
    """Return the mean C11 + C12, C11 − C12 and C33 over θ, in Pa, along the last axis.

    Args:
        curve: Stress over θ under two loads, or the whole stiffness over θ from three loads.

    Returns:
        For three loads shape (3, 3): the first row takes the mean of C11 and C22, the second C11,
        and the third C22 in the place of C11 (by `axial_moduli`). For two loads shape (1, 3) with
        C11. C11 − C12 is then NaN, since a stretch of both axes and a shear do not give it.
    """
    if curve.stiffness is None:
        s11, s12 = curve.mean
        return np.array([[s11 / STRAIN, np.nan, s12 / (2 * STRAIN)]])
    return axial_moduli(mean(curve.weights, curve.stiffness), square=False)


@lru_cache(maxsize=2)
def cached_problem(grid: PrismGrid, *, parallel: bool) -> PrismProblem:
    """Return mesh, form and numbering over the prisms of a grid of `cached_grid`."""
    return PrismProblem(grid, MPI.COMM_WORLD if parallel else MPI.COMM_SELF)
