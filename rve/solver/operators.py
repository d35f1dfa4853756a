"""Operators that PETSc calls: a matrix for several vectors side by side, and a saddle point."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.petsc import PETSc, beside_diagonal
from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.rve.solver.constraints import Overlap
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import scipy.sparse as sp


class SideBySide:
    """The operator I ⊗ K: several vectors side by side, entry by entry, as one; called by PETSc.

    PETSc's product of a matrix on several ranks with a dense one takes twice as long as the product
    of what lies on this rank's diagonal, where nearly all entries lie; so the rest is added here.

    Args:
        matrices: One K, or several of one layout for as many groups of vectors.
        columns: Vectors of each.
    """

    def __init__(self, matrices: Sequence[PETSc.Mat], columns: int) -> None:
        self.matrices, self.columns = matrices, columns
        self.inner = [matrix.getDiagonalBlock() for matrix in matrices]
        sizes = self.inner[0].getSize()[0], columns
        self.source = PETSc.Mat().createDense(sizes, comm=self.inner[0].comm)
        self.source.setUp()
        self.source.assemble()
        self.target = self.inner[0].matMult(self.source)
        self.rest = _Rest(matrices, columns) if matrices[0].comm.size > 1 else None

    def matrix(self, columns: int = 1) -> PETSc.Mat:
        """PETSc's matrix of all groups side by side."""
        sizes = [columns * size for size in self.matrices[0].getSizes()[0]]
        operator = PETSc.Mat().createPython((sizes, sizes), self, comm=self.matrices[0].comm)
        operator.setUp()
        return operator

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Y = (I ⊗ K) x."""
        self.times(x.array_r, y.array)

    def times(self, vectors: Array, products: Array) -> None:
        """K times this rank's part of vectors into its part of the products; K is read once."""
        source = self.source.getDenseArray()
        shape = len(source), len(self.inner), self.columns
        values, result = vectors.reshape(shape), products.reshape(shape)
        if self.rest is not None:
            self.rest.fetch(vectors)
        for k, matrix in enumerate(self.inner):
            source[:] = values[:, k]
            matrix.matMult(self.source, result=self.target)
            result[:, k] = self.target.getDenseArray(readonly=True)
        if self.rest is not None:
            self.rest.add(result)


class _Rest:
    """Products with unknowns of other ranks, which few rows have."""

    def __init__(self, matrices: Sequence[PETSc.Mat], columns: int) -> None:
        self.parts = [beside_diagonal(matrix) for matrix in matrices]
        first, wide, others = matrices[0], len(matrices) * columns, self.parts[0].others
        rows, block = first.getSizes()[0][0], first.getBlockSize()
        self.near = PETSc.Vec().createMPI((wide * rows, None), comm=first.comm)
        self.fetched = PETSc.Vec().createSeq(wide * block * len(others))
        wanted = PETSc.IS().createBlock(wide * block, others, comm=PETSc.COMM_SELF)
        self.scatter = PETSc.Scatter().create(self.near, wanted, self.fetched, None)

    def fetch(self, vectors: Array) -> None:
        """Ask other ranks for their parts of vectors, and give them this one's."""
        self.near.array[:] = vectors.ravel()
        self.scatter.begin(self.near, self.fetched)

    def add(self, result: Array) -> None:
        """Add to products, shape (rows, matrices, columns), of the vectors that were asked for."""
        self.scatter.end(self.near, self.fetched)
        far, (_, matrices, columns) = self.fetched.array_r, result.shape
        for k, part in enumerate(self.parts):
            c_loops(WEDGES).add_products(
                len(part.rows), part.rows.ctypes, part.starts.ctypes, part.columns.ctypes,
                part.blocks, columns, matrices * columns, _from(far, k * columns),
                _from(result, k * columns),
            )  # fmt: skip


def _from(values: Array, number: int) -> ctypes.c_void_p:
    """Where one of the numbers stands."""
    return ctypes.c_void_p(values.ctypes.data + number * values.itemsize)


class Saddle:
    """The matrix [K, Bᵀ; B, −C]; called by PETSc, any number of vectors side by side.

    A rank's part of a vector holds its displacements, then the pressures of its levels.

    Args:
        stiffness: K, distributed.
        flux: What this rank's wedges give of B, in the rows and columns that it works on.
        compliance: What they give of C.
        displacements: Those that each rank owns and works on.
        pressures: Likewise.
    """

    def __init__(
        self,
        stiffness: PETSc.Mat,
        flux: sp.csr_matrix,
        compliance: sp.csr_matrix,
        displacements: Overlap,
        pressures: Overlap,
    ) -> None:
        self.stiffness, self._flux, self._compliance = stiffness, flux, compliance
        self._displacements, self._pressures = displacements, pressures
        self._transposed = flux.T.tocsr()
        self._products: SideBySide | None = None

    @property
    def local_size(self) -> int:
        """Entries of a vector on this rank."""
        return len(self._displacements.own) + len(self._pressures.own)

    def matrix(self, columns: int = 1) -> PETSc.Mat:
        """PETSc's matrix of this operator for so many vectors side by side."""
        sizes = (columns * self.local_size, None)
        shell = PETSc.Mat().createPython((sizes, sizes), self, comm=self.stiffness.comm)
        shell.setUp()
        return shell

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Matrix times vectors side by side, entry by entry."""
        values = x.array_r.reshape(self.local_size, -1)
        own = self.split(values)
        u, p = self._displacements.fetch(own[0]), self._pressures.fetch(own[1])
        cut, columns = len(own[0]), values.shape[1]
        result = y.array.reshape(values.shape)
        pushed = self._displacements.give(self._transposed @ p, columns)
        result[:cut] = self._stiff(own[0]) + pushed
        result[cut:] = self._pressures.give(self._flux @ u - self._compliance @ p, columns)

    def _stiff(self, values: Array) -> Array:
        columns, result = values.shape[1], np.empty(values.shape)
        if self._products is None or self._products.columns != columns:
            self._products = SideBySide([self.stiffness], columns)
        self._products.times(values, result)
        return result

    def split(self, values: Array) -> tuple[Array, Array]:
        """Displacements and pressures of this rank's part of vectors (local size, k)."""
        cut = len(self._displacements.own)
        return values[:cut], values[cut:]

    def vector(self, displacements: PETSc.Vec, pressures: Array) -> PETSc.Vec:
        """Vector of displacements and this rank's pressures."""
        found = self.matrix().createVecLeft()
        found.array[:] = np.concatenate([displacements.array_r, pressures])
        return found

    def assembled(self) -> PETSc.Mat:
        """The whole matrix, for direct solvers."""
        import scipy.sparse as sp

        starts, columns, values = self.stiffness.convert("aij", PETSc.Mat()).getValuesCSR()
        rows = np.repeat(np.array(self._displacements.own), np.diff(starts))
        flux, rest, (u, p) = self._flux.tocoo(), self._compliance.tocoo(), self._places()
        beside, below = u[self._displacements.start + flux.col], p[self._pressures.start + flux.row]
        own = p[self._pressures.start + rest.row], p[self._pressures.start + rest.col]
        places = [u[rows], below, beside, own[0]], [u[columns], beside, below, own[1]]
        parts = np.concatenate([values, flux.data, flux.data, -rest.data])
        size = len(u) + len(p)
        given = sp.csr_matrix((parts, tuple(map(np.concatenate, places))), shape=(size, size))
        kept = np.flatnonzero(np.diff(given.indptr)).astype(PETSc.IntType)
        starts = np.append(given.indptr[kept], given.nnz).astype(PETSc.IntType)
        whole = PETSc.Mat().createAIJ([(self.local_size, size)] * 2, comm=self.stiffness.comm)
        numbers = given.indices.astype(PETSc.IntType)
        whole.setValuesIJV(starts, numbers, given.data, PETSc.InsertMode.ADD_VALUES, kept)
        whole.assemble()
        return whole

    def _places(self) -> tuple[Integers, Integers]:
        """Rows of all displacements and of all pressures."""
        owned = zip(self._displacements.owned, self._pressures.owned, strict=True)
        counts = [len(rows) for both in owned for rows in both]
        pressed = np.repeat(np.arange(len(counts)) % 2, counts)
        return np.flatnonzero(pressed == 0), np.flatnonzero(pressed)
