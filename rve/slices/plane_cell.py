"""A two-dimensional unit cell by curved Lagrange triangles, and its error by orders and meshes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import AREA, THREE_LOADS, AnyPhase, Interphase, thickness_of
from alphacut.rve.cell.outline import Outline, circle
from alphacut.rve.fenicsx import MPI, basix, cholesky, fem, mesh_of
from alphacut.rve.mesh.curved import PlaneMesh, curved_nodes, plane_mesh, quadrature_degree
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.result.moduli import axial_moduli
from alphacut.rve.solver.form import (
    CellForm,
    PointStrains,
    energies_by_phase,
    measure_of,
    strain_products,
    total_energy,
)
from alphacut.rve.solver.krylov import ConvergenceError, solve
from alphacut.rve.solver.numbering import NodeScatter, map_of, reduced_vector, zero_matrix

PREFIX = "rve_slice_"
RESIDUAL = 1e-8  # relative, of a factorisation
ACCURATE_ORDER, REFERENCE_ORDER = 4, 5
"""Order of the elements whose error is estimated, and the next, which estimates it."""
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
        phase = mesh.phase[plane.topology.original_cell_index]
        is_phase = np.equal.outer(np.arange(int(mesh.phase.max()) + 1), phase)
        rule = {"quadrature_degree": degree}
        parts = [measure_of(plane, np.flatnonzero(mask), rule) for mask in is_phase]
        self._form = CellForm(space, fem.functionspace(plane, ("DG", 0)), parts)
        self._form.density.x.array[:] = 1.0
        points, weights = basix.make_quadrature(basix.CellType.triangle, degree)
        self._point_strains = PointStrains(space, points)
        areas = abs(self._point_strains.determinants()) * weights / AREA
        self.weights: Array = (is_phase[:, :, None] * areas).reshape(len(is_phase), -1)
        positions: Array = np.empty((len(nodes), 2))
        positions[space.dofmap.list] = plane.geometry.x[plane.geometry.dofmap, :2]
        pairs = unknowns(positions)
        self.unknowns = 2 * (int(pairs.max()) + 1)
        self._local = map_of(pairs, MPI.COMM_SELF)
        rows = range(self.unknowns)
        self._matrix = zero_matrix(pairs[space.dofmap.list], self._local, rows, self.unknowns)
        self._to_nodes = NodeScatter(pairs, self._matrix.createVecRight())

    def strains(self, phases: Sequence[Array]) -> Array:
        """Strains at the quadrature points under unit strains, (points, 3, 3); stiffness in Pa.

        Raises:
            ConvergenceError: The linear system was not solved.
        """
        self._form.set_phases(phases)
        self._matrix.zeroEntries()
        self._form.add_stiffness(self._matrix)
        size, unit_strains = self.unknowns, np.eye(3)
        forces = [self._form.load(strain) for strain in unit_strains]
        loads = [reduced_vector(force, self._local, size, size) for force in forces]
        solved = solve(cholesky(self._matrix, PREFIX), loads)
        if not solved.residual <= RESIDUAL:
            raise ConvergenceError(
                f"the factorisation of a plane cell leaves a relative residual of"
                f" {solved.residual:.1e}; {RESIDUAL:g} is allowed",
                "check the moduli, or take the series",
            )
        fields = [self._point_strains(self._to_nodes(vector)) for vector in solved.vectors]
        return np.asarray((np.stack(fields, axis=-1) + unit_strains).reshape(-1, 3, 3))

    def products(self, phases: Sequence[Array]) -> Array:
        """Means of ε_a ⊗ ε_b by phase under unit strains, shape (phases, 3, 3, 3, 3)."""
        return strain_products(self.strains(phases), self.weights)

    def stiffness(self, phases: Sequence[Array]) -> Array:
        """Homogenised stiffness in Pa, Voigt order, shape (3, 3), by the energy of unit strains."""
        return total_energy(self.products(phases), phases)


@dataclass(frozen=True)
class Slice:
    """A two-dimensional cell solved for m inclusions by several orders, the highest on two meshes.

    Args:
        by_order: Stiffness in Pa, (m, 3, 3), by order; orders 4 and 5 are among them.
        on_second_mesh: Stiffness by order 5 on the second mesh, shape (m, 3, 3), in Pa.
        unknowns: Number of unknowns of the linear system, by order.
        round_off: Relative error by rounding of each inclusion, shape (m, 1).
        energies: Parts of the phases in the three moduli by order, shape (m, phases, 2, 3), in Pa.
    """

    by_order: Mapping[int, Array]
    on_second_mesh: Array
    unknowns: Mapping[int, int]
    round_off: Array
    energies: Mapping[int, Array] = field(default_factory=dict)

    def error(self, order: int, *, square: bool) -> Array:
        """Declared relative errors of C11 + C12, C11 − C12 and C33, shape (m, 3).

        The error of order 4 is the larger of its distances from order 5 on the same mesh and on the
        second one, each with a safety factor; other orders add their distance from order 4. Without
        the symmetry of the square, the larger of the errors with C11 and with C22 counts.
        """
        accurate, higher = self.by_order[ACCURATE_ORDER], self.by_order[REFERENCE_ORDER]
        by_order = ORDER_SAFETY * _distance(accurate, higher, square=square)
        by_mesh = MESH_SAFETY * _distance(accurate, self.on_second_mesh, square=square)
        error = np.maximum(by_order, by_mesh)
        distance = _distance(self.by_order[order], accurate, square=square)
        return np.asarray((1 + distance) * (1 + error + self.round_off) - 1)

    def energies_with_errors(self, order: int) -> tuple[Array, Array]:
        """Energies by elements of `order`, and errors: distances from the highest other order."""
        values = self.energies[order]
        reference = self.energies[max(set(self.energies) - {order})]
        error = ORDER_SAFETY * abs(values - reference)
        return values, error + NOISE * values.sum(axis=(1, 2), keepdims=True)


def _distance(first: Array, second: Array, *, square: bool) -> Array:
    """Largest relative distance of each modulus along either axis, shape (m, 3)."""
    ratio = axial_moduli(first, square=square) / axial_moduli(second, square=square)
    return np.asarray((np.maximum(ratio, 1 / ratio) - 1).max(axis=1))


def solve_slice(
    radius: float,
    matrix: AnyPhase,
    inclusions: Sequence[AnyPhase],
    *,
    mesh_size: float,
    outline: Outline = circle,
    order: int = ACCURATE_ORDER,
    interphase: Interphase | None = None,
) -> Slice:
    """Solve a plane cell with one particle by three orders on one mesh and one on a second mesh.

    Args:
        radius: Radius of the particle over half the cell's side.
        matrix: Phase outside it.
        inclusions: Phases of the particle, m of them, each of which is solved.
        mesh_size: Edge length of the mesh of the result, in halves of the cell's side.
        outline: Outline of the particle.
        order: Order of the elements of the result.
        interphase: Ring around a round particle.
    """
    thickness = thickness_of(interphase)
    ring = () if interphase is None else (interphase.phase,)
    samples = [(matrix, inclusion, *ring) for inclusion in inclusions]
    second_size = 2 * mesh_size if 2 * mesh_size <= LIMIT else mesh_size / 2
    first, second = (
        plane_mesh(radius, size=size, outline=outline, thickness=thickness)
        for size in (mesh_size, second_size)
    )
    orders = sorted({order, ACCURATE_ORDER, REFERENCE_ORDER})
    cells = {degree: PlaneCell(first, degree) for degree in orders}
    solved = {degree: [_solve_sample(cell, x) for x in samples] for degree, cell in cells.items()}
    reference = PlaneCell(second, REFERENCE_ORDER)
    contrast = np.array([[x.stiffness[2, 2] / matrix.stiffness[2, 2]] for x in inclusions])
    return Slice(
        by_order={degree: np.array([x for x, _ in pairs]) for degree, pairs in solved.items()},
        on_second_mesh=np.array([_solve_sample(reference, x)[0] for x in samples]),
        unknowns={degree: cell.unknowns for degree, cell in cells.items()},
        round_off=ROUND_OFF + CANCELLATION * radius * contrast,
        energies={degree: np.array([x for _, x in pairs]) for degree, pairs in solved.items()},
    )


def _solve_sample(cell: PlaneCell, phases: Sequence[AnyPhase]) -> tuple[Array, Array]:
    """Stiffness, (3, 3), and energies of the phases, (phases, 2, 3), in Pa."""
    stiffness = [phase.stiffness for phase in phases]
    products = cell.products(stiffness)
    # fields of `THREE_LOADS` are sums of those of unit strains
    load_products = np.einsum("piajb,ka,lb->pikjl", products, THREE_LOADS, THREE_LOADS)
    energies = energies_by_phase(load_products, phases, THREE_LOADS)
    return total_energy(products, stiffness), energies
