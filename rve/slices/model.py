"""Slices: two-dimensional cell problems at the nodes of a rule in θ, by curved Lagrange triangles.

The product-space form has no θ-derivative, so its exact solution at each θ is the plane problem
with radius r(θ). The error of a slice is estimated from elements of the next order and from a
second mesh.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.cell import (
    STRAIN,
    THREE_LOADS,
    AnyPhase,
    Cell,
    Phase,
    continuous_radii,
    require_compressible,
    require_mesh_size,
    require_points,
    require_solve_arguments,
)
from alphacut.rve.cell.lattice import SQUARE, Arrangement, Lattice, lattice_of
from alphacut.rve.cell.outline import Outline, circle, is_round, require_outline
from alphacut.rve.fenicsx import MPI, basix, cholesky, fem, mesh_of, ufl
from alphacut.rve.mesh.curved import PlaneMesh, curved_nodes, plane_mesh, quadrature_degree
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.result.cell_model import CellModel, Resolution
from alphacut.rve.result.checks import with_checks
from alphacut.rve.result.moduli import AVERAGES, AXES, axial_moduli, mori_tanaka, square_moduli
from alphacut.rve.result.result import HomogenisedStiffness, PhaseEnergies, StressCurve
from alphacut.rve.solver.form import (
    CellForm,
    PointStrains,
    energies_by_phase,
    strain_products,
    total_energy,
)
from alphacut.rve.solver.krylov import ConvergenceError, solve
from alphacut.rve.solver.numbering import Elimination
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

MAX_SECOND_SIZE = 0.7
"""Largest size of the second mesh, in halves of the cell's side. On coarser meshes small particles
fix the size of all elements, so that two sizes give one mesh. Tuned."""


class PlaneCell:
    """Periodic cell in plane strain of isoparametric triangles; sides are paired by elimination.

    Args:
        mesh: Straight-sided triangles.
        order: Polynomial degree of displacements and geometry.

    Attributes:
        unknowns: Number of unknowns of the linear system.
        weights: Weights of the quadrature points in each phase, over the area of the cell, shape
            (phases, points).
    """

    def __init__(self, mesh: PlaneMesh, order: int) -> None:
        nodes, cells = curved_nodes(mesh, order)
        variant = basix.LagrangeVariant.gll_warped
        element = basix.ufl.element("P", "triangle", order, variant, shape=(2,))
        plane = mesh_of(MPI.COMM_SELF, cells, len(nodes), element)
        plane.geometry.x[:, :2] = nodes[plane.geometry.input_global_indices]
        space = fem.functionspace(plane, element)
        self._phase = mesh.phase[plane.topology.original_cell_index]

        degree = quadrature_degree(order)
        dx = ufl.Measure("dx", plane, metadata={"quadrature_degree": degree})
        self._form = CellForm(space, fem.functionspace(plane, ("DG", 0, (3, 3))), dx)
        points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
        self._point_strains = PointStrains(space, points)
        areas = abs(self._point_strains.determinants()) * weights / mesh.lattice.area
        is_phase = np.equal.outer(np.arange(int(mesh.phase.max()) + 1), self._phase)
        self.weights: Array = (is_phase[:, :, np.newaxis] * areas).reshape(len(is_phase), -1)

        # Nodes on opposite sides have one pair of unknowns.
        positions: Array = np.empty((len(nodes), 2))
        positions[space.dofmap.list] = plane.geometry.x[plane.geometry.dofmap, :2]
        pairs = unknowns(positions, mesh.lattice)
        self.unknowns = 2 * (int(pairs.max()) + 1)
        self._elimination = Elimination(
            pairs,
            cells=pairs[space.dofmap.list],
            rows=range(self.unknowns),
            size=self.unknowns,
            comm=MPI.COMM_SELF,
        )

    def strains(self, phases: Sequence[Array]) -> Array:
        """Return the strains at the quadrature points under three unit strains.

        The linear system is factorised and solved; the matrix of this object is overwritten.

        Args:
            phases: Stiffness of each phase (matrix 0, particle 1) in Voigt order, (3, 3) each, in
                Pa.

        Returns:
            (ε11, ε22, 2 ε12), the second axis, under each unit strain of these components, the last
            axis; shape (points of all triangles, 3, 3).

        Raises:
            ConvergenceError: The system was not solved: a relative residual exceeds 1e-8 or is not
                finite.
        """
        matrix = self._elimination.matrix
        unit_strains = np.eye(3)
        self._form.stiffness.x.array[:] = np.array(phases)[self._phase].ravel()
        self._form.assemble(matrix)
        loads = [self._elimination.forces(self._form.load(strain)) for strain in unit_strains]
        solved = solve(cholesky(matrix, "rve_slice_"), loads)
        allowed = 1e-8  # far above the round-off of a factorisation, far below declared errors
        if not solved.residual <= allowed:
            raise ConvergenceError(
                f"the factorisation of a plane cell leaves a relative residual of"
                f" {solved.residual:.1e}; {allowed:g} is allowed",
                "check the moduli, or take the series",
            )
        displacements = [self._elimination.displacements(vector) for vector in solved.vectors]
        fluctuations = np.stack([self._point_strains(u) for u in displacements], axis=-1)
        return np.asarray((fluctuations + unit_strains).reshape(-1, 3, 3))

    def solve(self, phases: Sequence[AnyPhase]) -> tuple[Array, Array]:
        """Return the homogenised stiffness and the energies of the phases, both in Pa.

        Args:
            phases: Materials: matrix, particle.

        Returns:
            Stiffness in Voigt order (11, 22, 12 with 2 ε12), shape (3, 3). And the energies X
            ∂c/∂X, shape (phases, 2, 3): for X the bulk modulus K and the shear modulus G of each
            phase, and for c the moduli C11 + C12, C11 − C12 and C33 of the cell.

        Raises:
            ConvergenceError: The linear system was not solved.
        """
        stiffness = [phase.stiffness for phase in phases]
        products = strain_products(self.strains(stiffness), self.weights)
        # Each of `THREE_LOADS` is a sum of the unit strains.
        load_products = np.einsum("piajb,ka,lb->pikjl", products, THREE_LOADS, THREE_LOADS)
        energies = energies_by_phase(load_products, phases, THREE_LOADS)
        return total_energy(products, stiffness), energies


class Slice(NamedTuple):
    """A plane cell solved by elements of order 4.

    Args:
        stiffness: In Pa, Voigt order, shape (3, 3).
        errors: Declared relative errors of C11 + C12, C11 − C12 and C33, shape (3,).
        energies: Parts of the phases in these three moduli, and their declared errors, shape
            (2, phases, 2, 3), in Pa.
        unknowns: Number of unknowns of the linear system.
    """

    stiffness: Array
    errors: Array
    energies: Array
    unknowns: int


def solve_slice(
    radius: float,
    matrix: AnyPhase,
    inclusions: Sequence[AnyPhase],
    *,
    mesh_size: float,
    outline: Outline = circle,
    lattice: Lattice = SQUARE,
) -> list[Slice]:
    """Solve the plane cell with each of `inclusions` by elements of order 4, and declare its error.

    The error is the larger of two distances of order 4 from order 5, on the same mesh and on a
    second one of twice the edge length (or half of it, if twice would be above 0.7), each with a
    safety factor. Without the symmetry of the square, the larger of the errors with C11 and with
    C22 counts.

    Args:
        radius: Radius of the particle, in halves of the cell's side.
        matrix: Material outside the particle.
        inclusions: Materials of the particle.
        mesh_size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        outline: Distance of the particle's edge from its centre over `radius`, as a function of the
            polar angle in radians.
        lattice: The cell.

    Returns:
        For each inclusion the stiffness, the declared relative errors of C11 + C12, C11 − C12 and
        C33, the energies of the phases with their absolute errors, and the number of unknowns.

    Raises:
        RefusedError: The mesh size is not allowed, or the particle does not fit or has too sharp an
            outline to be meshed.
        ConvergenceError: A linear system was not solved.
    """
    is_coarser = 2 * mesh_size <= MAX_SECOND_SIZE
    second_size = 2 * mesh_size if is_coarser else mesh_size / 2
    first_mesh = plane_mesh(radius, size=mesh_size, outline=outline, lattice=lattice)
    second_mesh = plane_mesh(radius, size=second_size, outline=outline, lattice=lattice)
    cell = PlaneCell(first_mesh, order=4)
    higher_order_cell = PlaneCell(first_mesh, order=5)
    second_cell = PlaneCell(second_mesh, order=5)
    slices = []
    for inclusion in inclusions:
        phases = matrix, inclusion
        stiffness, energies = cell.solve(phases)
        higher_stiffness, higher_energies = higher_order_cell.solve(phases)
        second_stiffness, _ = second_cell.solve(phases)

        # The safety factors are tuned on 216 moduli (ellipses and stars, contrasts 1e-3 … 1e3, mesh
        # sizes .15, .3, .6): the true error of order 4 was 1.02 … 1.59 times its distance from
        # order 5, and 1.00 … 1.07 times that from order 5 on the finer mesh.
        are_isotropic = all(isinstance(phase, Phase) for phase in phases)
        square = is_round(outline) and are_isotropic and lattice.is_square
        by_order = 1.6 * _distance(stiffness, higher_stiffness, square=square)
        by_mesh = 1.1 * _distance(stiffness, second_stiffness, square=square)
        # Round-off grows with the contrast, since displacements of the particle cancel. Below it
        # two orders may agree by chance. The factors are tuned.
        contrast = inclusion.stiffness[2, 2] / matrix.stiffness[2, 2]
        round_off = 1e-13 + 2e-14 * radius * contrast
        energy_round_off = 1e-12 * energies.sum(axis=(0, 1))
        energy_errors = 1.6 * abs(energies - higher_energies) + energy_round_off
        slices.append(
            Slice(
                stiffness,
                errors=np.maximum(by_order, by_mesh) + round_off,
                energies=np.array([energies, energy_errors]),
                unknowns=cell.unknowns,
            )
        )
    return slices


def _distance(first: Array, second: Array, *, square: bool) -> Array:
    """Return the largest relative distance of each modulus along either axis, shape (3,)."""
    ratio = axial_moduli(first, square=square) / axial_moduli(second, square=square)
    return np.asarray((np.maximum(ratio, 1 / ratio) - 1).max(axis=0))


def _rounded(radii: Array) -> Array:
    """Return radii to twelve decimals: those that agree in them are solved as one slice."""
    return np.round(radii, 12)


@dataclass(frozen=True)
class SlicesModel(CellModel):
    """Plane finite elements of order 4 with curved sides at the nodes of a Gauss rule in θ.

    Args:
        mesh_size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        points: Nodes in θ, at least 2.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
        lattice: "square", "hexagonal", or the sides [a, b] of a rectangle; see `lattice_of`.
    """

    mesh_size: float = 0.2
    points: int = 10
    outline: Outline = circle
    lattice: Arrangement = "square"
    name: ClassVar[str] = "slices"
    convention: ClassVar[str] = AVERAGES[AXES]

    def __post_init__(self) -> None:
        """RefusedError for a mesh size, points, an outline or a lattice that is not allowed."""
        require_mesh_size(self.mesh_size)
        require_points(self.points)
        lattice_of(self.lattice)
        require_outline(self.outline)

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """Return the slices of a mesh size, an outline and a lattice; see `CellModel`."""
        return cls(
            mesh_size=resolution.mesh_size,
            outline=resolution.outline,
            lattice=resolution.lattice,
        )

    @property
    def is_exact(self) -> bool:
        """Whether the particle is round, of which mechanics proves signs; see `AnyModel`."""
        return is_round(self.outline)

    @property
    def solver_text(self) -> str:
        """How the cell is assembled and solved; see `AnyModel`."""
        return "one UFL form over curved triangles by DOLFINx, solved by PETSc's cholesky"

    def coarser(self) -> Self:
        """Return slices on elements twice as large."""
        return replace(self, mesh_size=min(2 * self.mesh_size, MAX_SECOND_SIZE))

    def solve(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Return the homogenised stiffness for each of `inclusions`, in their order.

        The plane cell is solved at each node of a Gauss rule in θ, and at the smallest and the
        largest radius of the map for the error in θ.

        Args:
            radius_map: Radius r(θ) of the particle, in halves of the cell's side, with the
                distribution of the random number θ.
            matrix: Material outside the particle.
            inclusions: Materials of the particle, at least one.

        Returns:
            A HomogenisedStiffness for each inclusion, with `modulus` and `poisson` of its average,
            `stiffness` in Pa, declared `errors`, `energies` of the phases, and violations of bounds
            as `checks`. `seconds` of each is the time for all of them together.

        Raises:
            ConvergenceError: A linear system was not solved.
            CertificateError: A result violates symmetry or a bound by more than its errors.
            RefusedError: Arguments are no map, phase and list of phases, a Poisson's ratio is above
                0.45, the map has a jump, a radius does not fit or the outline is too sharp to be
                meshed.
        """
        require_solve_arguments(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        fine_radii = continuous_radii(radius_map)
        lattice = lattice_of(self.lattice)
        start = perf_counter()
        rule = gauss_rule(radius_map.distribution, points=self.points)
        # The smallest and the largest radius are solved too, for the error in θ.
        extremes = [fine_radii.min(), fine_radii.max()]
        # Maps that are constant or not monotone have the same radius at several nodes.
        radii = np.unique(_rounded(np.concatenate([radius_map(rule.nodes), extremes])))
        solve_at = partial(
            solve_slice, mesh_size=self.mesh_size, outline=self.outline, lattice=lattice
        )
        by_radius = [solve_at(radius, matrix, inclusions) for radius in radii]
        seconds = perf_counter() - start
        results = []
        for number, inclusion in enumerate(inclusions):
            cell = Cell(matrix, inclusion, radius_map, self.outline, lattice)
            slices = [of_inclusions[number] for of_inclusions in by_radius]
            result = _mean_of_slices(cell, rule, radii=radii, slices=slices)
            results.append(with_checks(replace(result, seconds=seconds)))
        return results


def _mean_of_slices(
    cell: Cell, rule: ThetaRule, *, radii: Array, slices: Sequence[Slice]
) -> HomogenisedStiffness:
    """Return the mean over θ of a cell with its declared errors.

    Args:
        cell: Phases, radius map and outline.
        rule: Nodes and weights in θ.
        radii: Radii of the slices, rising and rounded to twelve decimals, shape (n,); among them
            those of the nodes and the two extreme ones.
        slices: Slice of each radius: stiffness, errors, energies and number of unknowns.

    Returns:
        Result with the stiffness at the nodes, energies, and errors "space" (of the meshes) and
        "theta" (of the rule) of C11 + C12, C11 − C12 and C33.
    """
    nodes = _radius_of_nodes(cell, rule, radii)
    stiffness = np.array([one.stiffness for one in slices])
    curve = StressCurve.from_stiffness(rule, stiffness[nodes])
    moduli = square_moduli(stiffness)
    mean = rule.mean(moduli[nodes])
    absolute_errors = moduli * np.array([one.errors for one in slices])
    # The error of a mean is at most the mean of the absolute errors: the weights are positive.
    space_errors = rule.mean(absolute_errors[nodes]) / mean
    if cell.square:
        # In a cell with the symmetry of a square C11 and C22 differ only by the error of the mesh.
        # The curve's s11 comes from C11 and the moduli from the mean of both, so their relative
        # distance is added.
        space_errors[0] += abs(STRAIN * mean[0] / curve.mean[0] - 1)
    # Where C11 and C22 differ, the larger error with either counts.
    ways = np.moveaxis(axial_moduli(stiffness, square=cell.square), 1, 0)
    by_way = [theta_error(cell, rule, radii=radii, moduli=way) for way in ways]
    theta_errors = np.max(by_way, axis=0)
    energies = np.array([one.energies for one in slices])
    return HomogenisedStiffness(
        curve=curve,
        method=SlicesModel.name,
        solver="cholesky",
        unknowns=max(one.unknowns for one in slices),
        errors={"space": space_errors, "theta": theta_errors},
        cell=cell,
        energies=_mean_energies(cell, rule, radii=radii, energies=energies),
    )


def _radius_of_nodes(cell: Cell, rule: ThetaRule, radii: Array) -> Ints:
    """Return the index among rising `radii` of the radius at each node of a rule."""
    return np.searchsorted(radii, _rounded(cell.radius_map(rule.nodes)))


def _mean_energies(cell: Cell, rule: ThetaRule, *, radii: Array, energies: Array) -> PhaseEnergies:
    """Return the mean over θ of the phases' energies X ∂c/∂X, with declared errors.

    Args:
        cell: Phases, radius map and outline.
        rule: Nodes and weights in θ.
        radii: Radii of the slices, rising, shape (n,).
        energies: At the radii, shape (n, 2, phases, 2, 3), in Pa. Axes: radius; the energy and its
            absolute error; phase; bulk or shear modulus; C11 + C12, C11 − C12, C33.

    Returns:
        Energies and absolute errors, shape (phases, 2, 3) each, in Pa.
    """
    nodes = _radius_of_nodes(cell, rule, radii)

    def absolute_theta_error(moduli: Array) -> Array:
        """Return the error in Pa of the means, shape (3,), of moduli at the radii, shape (n, 3)."""
        relative_errors = theta_error(cell, rule, radii=radii, moduli=moduli)
        return relative_errors * rule.mean(moduli[nodes])

    values = energies[:, 0]
    errors = energies[:, 1]
    # `theta_error` needs positive moduli, but an energy X ∂c/∂X may change sign. The sum c + X
    # ∂c/∂X is to first order the modulus with a stiffer phase, so it is positive. The energy is
    # this sum less c, so its error is at most the sum of their errors.
    moduli = values.sum(axis=(1, 2))
    theta_errors = np.empty(values.shape[1:])
    for part in np.ndindex(theta_errors.shape[:2]):
        theta_errors[part] = absolute_theta_error(moduli + values[:, part[0], part[1]])
    theta_errors += absolute_theta_error(moduli)
    return PhaseEnergies(rule.mean(values[nodes]), rule.mean(errors[nodes]) + theta_errors)


def theta_error(cell: Cell, rule: ThetaRule, *, radii: Array, moduli: Array) -> Array:
    """Return the declared relative errors of the mean of three moduli by a rule in θ, shape (3,).

    It is an estimate. The modulus is divided by the modulus of Mori and Tanaka, and the logarithm
    of this ratio, which is smooth in √(1 − r²), is fitted by polynomials of several degrees. Each
    fit gives the modulus at 128 nodes in θ, and so a mean. The error is the largest relative
    distance of these means from the mean by `rule`, times a tuned safety factor.

    Args:
        cell: Phases and radius map.
        rule: Nodes and weights in θ of the mean that is judged.
        radii: Radii of the slices, rising, inside (0, 1), shape (m,): the radii at the nodes, and
            the smallest and the largest radius of the map.
        moduli: C11 + C12, C11 − C12 and C33 at `radii`, or others that behave like them, positive,
            shape (m, 3).
    """
    # A radius weighs as much as its nodes. The extreme radii, which are at no node, get a small
    # weight, so that fits stay near them.
    nodes = _radius_of_nodes(cell, rule, radii)
    weights = np.maximum(np.bincount(nodes, rule.weights, minlength=radii.size), 1e-6)
    root = np.sqrt(weights)[:, np.newaxis]
    fine = gauss_rule(cell.radius_map.distribution, points=128)  # whose error is below round-off
    fine_radii = cell.radius_map(fine.nodes)

    def mori_tanaka_moduli(r: Array) -> Array:
        """Return C11 + C12, C11 − C12 and C33 of a circle at radii, along a new last axis."""
        bulk, shear = mori_tanaka(np.pi / cell.lattice.area * r**2, [cell.matrix, cell.inclusion])
        return np.stack([2 * bulk, 2 * shear, shear], axis=-1)

    scale = mori_tanaka_moduli(fine_radii)
    logarithm = np.log(moduli / mori_tanaka_moduli(radii))
    # Fits are clipped at one range beyond the values: farther out a polynomial only oscillates.
    span = np.ptp(logarithm, axis=0)
    lowest = logarithm.min(axis=0) - span
    highest = logarithm.max(axis=0) + span
    x = np.sqrt(1 - radii**2)
    fine_x = np.sqrt(1 - fine_radii**2)
    midpoint = (x.min() + x.max()) / 2
    half_width = max(np.ptp(x), 1e-12) / 2  # not 0 where all radii are equal
    mean = rule.weights @ moduli[nodes]

    # The degrees go from three below the interpolating polynomial, whose degree is one less than
    # the number of radii, up to it; but the first is at most 9 and the last at most 14, both tuned.
    first_degree = min(max(0, radii.size - 4), 9)
    stop_degree = min(radii.size, 15)
    distances = []
    for degree in range(first_degree, stop_degree):
        basis = chebvander((x - midpoint) / half_width, degree)
        coefficients = np.linalg.lstsq(basis * root, logarithm * root, rcond=1e-14)[0]
        fit = chebvander((fine_x - midpoint) / half_width, degree) @ coefficients
        fine_moduli = scale * np.exp(np.clip(fit, lowest, highest))
        distances.append(fine.weights @ fine_moduli / mean - 1)
    # The safety factor is tuned; round-off leaves 1e-13.
    return np.asarray(1.6 * np.abs(distances).max(axis=0) + 1e-13)
