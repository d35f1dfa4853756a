"""A two-dimensional unit cell by curved Lagrange triangles of any order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import AREA, THREE_LOADS, AnyPhase
from alphacut.rve.fenicsx import MPI, PETSc, basix, cholesky, fem, mesh_of
from alphacut.rve.mesh.curved import PlaneMesh, curved_nodes, quadrature_degree
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.result.moduli import moduli_of_energies
from alphacut.rve.solver.form import CellForm, measure_of
from alphacut.rve.solver.krylov import ConvergenceError, solve
from alphacut.rve.solver.numbering import map_of, reduced_vector, zero_matrix

PREFIX = "rve_slice_"
RESIDUAL = 1e-8  # relative, of a factorisation


class PlaneCell:
    """Periodic cell in plane strain of isoparametric triangles; sides are paired by elimination.

    Args:
        mesh: Triangles of the cell.
        order: Polynomial degree of field and geometry, 1 or more.

    Attributes:
        unknowns: Unknowns after elimination.
    """

    def __init__(self, mesh: PlaneMesh, order: int) -> None:
        nodes, cells = curved_nodes(mesh, order)
        variant = basix.LagrangeVariant.gll_warped
        element = basix.ufl.element("P", "triangle", order, variant, shape=(2,))
        plane = mesh_of(MPI.COMM_SELF, cells, len(nodes), element)
        plane.geometry.x[:, :2] = nodes[plane.geometry.input_global_indices]
        space = fem.functionspace(plane, element)
        rule = {"quadrature_degree": quadrature_degree(order)}
        phase = mesh.phase[plane.topology.original_cell_index]
        count = int(mesh.phase.max()) + 1
        parts = [measure_of(plane, np.flatnonzero(phase == k), rule) for k in range(count)]
        self._form = CellForm(space, fem.functionspace(plane, ("DG", 0)), parts)
        self._form.density.x.array[:] = 1.0
        self._nodes: Array = np.empty((len(nodes), 2))
        self._nodes[space.dofmap.list] = plane.geometry.x[plane.geometry.dofmap, :2]
        pairs = unknowns(self._nodes)
        self.unknowns = 2 * (int(pairs.max()) + 1)
        self._local = map_of(pairs, MPI.COMM_SELF)
        rows = range(self.unknowns)
        self._matrix = zero_matrix(pairs[space.dofmap.list], self._local, rows, self.unknowns)

    def stiffness(self, phases: Sequence[Array]) -> Array:
        """Solve under unit strains: homogenised stiffness in Pa, Voigt order, shape (3, 3).

        Raises:
            ConvergenceError: The linear system was not solved.
        """
        self._form.set_phases(phases)
        self._matrix.zeroEntries()
        self._form.add_stiffness(self._matrix)
        forces = [self._form.load(strain) for strain in np.eye(3)]
        size = self.unknowns
        loads = [reduced_vector(force, self._local, size, size) for force in forces]
        solved = solve(cholesky(self._matrix, PREFIX), loads)
        if not solved.residual <= RESIDUAL:
            raise ConvergenceError(
                f"the factorisation of a plane cell leaves a relative residual of"
                f" {solved.residual:.1e}; {RESIDUAL:g} is allowed",
                "check the moduli, or take the series",
            )
        self._fields = solved.vectors
        # ∫ σ by Hill–Mandel; loads are −∫ Bᵀ C ε̄
        by_unit_strains = -self._affine().T @ np.stack(forces, axis=-1)
        by_fluctuations = [[load.dot(x) for x in solved.vectors] for load in loads]
        return np.asarray((by_unit_strains - by_fluctuations) / AREA)

    def phase_energies(self, phases: Sequence[AnyPhase]) -> Array:
        """Parts of K and G of each phase in C11 + C12, C11 − C12 and C33, (phases, 2, 3), in Pa.

        `stiffness` must have been called with these phases just before: its fields are used.
        """
        energies = np.zeros((len(phases), 2, 3))
        fields = [self._field(strain) for strain in THREE_LOADS]
        for part in range(2):  # K, then G
            self._form.set_phases([phase.stiffness_parts[part] for phase in phases])
            for k in range(len(phases)):
                load_energies = self._energies(fields, slice(k, k + 1))
                energies[k, part] = moduli_of_energies(load_energies, THREE_LOADS)
        return energies

    def _field(self, strain: Array) -> PETSc.Vec:
        """Fluctuation of a macroscopic strain (3,) from those of unit strains."""
        field = self._fields[0].duplicate()
        field.set(0.0)
        field.maxpy(strain.tolist(), self._fields)
        return field

    def _energies(self, fields: Sequence[PETSc.Vec], phase: slice) -> Array:
        """Mean of ε : C ε in a phase under each of `THREE_LOADS`, shape (3,), in Pa.

        C is that set in the form; the strain is that of the load plus that of its fluctuation.
        """
        self._matrix.zeroEntries()
        self._form.add_stiffness(self._matrix, phase)
        energies, affine = [], self._affine()
        for strain, field in zip(THREE_LOADS, fields, strict=True):
            force = self._form.load(strain, phase)
            load = reduced_vector(force, self._local, self.unknowns, self.unknowns)
            uniform = -(affine @ strain) @ force
            mixed, fluctuation = -2 * load.dot(field), field.dot(self._matrix * field)
            energies.append(uniform + mixed + fluctuation)
        return np.array(energies) / AREA

    def _affine(self) -> Array:
        """Displacements of the unit strains (11, 22, 12 with 2 ε12 = 1), shape (nodes · 2, 3)."""
        (x, y), zero = self._nodes.T, np.zeros(len(self._nodes))
        first, second = np.stack([x, zero, y / 2], -1), np.stack([zero, y, x / 2], -1)
        return np.stack([first, second], axis=1).reshape(-1, 3)
