"""Saddle-point operator of displacements and pressures over distributed levels."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from alphacut.rve.petsc import PETSc
from alphacut.stochastic.theta.truncated_normal import Array


class Saddle:
    """The matrix [K, Bᵀ; B, −C]; called by PETSc, any number of vectors side by side.

    A rank's part of a vector holds its displacements, then the pressures of its levels.

    Args:
        stiffness: K, distributed.
        flux: B, whole on every rank.
        compliance: C, likewise.
        levels: This rank's levels.
        count: Pressures of a level.
    """

    def __init__(
        self,
        stiffness: PETSc.Mat,
        flux: sp.csr_matrix,
        compliance: sp.csr_matrix,
        levels: range,
        count: int,
    ) -> None:
        self.stiffness, self._flux, self._compliance = stiffness, flux, compliance
        self._pressures = slice(levels.start * count, levels.stop * count)
        self._displacements = slice(*stiffness.getOwnershipRange())
        self._transposed = flux[:, self._displacements].T.tocsr()
        self._dense: tuple[PETSc.Mat, PETSc.Mat] | None = None

    @property
    def local_size(self) -> int:
        """Entries of a vector on this rank."""
        u, p = self._displacements, self._pressures
        return int(u.stop - u.start + p.stop - p.start)

    def matrix(self, columns: int = 1) -> PETSc.Mat:
        """PETSc's matrix of this operator for so many vectors side by side."""
        sizes = (columns * self.local_size, None)
        shell = PETSc.Mat().createPython((sizes, sizes), self, comm=self.stiffness.comm)
        shell.setUp()
        return shell

    def mult(self, _matrix: PETSc.Mat, x: PETSc.Vec, y: PETSc.Vec) -> None:
        """Matrix times vectors side by side, entry by entry."""
        values = x.array_r.reshape(self.local_size, -1)
        cut = self._displacements.stop - self._displacements.start
        u, p = self._gather(values[:cut]), self._gather(values[cut:])
        result = y.array.reshape(values.shape)
        result[:cut] = self._stiff(values[:cut]) + self._transposed @ p
        result[cut:] = self._flux[self._pressures] @ u - self._compliance[self._pressures] @ p

    def _stiff(self, values: Array) -> Array:
        columns = values.shape[1]
        if self._dense is None or self._dense[0].getSize()[1] != columns:
            sizes = ((len(values), self.stiffness.getSize()[1]), (None, columns))
            source = PETSc.Mat().createDense(sizes, comm=self.stiffness.comm)
            source.setUp()
            source.assemble()
            self._dense = source, self.stiffness.matMult(source)
        source, target = self._dense
        source.getDenseArray()[:] = values
        self.stiffness.matMult(source, result=target)
        return np.asarray(target.getDenseArray(readonly=True))

    def _gather(self, local: Array) -> Array:
        comm = self.stiffness.comm.tompi4py()
        return np.concatenate(comm.allgather(local)) if comm.size > 1 else local

    def split(self, values: Array) -> tuple[Array, Array]:
        """Whole displacements and pressures from this rank's part of vectors (local size, k)."""
        cut = self._displacements.stop - self._displacements.start
        return self._gather(values[:cut]), self._gather(values[cut:])

    def vector(self, displacements: PETSc.Vec, pressures: Array) -> PETSc.Vec:
        """Vector of distributed displacements and whole pressures."""
        found = self.matrix().createVecLeft()
        found.array[:] = np.concatenate([displacements.array_r, pressures[self._pressures]])
        return found

    def assembled(self) -> PETSc.Mat:
        """The whole matrix, for direct solvers.

        Raises:
            RuntimeError: On several ranks.
        """
        if self.stiffness.comm.size > 1:
            raise RuntimeError(
                "nearly incompressible phases have a direct solver on one rank only; take the"
                " default solver, or one rank"
            )
        rows, columns, values = self.stiffness.convert("aij").getValuesCSR()
        stiffness = sp.csr_matrix((values, columns, rows), shape=self.stiffness.getSize())
        whole = sp.bmat([[stiffness, self._flux.T], [self._flux, -self._compliance]], format="csr")
        whole.sort_indices()
        csr = whole.indptr.astype(PETSc.IntType), whole.indices.astype(PETSc.IntType), whole.data
        return PETSc.Mat().createAIJ(whole.shape, csr=csr, comm=self.stiffness.comm)
