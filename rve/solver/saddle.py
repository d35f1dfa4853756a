"""Saddle-point operator of displacements and pressures over distributed levels."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from alphacut.rve.petsc import PETSc
from alphacut.rve.solver.constraints import Overlap
from alphacut.stochastic.theta.truncated_normal import Array


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
        self._dense: tuple[PETSc.Mat, PETSc.Mat] | None = None

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
