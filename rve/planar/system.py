"""Linear system of a planar cell: periodic elimination and Cholesky factor."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from cvxopt import cholmod, matrix, spmatrix

from alphacut.rve.mesh.triangulation import Integers
from alphacut.stochastic.theta.truncated_normal import Array

SOLVER = "CHOLMOD"
AREA = 4.0
_BASIS_TOLERANCE = 1e-11  # relative change of the stiffness by one more solution in the basis


class PlanarError(RuntimeError):
    """The linear system of a planar cell was not solved."""


class PeriodicPattern:
    """K ↦ the entries of Pᵀ K P, for several K of 2 × 2 blocks and one sparsity pattern.

    Args:
        nodes: Periodic number of each node, two degrees of freedom on each; those of node 0 are
            fixed.
        matrices: Unreduced matrices, one for each pattern to come.
    """

    def __init__(self, nodes: Integers, matrices: Sequence[sp.bsr_matrix]) -> None:
        size = int(nodes.max())
        keys, self._kept = [], []
        for full in matrices:
            row, column = np.repeat(nodes - 1, np.diff(full.indptr)), nodes[full.indices] - 1
            self._kept.append((row >= 0) & (column >= 0))
            keys.append((row * size + column)[self._kept[-1]])
        united, place = np.unique(np.concatenate(keys), return_inverse=True)
        self._place = np.split(place, np.cumsum([k.size for k in keys])[:-1])
        starts = np.searchsorted(united, np.arange(size + 1) * size)
        self._blocks = united % size, starts
        entries = self._csr(np.arange(4.0 * united.size).reshape(-1, 2, 2))
        self.rows, self.columns, self._order = (
            entries.indptr,
            entries.indices,
            entries.data.astype(np.int64),
        )

    def _csr(self, blocks: Array) -> sp.csr_matrix:
        size = 2 * (self._blocks[1].size - 1)
        return sp.bsr_matrix((blocks, *self._blocks), shape=(size, size)).tocsr()

    def __call__(self, which: int, full: sp.bsr_matrix) -> Array:
        """Entries in CSR order of the matrix whose pattern is number `which`."""
        kept, place, count = full.data[self._kept[which]], self._place[which], self._blocks[0].size
        sums = [
            np.bincount(place, weights=kept[:, i, j], minlength=count)
            for i in (0, 1)
            for j in (0, 1)
        ]
        return np.asarray(np.stack(sums, axis=-1).ravel()[self._order])


class Cholesky:
    """Sparse factorisation that keeps its ordering while values change.

    Args:
        rows: CSR row pointer.
        columns: CSR column indices.
    """

    def __init__(self, rows: Integers, columns: Integers) -> None:
        self._size, self._shape = rows.size - 1, (columns, rows)
        row = np.repeat(np.arange(self._size), np.diff(rows))
        self._upper = columns >= row  # row by row: the lower triangle, column by column
        low, high = columns[self._upper], row[self._upper]
        self._matrix = spmatrix(1.0, low, high, (self._size, self._size))
        self._factor = cholmod.symbolic(self._matrix)

    def solve(self, values: Array, loads: Array) -> Array:
        """Solutions of the columns of `loads` for the matrix with these `values`.

        Raises:
            PlanarError: The matrix is not positive definite, or the residual is no good.
        """
        scale = np.abs(values).max()
        self._matrix.V = matrix(values[self._upper] / scale)
        found = matrix(loads / scale)
        try:
            cholmod.numeric(self._matrix, self._factor)
            cholmod.solve(self._factor, found)
        except ArithmeticError:
            raise PlanarError(
                "the stiffness has no Cholesky factor: check the moduli, or take the series"
            ) from None
        solutions = np.asarray(found)
        product = sp.csr_matrix((values, *self._shape), shape=(self._size,) * 2) @ solutions
        residual = float(np.linalg.norm(product - loads)) / max(
            float(np.linalg.norm(loads)), 1e-300
        )
        if not residual < 1e-8:  # also catches nan
            raise PlanarError(
                f"the Cholesky factorisation leaves a relative residual of {residual:.1e}; 1e-8 is"
                " allowed: check the moduli"
            )
        return solutions


class Pencil:
    """One cell's system (fixed + E · unit) for any modulus E of the particle.

    Args:
        fixed: Unreduced stiffness of the matrix.
        unit: Unreduced stiffness of the particle for a modulus of 1 Pa.
        nodes: Periodic number of each node.
        periodic: P, shape (2n, unknowns).
        affine: Displacements of the three unit strains, shape (2n, 3).
    """

    def __init__(
        self,
        fixed: sp.bsr_matrix,
        unit: sp.bsr_matrix,
        nodes: Integers,
        periodic: sp.csr_matrix,
        affine: Array,
    ) -> None:
        pattern = PeriodicPattern(nodes, [fixed, unit])
        self._values = pattern(0, fixed), pattern(1, unit)
        self._shape = pattern.columns, pattern.rows
        self._factor = Cholesky(pattern.rows, pattern.columns)
        forces = fixed @ affine, unit @ affine
        self.loads = tuple(np.asarray(periodic.T @ force) for force in forces)
        # 3 × 3: energy without fluctuation
        self.uniform = tuple(np.asarray(affine.T @ force) for force in forces)

    def solve(self, modulus: float) -> tuple[Array, Array]:
        """Negative fluctuations, shape (unknowns, 3), and stiffness in Pa, shape (3, 3)."""
        load = self.loads[0] + modulus * self.loads[1]
        correction = self._factor.solve(self._values[0] + modulus * self._values[1], load)
        uniform = self.uniform[0] + modulus * self.uniform[1]
        return correction, (uniform - load.T @ correction) / AREA  # ⟨σ⟩ by Hill–Mandel

    def applied(self, vectors: Array) -> tuple[Array, Array]:
        """K V of both parts for vectors of shape (unknowns, k)."""
        fixed, unit = (
            np.asarray(sp.csr_matrix((values, *self._shape)) @ vectors) for values in self._values
        )
        return fixed, unit


class ModulusBasis:
    """Galerkin on the solutions at a few moduli of the particle.

    The energy is stationary, so each solution matches value and slope of the stiffness there, and
    the error falls like that of a rational interpolant of twice as many nodes. Solutions are added
    where the last one changed most, until it changed nothing.

    Args:
        pencil: The system.
    """

    def __init__(self, pencil: Pencil) -> None:
        self._pencil, self.size = pencil, 0
        self._vectors = np.empty((pencil.loads[0].shape[0], 0))
        self._projected = [np.empty((0, 0)), np.empty((0, 0))]  # Vᵀ K V of both parts

    def stiffness(self, moduli: Array) -> Array:
        """Stiffness for every one of `moduli` in Pa, shape (m, 3, 3)."""
        low, high = float(moduli.min()), float(moduli.max())
        for modulus in (low, high):
            self._add(modulus)
        found, taken = self._galerkin(moduli), {low, high}
        worst: float | None = float(moduli[np.argmin(np.abs(np.log(moduli / np.sqrt(low * high))))])
        while worst is not None and worst not in taken:
            self._add(worst)
            taken.add(worst)
            better = self._galerkin(moduli)
            change = np.abs(better - found).max(axis=(1, 2)) / np.abs(better).max(axis=(1, 2))
            change[[float(e) in taken and e != worst for e in moduli]] = 0.0
            found = better
            left = np.where([float(e) in taken for e in moduli], 0.0, change)
            worst = float(moduli[left.argmax()]) if change.max() > _BASIS_TOLERANCE else None
        return found

    def _add(self, modulus: float) -> None:
        """Put the three solutions at `modulus` into the orthonormal basis."""
        solution = self._pencil.solve(modulus)[0]
        fresh = solution / np.linalg.norm(solution, axis=0)
        for _ in range(2):
            fresh = np.linalg.qr(fresh - self._vectors @ (self._vectors.T @ fresh))[0]
        for k, image in enumerate(self._pencil.applied(fresh)):
            side = self._vectors.T @ image
            self._projected[k] = np.block([[self._projected[k], side], [side.T, fresh.T @ image]])
        self._vectors = np.hstack([self._vectors, fresh])
        self.size += 1

    def _galerkin(self, moduli: Array) -> Array:
        fixed, unit = self._projected
        loads = [self._vectors.T @ load for load in self._pencil.loads]
        stiffness = []
        for modulus in moduli:
            load = loads[0] + modulus * loads[1]
            uniform = self._pencil.uniform[0] + modulus * self._pencil.uniform[1]
            stiffness.append(
                (uniform - load.T @ np.linalg.solve(fixed + modulus * unit, load)) / AREA
            )
        return np.array(stiffness)
