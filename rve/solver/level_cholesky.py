"""Cholesky factors of many matrices of one pattern, as triangles: P A_k Pᵀ = L_k L_kᵀ.

One fill-reducing order serves all matrices, so that L is a smooth function of the entries:
neighbouring levels have neighbouring L. Of one pattern the matrices are treated side by side, eight
at a time, by the loops of `level_factors.c`.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from cvxopt import amd, spmatrix

from alphacut.rve.solver.c_loops import c_loops
from alphacut.rve.solver.level_stiffness import LevelPattern
from alphacut.stochastic.theta.truncated_normal import Array

_SOURCE = Path(__file__).with_name("level_factors.c")


class LevelCholesky:
    """The factors L_k of matrices A_k of one pattern.

    Args:
        pattern: Where the entries lie.
        values: Stored entries of each matrix, one array for each.

    Raises:
        RuntimeError: A matrix is not positive definite.
    """

    def __init__(self, pattern: LevelPattern, values: Iterable[Array]) -> None:
        self._loops = c_loops(_SOURCE)
        self._loops.prepare.restype = ctypes.c_void_p
        row, column = pattern.rows_columns
        template = spmatrix(1.0, row, column, (pattern.size, pattern.size))
        self._order = np.array(amd.order(template, uplo="L"), np.int32).ravel()
        ends = np.argsort(self._order)[np.stack([row, column])]
        low, high = np.sort(ends, axis=0).astype(np.int32)
        made = self._loops.prepare(pattern.size, len(row), high.ctypes, low.ctypes)
        self._factors = ctypes.c_void_p(made)
        weakref.finalize(self, self._loops.discard, self._factors)
        entries = np.stack(list(values))
        if self._loops.factorise(self._factors, len(entries), entries.ctypes):
            raise RuntimeError(
                "a level's stiffness is not positive definite: an element is inverted or the"
                " contrast is too high"
            )

    def _solve(self, vectors: Array, transposed: int) -> Array:
        source = np.ascontiguousarray(vectors)
        result, columns = np.empty_like(source), source.shape[2]
        self._loops.solve(
            self._factors, self._order.ctypes, source.ctypes, result.ctypes, columns, transposed
        )
        return result

    def forward(self, vectors: Array) -> Array:
        """L_k⁻¹ P v_k for each k and column, shape (matrices, size, columns)."""
        return self._solve(vectors, 0)

    def backward(self, vectors: Array) -> Array:
        """Pᵀ L_k⁻ᵀ v_k for each k and column, shape (matrices, size, columns)."""
        return self._solve(vectors, 1)
