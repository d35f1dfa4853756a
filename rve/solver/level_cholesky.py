"""Cholesky factors of many matrices of one pattern, as triangles (CHOLMOD).

One fill-reducing order serves all matrices, so that L is a smooth function of the entries:
neighbouring levels have neighbouring L.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from cvxopt import cholmod, matrix, spmatrix

from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.solver.level_stiffness import LevelPattern
from alphacut.stochastic.theta.truncated_normal import Array

_SOLVE_L, _SOLVE_LT, _PERMUTE = 4, 5, 7
cholmod.options["supernodal"] = 2  # always L Lᵀ, never L D Lᵀ


def permutation(factor: object, size: int) -> Integers:
    """The fill-reducing order of a factor."""
    place = matrix(np.arange(size, dtype=float))
    cholmod.solve(factor, place, sys=_PERMUTE)
    return np.asarray(place).ravel().astype(np.int64)


class LevelFactors:
    """Factors of many matrices of one pattern."""

    _factors: list[object]

    def _apply(self, vectors: Array, system: int) -> Array:
        result = np.empty_like(vectors)
        if not vectors.size:  # no column is left for this rank
            return result
        for factor, source, target in zip(self._factors, vectors, result, strict=True):
            columns = matrix(source)
            cholmod.solve(factor, columns, sys=system)
            target[:] = np.asarray(columns)
        return result


class LevelCholesky(LevelFactors):
    """P A_k Pᵀ = L_k L_kᵀ for matrices A_k of one pattern.

    Args:
        pattern: Where the entries lie.
        values: Stored entries of each matrix, one array for each.

    Raises:
        RuntimeError: A matrix is not positive definite.
    """

    def __init__(self, pattern: LevelPattern, values: Iterable[Array]) -> None:
        row, column = pattern.rows_columns
        template = spmatrix(1.0, row, column, (pattern.size, pattern.size))
        self._factors = [self._factorise(template, entries) for entries in values]
        self._order = permutation(self._factors[0], pattern.size)

    @staticmethod
    def _factorise(template: spmatrix, entries: Array) -> object:
        try:
            template.V = matrix(entries)
            factor = cholmod.symbolic(template)
            cholmod.numeric(template, factor)
        except ArithmeticError as failure:
            raise RuntimeError(
                "a level's stiffness is not positive definite: an element is inverted or the"
                " contrast is too high"
            ) from failure
        return factor

    def forward(self, vectors: Array) -> Array:
        """L_k⁻¹ P v_k for each k and column, shape (matrices, size, columns)."""
        return self._apply(vectors[:, self._order], _SOLVE_L)

    def backward(self, vectors: Array) -> Array:
        """Pᵀ L_k⁻ᵀ v_k for each k and column, shape (matrices, size, columns)."""
        result = np.empty_like(vectors)
        result[:, self._order] = self._apply(vectors, _SOLVE_LT)
        return result
