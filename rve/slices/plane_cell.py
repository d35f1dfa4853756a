"""One plane cell by curved Lagrange triangles of any order, periodic by elimination."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import FailedError
from alphacut.rve.fenicsx import MPI, PETSc, basix, factors, fem, mesh_of, ufl
from alphacut.rve.form import CellForm
from alphacut.rve.mesh.curved import PlaneMesh, curved_nodes

AREA = 4.0
PREFIX = "rve_slice_"
RESIDUAL = 1e-8  # relative, of a factorisation


class PlaneError(FailedError):
    """The linear system of a plane cell was not solved."""


class PlaneCell:
    """Isoparametric triangles of `order`.

    Args:
        mesh: Triangles of the cell.
        order: Polynomial degree of field and geometry, 1 to 4.

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
        dx = ufl.Measure("dx", domain=plane, metadata={"quadrature_degree": 2 * order + 1})
        self._form = CellForm(space, fem.functionspace(plane, ("DG", 0)), [dx])
        self._form.density.x.array[:] = 1.0
        self._form.share.x.array[:] = mesh.inside[plane.topology.original_cell_index]
        self._places: Array = np.empty((len(nodes), 2))
        self._places[space.dofmap.list] = plane.geometry.x[plane.geometry.dofmap, :2]
        self._pairs = _unknown(self._places)
        self.unknowns = 2 * (int(self._pairs.max()) + 1)
        self._local = PETSc.LGMap().create(self._pairs.astype(PETSc.IntType), bsize=2)
        self._matrix = self._zeros(self._pairs[space.dofmap.list])

    def _zeros(self, pairs: Rows) -> PETSc.Mat:
        """Matrix with room for the pairs of unknowns of each triangle, shape (m, nodes)."""
        kept = pairs >= 0
        cell = np.broadcast_to(np.arange(len(pairs))[:, None], pairs.shape)[kept]
        touch = sp.csr_matrix((np.ones(len(cell), np.int8), (cell, pairs[kept])))
        pattern = sp.kron((touch.T @ touch).astype(bool), np.ones((2, 2), bool), "csr")
        pattern.sort_indices()
        csr = pattern.indptr.astype(PETSc.IntType), pattern.indices.astype(PETSc.IntType)
        matrix = PETSc.Mat().createAIJ(pattern.shape, bsize=2, comm=PETSc.COMM_SELF)
        matrix.setPreallocationCSR((*csr, np.zeros(pattern.nnz)))
        matrix.setLGMap(self._local, self._local)
        matrix.setOption(PETSc.Mat.Option.SPD, True)
        return matrix

    def stiffness(self, phases: tuple[Array, Array]) -> Array:
        """Homogenised stiffness in Pa, Voigt order, shape (3, 3), for the phases' matrices.

        Raises:
            PlaneError: The linear system was not solved.
        """
        self._form.set_phases(phases)
        self._matrix.zeroEntries()
        self._form.add_stiffness(self._matrix)
        forces = np.stack([self._form.load(one) for one in np.eye(3)], axis=-1)
        uniform = -np.einsum("na,nb->ab", self._affine(), forces)
        reduced, fluctuations = self._solve(forces)
        # ⟨σ⟩ by Hill–Mandel
        return np.asarray((uniform - reduced.T @ fluctuations) / AREA)

    def _affine(self) -> Array:
        """Displacements of the unit strains (11, 22, 12 with 2 ε12 = 1), shape (nodes · 2, 3)."""
        (x, y), zero = self._places.T, np.zeros(len(self._places))
        first, second = np.stack([x, zero, y / 2], -1), np.stack([zero, y, x / 2], -1)
        return np.stack([first, second], axis=1).reshape(-1, 3)

    def _solve(self, forces: Array) -> tuple[Array, Array]:
        """Reduced loads and their solutions, each (unknowns, 3)."""
        ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        ksp.setOptionsPrefix(PREFIX)
        ksp.setOperators(self._matrix)
        ksp.setType("preonly")
        ksp.pc.setType("cholesky")
        ksp.pc.setFactorSolverType(factors())
        ksp.setFromOptions()
        x, load = self._matrix.createVecs()
        kept, loads, solutions = self._pairs >= 0, [], []
        for column in forces.T:
            load.array[:] = 0
            np.add.at(load.array.reshape(-1, 2), self._pairs[kept], column.reshape(-1, 2)[kept])
            ksp.solve(load, x)
            rest = load.duplicate()
            self._matrix.mult(x, rest)
            rest.axpy(-1, load)
            if ksp.getConvergedReason() < 0 or not rest.norm() <= RESIDUAL * load.norm():
                size = rest.norm() / (load.norm() or 1.0)
                raise PlaneError(
                    f"the factorisation of a plane cell leaves a relative residual of {size:.1e};"
                    f" {RESIDUAL:g} is allowed", "check the moduli, or take the series",
                )  # fmt: skip
            loads.append(np.array(load.array_r))
            solutions.append(np.array(x.array_r))
        return np.stack(loads, axis=-1), np.stack(solutions, axis=-1)


def _unknown(places: Array) -> Rows:
    """Pair of unknowns of each node: those at 1 follow those at −1, the corner has −1."""
    wrapped = np.where(places > 1 - 1e-9, -1.0, places)
    across, along = np.round((wrapped + 1) * 1e8).astype(np.int64).T
    return np.asarray(np.unique(across * 10**9 + along, return_inverse=True)[1] - 1)
