"""Planar stiffness matrices of the cell on many θ-levels at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from cvxopt import amd, spmatrix
from numpy.typing import NDArray

from alphacut.rve.mesh.triangulation import Integers
from alphacut.rve.solver.c_loops import WEDGES, c_loops
from alphacut.stochastic.theta.truncated_normal import Array

WHOLE = 1200  # nodes that are not dissected
# Strang's rule of degree 2, weights 1/6
_CORNERS = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])


def gradients(points: Array) -> Array:
    """Derivatives of the shape functions of six nodes at points (q, 2), shape (q, 2, 6)."""
    x, y = points.T
    barycentric = np.array([1 - x - y, x, y])
    slopes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    corner = (4 * barycentric.T - 1)[:, None, :] * slopes.T
    middle = [
        4 * (np.outer(barycentric[i], slopes[j]) + np.outer(barycentric[j], slopes[i]))
        for i, j in ((0, 1), (0, 2), (1, 2))
    ]
    return np.concatenate([corner, np.stack(middle, axis=-1)], axis=-1)


def element_stiffness(positions: Array, stiffness: Array) -> Array:
    """Stiffness matrices of triangles of six nodes, straight or curved.

    Args:
        positions: Nodes of each triangle, shape (m, 6, 2).
        stiffness: Voigt stiffness of each, shape (m, 3, 3).

    Returns:
        Shape (m, 12, 12), the two components of a node side by side.
    """
    table, found = gradients(_CORNERS), np.empty((len(positions), 12, 12))
    c_loops(WEDGES).triangle_stiffness(
        len(positions), table.ctypes, positions.ctypes, stiffness.ctypes, found.ctypes
    )
    return found


def with_components(unknown: Integers) -> Integers:
    """Two degrees of freedom for each unknown of a triangle, −1 where fixed, (m, 2·nodes)."""
    pairs = np.where(unknown[:, :, None] >= 0, 2 * unknown[:, :, None] + np.arange(2), -1)
    return pairs.reshape(len(unknown), -1)


@dataclass(frozen=True)
class LevelPattern:
    """Lower triangle of a planar matrix: where the entries of every element matrix go.

    Args:
        unknowns: Unknown of every local degree of freedom, −1 where there is none, shape (m, k).
        middles: Where the elements lie in the plane, shape (m, 2), for the order.
    """

    unknowns: Integers
    middles: Array | None = None

    @cached_property
    def size(self) -> int:
        """Order of the matrix."""
        return int(self.unknowns.max()) + 1

    @cached_property
    def _entries(self) -> list[NDArray[np.int32]]:
        """Entries of the elements that make stored ones, where they begin, and rows and columns."""
        unknowns = self.unknowns.astype(np.int32)
        elements, k = unknowns.shape
        kept, starts, rows, columns = (np.empty(unknowns.size * k + 1, np.int32) for _ in range(4))
        count = c_loops(WEDGES).lower_triangle(
            elements, k, self.size, unknowns.ctypes,
            kept.ctypes, starts.ctypes, rows.ctypes, columns.ctypes,
        )  # fmt: skip
        if count < 0:
            raise MemoryError("no memory is left for the pattern of the levels")
        found = kept[: starts[count]], starts[: count + 1], rows[:count], columns[:count]
        return [one.copy() for one in found]

    @property
    def rows_columns(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Row and column of each stored entry, column by column."""
        return self._entries[2], self._entries[3]

    @cached_property
    def fill_reducing(self) -> Integers:
        """Which row comes where, so that few entries of factors are not zero.

        Unknowns 2 k and 2 k + 1, a node's displacements, stay side by side.
        """
        nodes = LevelPattern(self.unknowns[:, ::2] // 2, self.middles)
        return np.asarray(2 * nodes.dissected()[:, None] + np.arange(2)).ravel()

    def dissected(self) -> Integers:
        """Order by nested dissection: halves of the plane, then what both of them touch.

        Few unknowns have an approximate minimum degree instead, which fills less.
        """
        if self.size <= WHOLE or self.middles is None:
            row, column = (one.astype(int) for one in self.rows_columns)
            template = spmatrix(1.0, row, column, (self.size, self.size))
            return np.array(amd.order(template, uplo="L"), np.int64).ravel()
        lower = self.middles < np.median(self.middles, axis=0)
        pairs = [(self._touched(half), self._touched(~half)) for half in lower.T]
        axis = min((0, 1), key=lambda k: np.count_nonzero(pairs[k][0] & pairs[k][1]))
        between = pairs[axis][0] & pairs[axis][1]
        order = []
        for half, touched in zip((lower[:, axis], ~lower[:, axis]), pairs[axis], strict=True):
            own, number = np.flatnonzero(touched & ~between), np.full(self.size + 1, -1)
            number[own] = np.arange(len(own))
            part = LevelPattern(number[self.unknowns[half]], self.middles[half])
            order.append(own[part.dissected()])
        return np.concatenate([*order, np.flatnonzero(between)])

    def _touched(self, elements: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Mask of the unknowns of some elements, shape (size,)."""
        touched = np.zeros(self.size + 1, bool)
        touched[self.unknowns[elements]] = True
        return touched[:-1]

    def values(self, elements: Array, scales: Array | None = None) -> Array:
        """Stored entries from the element matrices, shape (m, k, k), times scales, shape (m,)."""
        kept, starts, rows, _ = self._entries
        elements, found = np.ascontiguousarray(elements), np.empty(len(rows))
        scales = np.ones(len(elements)) if scales is None else scales
        c_loops(WEDGES).gather(
            len(rows), kept.ctypes, starts.ctypes, elements[0].size, scales.ctypes,
            elements.ctypes, found.ctypes,
        )  # fmt: skip
        return found
