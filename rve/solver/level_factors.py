"""Factors of many symmetric matrices of one pattern, as triangles: P A_k Pᵀ = L_k J L_kᵀ.

One fill-reducing order serves all matrices, so that L is a smooth function of the entries:
neighbouring levels have neighbouring L. Of one pattern the matrices are treated side by side, eight
at a time, by the loops of `level_factors.c`. J has the signs of the pivots, 1 without pressures.

A pressure is eliminated after all displacements of its triangle. Its pivot is then negative and of
the size of the triangle's flexibility, however small the compressibility: L stays bounded and is a
smooth function of the entries, as without pressures.
"""

from __future__ import annotations

import ctypes
import weakref
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.solver.c_loops import c_loops
from alphacut.rve.solver.krylov import ConvergenceError
from alphacut.rve.solver.level_stiffness import LevelPattern
from alphacut.stochastic.theta.truncated_normal import Array

_SOURCE = Path(__file__).with_name("level_factors.c")


class LevelFactors:
    """The factors L_k of matrices A_k of one pattern.

    Args:
        pattern: Where the entries lie.
        values: Stored entries of each matrix, one array for each.
        order: Which row comes where, shape (size,); None: a fill-reducing one.
        pressures: How many rows at the end have negative pivots.

    Raises:
        ConvergenceError: A pivot has the wrong sign.
    """

    def __init__(
        self,
        pattern: LevelPattern,
        values: Iterable[Array],
        order: Integers | None = None,
        pressures: int = 0,
    ) -> None:
        self._loops = c_loops(_SOURCE)
        self._loops.prepare.restype = ctypes.c_void_p
        self._order = np.asarray(pattern.fill_reducing if order is None else order, np.int32)
        self._signs = np.where(self._order < pattern.size - pressures, 1.0, -1.0)
        place = np.empty_like(self._order)
        place[self._order] = np.arange(pattern.size)
        row, column = (place[ends] for ends in pattern.rows_columns)
        low, high = np.minimum(row, column), np.maximum(row, column)
        made = self._loops.prepare(pattern.size, len(low), high.ctypes, low.ctypes)
        self._factors = ctypes.c_void_p(made)
        weakref.finalize(self, self._loops.discard, self._factors)
        entries = np.stack(list(values))
        if self._loops.factorise(self._factors, len(entries), entries.ctypes, self._signs.ctypes):
            raise ConvergenceError(
                "a level's factors have a pivot of the wrong sign: an element is inverted or the"
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
        """J L_k⁻¹ P v_k for each k and column, shape (matrices, size, columns)."""
        found = self._solve(vectors, 0)
        found[:, self._signs < 0] *= -1
        return found

    def backward(self, vectors: Array) -> Array:
        """Pᵀ L_k⁻ᵀ v_k for each k and column, shape (matrices, size, columns)."""
        return self._solve(vectors, 1)


def saddle_factors(
    level: LevelPattern, triangles: Integers, elements: Iterable[Array]
) -> LevelFactors:
    """Factors of saddle-point matrices, of displacements and then pressures.

    Args:
        level: Of the displacements.
        triangles: Those with a pressure, numbered after the displacements in this order.
        elements: Of each matrix: element matrices, shape (m, 13, 13), the pressure last.

    Raises:
        ConvergenceError: A pivot has the wrong sign.
    """
    pressures = np.full((len(level.unknowns), 1), -1)
    pressures[triangles, 0] = level.size + np.arange(len(triangles))
    pattern = LevelPattern(np.concatenate([level.unknowns, pressures], axis=1))
    place = np.argsort(level.fill_reducing)
    beside = level.unknowns[triangles]
    last = np.where(beside >= 0, place[beside], -1).max(axis=1)  # of a triangle's displacements
    order = np.argsort(np.concatenate([place, last + 0.5]), kind="stable")
    return LevelFactors(pattern, map(pattern.values, elements), order, len(triangles))
