"""Slices: two-dimensional cell problems at the nodes of a rule in θ, by curved Lagrange triangles.

The product-space form has no θ-derivative, so its exact solution at each θ is the plane problem
with radius r(θ). The error of a slice is told by orders and meshes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import ClassVar, NamedTuple, Self

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.cell import (
    AREA,
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

PREFIX = "rve_slice_"
RESIDUAL = 1e-8  # relative, of a factorisation
ORDER, REFERENCE_ORDER = 4, 5
"""Polynomial degree of the elements, and the next, which estimates their error."""
LIMIT = 0.7
"""Mesh size up to which the second mesh is twice as coarse, in halves of the cell's side: there
size ends to matter. Where it would lie above, the second mesh is twice as fine."""
ORDER_SAFETY = 1.6
"""True error of order 4 over its distance from order 5: 1.02 … 1.59 of 216 moduli (ellipses and
stars, contrasts 1e-3 … 1e3, mesh sizes 0.15, 0.3, 0.6)."""
MESH_SAFETY = 1.1
"""The same over the distance from order 5 on the finer mesh: 1.00 … 1.07."""
NOISE = 1e-12  # of an energy, over the modulus
ROUND_OFF = 1e-13
CANCELLATION = 2e-14  # relative round-off for each unit of radius and contrast


class PlaneCell:
    """Periodic cell in plane strain of isoparametric triangles; sides are paired by elimination.

    `order` is the polynomial degree of field and geometry, `unknowns` their number, `weights` those
    of the quadrature points in each phase over the area, shape (phases, points).
    """

    def __init__(self, mesh: PlaneMesh, order: int) -> None:
        nodes, cells = curved_nodes(mesh, order)
        variant = basix.LagrangeVariant.gll_warped
        element = basix.ufl.element("P", "triangle", order, variant, shape=(2,))
        plane = mesh_of(MPI.COMM_SELF, cells, len(nodes), element)
        plane.geometry.x[:, :2] = nodes[plane.geometry.input_global_indices]
        space, degree = fem.functionspace(plane, element), quadrature_degree(order)
        self._phase = mesh.phase[plane.topology.original_cell_index]
        is_phase = np.equal.outer(np.arange(int(mesh.phase.max()) + 1), self._phase)
        dx = ufl.Measure("dx", plane, metadata={"quadrature_degree": degree})
        self._form = CellForm(space, fem.functionspace(plane, ("DG", 0, (3, 3))), dx)
        points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
        self._point_strains = PointStrains(space, points)
        areas = abs(self._point_strains.determinants()) * weights / AREA
        self.weights: Array = (is_phase[:, :, None] * areas).reshape(len(is_phase), -1)
        positions: Array = np.empty((len(nodes), 2))
        positions[space.dofmap.list] = plane.geometry.x[plane.geometry.dofmap, :2]
        pairs = unknowns(positions)
        self.unknowns = 2 * (int(pairs.max()) + 1)
        cells, rows = pairs[space.dofmap.list], range(self.unknowns)
        self._elimination = Elimination(pairs, cells, rows, self.unknowns, MPI.COMM_SELF)

    def strains(self, phases: Sequence[Array]) -> Array:
        """Strains at the quadrature points under unit strains, (points, 3, 3); stiffness in Pa.

        Raises:
            ConvergenceError: The linear system was not solved.
        """
        matrix, unit_strains = self._elimination.matrix, np.eye(3)
        self._form.stiffness.x.array[:] = np.array(phases)[self._phase].ravel()
        self._form.assemble(matrix)
        loads = [self._elimination.forces(self._form.load(strain)) for strain in unit_strains]
        solved = solve(cholesky(matrix, PREFIX), loads)
        if not solved.residual <= RESIDUAL:
            raise ConvergenceError(
                f"the factorisation of a plane cell leaves a relative residual of"
                f" {solved.residual:.1e}; {RESIDUAL:g} is allowed",
                "check the moduli, or take the series",
            )
        displacements = map(self._elimination.displacements, solved.vectors)
        fields = [self._point_strains(u) for u in displacements]
        return np.asarray((np.stack(fields, axis=-1) + unit_strains).reshape(-1, 3, 3))

    def solve(self, phases: Sequence[AnyPhase]) -> tuple[Array, Array]:
        """Homogenised stiffness, (3, 3), and energies of the phases, (phases, 2, 3), in Pa."""
        stiffness = [phase.stiffness for phase in phases]
        # means of ε_a ⊗ ε_b by phase under unit strains, of which `THREE_LOADS` are sums
        products = strain_products(self.strains(stiffness), self.weights)
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
) -> list[Slice]:
    """Solve the plane cell with each of `inclusions`, and declare its error.

    The error is the larger of two distances of order 4 from order 5, on the same mesh and on a
    second one, each with a safety factor. Without the symmetry of the square, the larger of the
    errors with C11 and with C22 counts. `radius` and `mesh_size` are in halves of the cell's side.
    """
    second_size = 2 * mesh_size if 2 * mesh_size <= LIMIT else mesh_size / 2
    first, second = (
        plane_mesh(radius, size=size, outline=outline) for size in (mesh_size, second_size)
    )
    cells = [PlaneCell(first, ORDER), *(PlaneCell(x, REFERENCE_ORDER) for x in (first, second))]
    slices = []
    for inclusion in inclusions:
        phases = matrix, inclusion
        square = is_round(outline) and all(isinstance(phase, Phase) for phase in phases)
        (stiffness, energies), (higher, reference_energies), (on_second_mesh, _) = (
            cell.solve(phases) for cell in cells
        )
        by_order = ORDER_SAFETY * _distance(stiffness, higher, square=square)
        by_mesh = MESH_SAFETY * _distance(stiffness, on_second_mesh, square=square)
        contrast = inclusion.stiffness[2, 2] / matrix.stiffness[2, 2]
        errors = np.maximum(by_order, by_mesh) + ROUND_OFF + CANCELLATION * radius * contrast
        noise = NOISE * energies.sum(axis=(0, 1))
        energy_errors = ORDER_SAFETY * abs(energies - reference_energies) + noise
        energies = np.array([energies, energy_errors])
        slices.append(Slice(stiffness, errors, energies, cells[0].unknowns))
    return slices


def _distance(first: Array, second: Array, *, square: bool) -> Array:
    """Largest relative distance of each modulus along either axis, shape (3,)."""
    ratio = axial_moduli(first, square=square) / axial_moduli(second, square=square)
    return np.asarray((np.maximum(ratio, 1 / ratio) - 1).max(axis=0))


_DIGITS = 12  # radii equal to so many decimals are one slice
_FINE = 128  # points of a rule in θ whose error is below rounding
_SAFETY = 1.6  # of the error in θ
_NOISE = 1e-13  # of a declared error: what rounding leaves


@dataclass(frozen=True)
class SlicesModel(CellModel):
    """Plane finite elements of order 4 with curved sides at the nodes of a Gauss rule in θ.

    Args:
        mesh_size: Edge length far from the interface, in halves of the cell's side, in (0, 1].
        points: Nodes in θ, at least 2.
        outline: Distance of the particle's edge from its centre over r(θ), a function of the angle.
    """

    mesh_size: float = 0.2
    points: int = 10
    outline: Outline = circle
    name: ClassVar[str] = "slices"
    convention: ClassVar[str] = AVERAGES[AXES]

    def __post_init__(self) -> None:
        require_mesh_size(self.mesh_size)
        require_points(self.points)
        require_outline(self.outline)

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """The slices of a mesh size and an outline; see `CellModel`."""
        return cls(mesh_size=resolution.mesh_size, outline=resolution.outline)

    @property
    def is_exact(self) -> bool:
        """Whether the particle is round, of which mechanics proves signs; see `CellModel`."""
        return is_round(self.outline)

    @property
    def solver_text(self) -> str:
        """How the cell is assembled and solved; see `AnyModel`."""
        return "one UFL form over curved triangles by DOLFINx, solved by PETSc's cholesky"

    def coarser(self) -> Self:
        """Slices on elements twice as large."""
        return replace(self, mesh_size=min(2 * self.mesh_size, LIMIT))

    def solve(
        self, radius_map: RadiusMap, matrix: AnyPhase, inclusions: Sequence[AnyPhase]
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness for each of `inclusions`, in their order, with energies of phases.

        Raises:
            ConvergenceError: A linear system was not solved.
            RefusedError: A Poisson's ratio is above 0.45, or a radius does not fit.
        """
        require_solve_arguments(radius_map, matrix, inclusions, isotropic=False)
        require_compressible(matrix, *inclusions)
        fine_radii = continuous_radii(radius_map)
        start = perf_counter()
        rule = gauss_rule(radius_map.distribution, points=self.points)
        extremes = [fine_radii.min(), fine_radii.max()]  # for the error in θ
        all_radii = np.concatenate([radius_map(rule.nodes), extremes])
        radii, indices = np.unique(np.round(all_radii, _DIGITS), return_inverse=True)
        nodes = indices[: rule.nodes.size]  # index among the radii of each node in θ
        size, outline = self.mesh_size, self.outline
        by_radius = [
            solve_slice(radius, matrix, inclusions, mesh_size=size, outline=outline)
            for radius in radii
        ]
        seconds = perf_counter() - start
        results = []
        for inclusion, *slices in zip(inclusions, *by_radius, strict=True):
            cell = Cell(matrix, inclusion, radius_map, self.outline)
            stiffness, errors, energies, unknowns = map(np.array, zip(*slices, strict=True))
            curve = StressCurve.from_stiffness(rule, stiffness[nodes])
            moduli = square_moduli(stiffness)
            mean = rule.mean(moduli[nodes])
            space_errors = rule.mean((moduli * errors)[nodes]) / mean
            # C11 and C22 differ by the mesh alone; s11 has C11, the moduli their mean
            if cell.square:
                space_errors[0] += abs(STRAIN * mean[0] / curve.mean[0] - 1)
            theta_errors = theta_error(cell, rule, radii=radii, moduli=moduli)
            result = HomogenisedStiffness(
                curve=curve,
                method=self.name,
                solver="cholesky",
                unknowns=int(unknowns.max()),
                seconds=seconds,
                errors={"space": space_errors, "theta": theta_errors},
                cell=cell,
                energies=_mean_energies(cell, rule, radii, nodes, energies),
            )
            results.append(with_checks(result))
        return results


def _mean_energies(
    cell: Cell, rule: ThetaRule, radii: Array, nodes: Ints, energies: Array
) -> PhaseEnergies:
    """Mean energies over θ from values and errors at n radii, shape (n, 2, phases, 2, 3), in Pa."""

    def absolute_theta_error(moduli: Array) -> Array:
        return theta_error(cell, rule, radii=radii, moduli=moduli) * rule.mean(moduli[nodes])

    values, errors = energies[:, 0], energies[:, 1]
    # energies X ∂c/∂X may change sign, but c + X ∂c/∂X are moduli with stiffer phases
    moduli = values.sum(axis=(1, 2))
    stiffer_errors = [
        [absolute_theta_error(moduli + values[:, phase, kind]) for kind in range(2)]
        for phase in range(len(cell.phases))
    ]
    error_in_theta = np.array(stiffer_errors) + absolute_theta_error(moduli)
    return PhaseEnergies(rule.mean(values[nodes]), rule.mean(errors[nodes]) + error_in_theta)


def theta_error(cell: Cell, rule: ThetaRule, *, radii: Array, moduli: Array) -> Array:
    """Declared relative errors of the mean C11 + C12, C11 − C12 and C33 by `rule`, shape (3,).

    The logarithm of a modulus over that of Mori and Tanaka is smooth in √(1 − r²), also where soft
    particles or an incompressible matrix make the modulus itself steep. Its weighted least-squares
    polynomials of several degrees are averaged by a rule of `_FINE` points; the error is the
    largest distance of these means from that by `rule`, with a safety factor.

    Args:
        cell: The cell.
        rule: Its n nodes.
        radii: Radii solved, shape (m,): those of the nodes and the two extreme ones.
        moduli: C11 + C12, C11 − C12 and C33 at `radii`, shape (m, 3).
    """
    nodes = np.searchsorted(radii, np.round(cell.radius_map(rule.nodes), _DIGITS))
    weights = np.maximum(np.bincount(nodes, rule.weights, minlength=radii.size), 1e-6)
    root = np.sqrt(weights)[:, None]
    fine = gauss_rule(cell.radius_map.distribution, points=_FINE)
    fine_radii = cell.radius_map(fine.nodes)

    def mori_tanaka_moduli(r: Array) -> Array:
        bulk, shear = mori_tanaka(np.pi / 4 * r**2, [cell.matrix, cell.inclusion])
        return np.stack([2 * bulk, 2 * shear, shear], axis=-1)

    scale = mori_tanaka_moduli(fine_radii)
    logarithm = np.log(moduli / mori_tanaka_moduli(radii))
    low, high, span = logarithm.min(axis=0), logarithm.max(axis=0), np.ptp(logarithm, axis=0)
    x, fine_x = (np.sqrt(1 - r**2) for r in (radii, fine_radii))
    middle, half_width = (x.min() + x.max()) / 2, max(np.ptp(x), 1e-12) / 2
    mean, distances = rule.weights @ moduli[nodes], []
    # up to the interpolating polynomial, from a degree with some freedom to spare on
    for degree in range(min(max(0, radii.size - 4), 9), min(radii.size, 15)):
        basis = chebvander((x - middle) / half_width, degree)
        coefficients = np.linalg.lstsq(basis * root, logarithm * root, rcond=1e-14)[0]
        fit = chebvander((fine_x - middle) / half_width, degree) @ coefficients
        fine_moduli = scale * np.exp(np.clip(fit, low - span, high + span))
        distances.append(fine.weights @ fine_moduli / mean - 1)
    return np.asarray(_SAFETY * np.abs(distances).max(axis=0) + _NOISE)
