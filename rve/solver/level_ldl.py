"""Factors of saddle-point matrices of one pattern, displacements and pressures (CHOLMOD).

A pressure is eliminated after all displacements of its triangle. Its pivot is then negative and of
the size of the triangle's flexibility, however small the compressibility: L stays bounded and is a
smooth function of the entries, as without pressures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from cvxopt import cholmod, matrix, spmatrix

from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.solver.krylov import ConvergenceError
from alphacut.rve.solver.level_stiffness import LevelPattern
from alphacut.stochastic.theta.truncated_normal import Array

_SOLVE_L, _SOLVE_LT, _SOLVE_D, _PERMUTE = 4, 5, 6, 7


@contextmanager
def _options(**options: int) -> Iterator[None]:
    before = dict(cholmod.options)
    cholmod.options.update(options)
    try:
        yield
    finally:
        cholmod.options.clear()
        cholmod.options.update(before)


class LevelLDL:
    """P S_k Pᵀ = L_k J L_kᵀ with a diagonal J of signs, the same for all k.

    Args:
        unknowns: Displacements of each triangle, −1 where fixed, shape (m, 12).
        triangles: Those with a pressure, numbered after the displacements in this order.
        elements: Of each matrix: element matrices, shape (m, 13, 13), the pressure last.

    Raises:
        ConvergenceError: A pivot has the wrong sign.
    """

    def __init__(self, unknowns: Integers, triangles: Integers, elements: Sequence[Array]) -> None:
        displacements = int(unknowns.max()) + 1
        pressures = np.full((len(unknowns), 1), -1)
        pressures[triangles, 0] = displacements + np.arange(len(triangles))
        pattern = LevelPattern(np.concatenate([unknowns, pressures], axis=1))
        wanted = _order(LevelPattern(unknowns), elements[0][:, :12, :12], unknowns[triangles])
        row, column = pattern.rows_columns
        template = spmatrix(1.0, row, column, (pattern.size, pattern.size))
        self._factors = []
        with _options(supernodal=0, nmethods=1):
            for one in elements:
                template.V = matrix(pattern.values(one))
                self._factors.append(cholmod.symbolic(template, p=matrix(wanted.tolist())))
                cholmod.numeric(template, self._factors[-1])
        self._order = _permutation(self._factors[0], pattern.size)
        inverse = [self._inverse_pivots(factor) for factor in self._factors]
        self._root = np.sqrt(np.abs(inverse))[:, :, None]
        self.signs = np.where(self._order < displacements, 1.0, -1.0)[:, None]
        if any((np.sign(one) != self.signs[:, 0]).any() for one in inverse):
            raise ConvergenceError(
                "a level's factors have a pivot of the wrong sign: an element is inverted or the"
                " contrast is too high"
            )

    def _inverse_pivots(self, factor: object) -> Array:
        ones = matrix(1.0, (self._order.size, 1))
        cholmod.solve(factor, ones, sys=_SOLVE_D)
        return np.asarray(ones).ravel()

    def _apply(self, vectors: Array, system: int) -> Array:
        result = np.empty_like(vectors)
        if not vectors.size:  # no column is left for this rank
            return result
        for factor, source, target in zip(self._factors, vectors, result, strict=True):
            columns = matrix(source)
            cholmod.solve(factor, columns, sys=system)
            target[:] = np.asarray(columns)
        return result

    def forward(self, vectors: Array) -> Array:
        """J L_k⁻¹ P v_k for each k and column, shape (matrices, size, columns)."""
        return np.asarray(self.signs * self._root * self._apply(vectors[:, self._order], _SOLVE_L))

    def backward(self, vectors: Array) -> Array:
        """Pᵀ L_k⁻ᵀ v_k for each k and column, shape (matrices, size, columns)."""
        result = np.empty_like(vectors)
        result[:, self._order] = self._apply(self._root * vectors, _SOLVE_LT)
        return result


def _permutation(factor: object, size: int) -> Integers:
    """The fill-reducing order of a factor."""
    place = matrix(np.arange(size, dtype=float))
    cholmod.solve(factor, place, sys=_PERMUTE)
    return np.asarray(place).ravel().astype(np.int64)


def _order(pattern: LevelPattern, elements: Array, unknowns: Integers) -> Integers:
    """Fill-reducing order of the displacements, each pressure after those of its triangle.

    Args:
        pattern: Of the displacements.
        elements: Positive definite element matrices.
        unknowns: Displacements beside each pressure, −1 where fixed.
    """
    row, column = pattern.rows_columns
    template = spmatrix(matrix(pattern.values(elements)), row, column, (pattern.size, pattern.size))
    factor = cholmod.symbolic(template)
    cholmod.numeric(template, factor)
    place = np.empty(pattern.size)
    place[_permutation(factor, pattern.size)] = np.arange(pattern.size)
    last = np.where(unknowns >= 0, place[unknowns], -1.0).max(axis=1)
    return np.argsort(np.concatenate([place, last + 0.5]), kind="stable")
