"""One plane cell by curved Lagrange triangles of any order, periodic by elimination."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import AREA
from alphacut.rve.fenicsx import MPI, basix, cholesky, fem, mesh_of
from alphacut.rve.form import CellForm, measure_of
from alphacut.rve.mesh.curved import PlaneMesh, curved_nodes
from alphacut.rve.mesh.jacobian import quadrature_degree
from alphacut.rve.mesh.periodicity import unknowns
from alphacut.rve.solver.krylov import ConvergenceError, solve
from alphacut.rve.solver.numbering import map_of, reduced, zero_matrix

PREFIX = "rve_slice_"
RESIDUAL = 1e-8  # relative, of a factorisation


class PlaneCell:
    """Isoparametric triangles of `order`.

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
        inside = mesh.inside[plane.topology.original_cell_index]
        parts = [measure_of(plane, np.flatnonzero(inside == flag), rule) for flag in (False, True)]
        self._form = CellForm(space, fem.functionspace(plane, ("DG", 0)), parts)
        self._form.density.x.array[:] = 1.0
        self._places: Array = np.empty((len(nodes), 2))
        self._places[space.dofmap.list] = plane.geometry.x[plane.geometry.dofmap, :2]
        pairs = unknowns(self._places)
        self.unknowns = 2 * (int(pairs.max()) + 1)
        self._local = map_of(pairs, MPI.COMM_SELF)
        rows = range(self.unknowns)
        self._matrix = zero_matrix(pairs[space.dofmap.list], self._local, rows, self.unknowns)

    def stiffness(self, phases: tuple[Array, Array]) -> Array:
        """Homogenised stiffness in Pa, Voigt order, shape (3, 3), for the phases' matrices.

        Raises:
            ConvergenceError: The linear system was not solved.
        """
        self._form.set_phases(phases)
        self._matrix.zeroEntries()
        self._form.add_stiffness(self._matrix)
        forces = [self._form.load(one) for one in np.eye(3)]
        loads = [reduced(one, self._local, self.unknowns, self.unknowns) for one in forces]
        solved = solve(cholesky(self._matrix, PREFIX), loads)
        if not solved.residual <= RESIDUAL:
            raise ConvergenceError(
                f"the factorisation of a plane cell leaves a relative residual of"
                f" {solved.residual:.1e}; {RESIDUAL:g} is allowed",
                "check the moduli, or take the series",
            )
        uniform = -self._affine().T @ np.stack(forces, axis=-1)
        gained = [[load.dot(x) for x in solved.vectors] for load in loads]
        return np.asarray((uniform - gained) / AREA)  # ⟨σ⟩ by Hill–Mandel

    def _affine(self) -> Array:
        """Displacements of the unit strains (11, 22, 12 with 2 ε12 = 1), shape (nodes · 2, 3)."""
        (x, y), zero = self._places.T, np.zeros(len(self._places))
        first, second = np.stack([x, zero, y / 2], -1), np.stack([zero, y, x / 2], -1)
        return np.stack([first, second], axis=1).reshape(-1, 3)
