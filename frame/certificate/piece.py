"""Data of the examination of boxes, for the compiled kernel and its twin alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.frame.calculus.jet import Array

FACES = 16
"""Codes from here on confine an item to faces: plus 3^axis, once for lower and twice for upper."""


@dataclass(frozen=True, eq=False)
class Problems:
    """Bounds to be proved, and how far third derivatives and rounding reach.

    A problem is an output at a node on a side: number node · 2 m + 2 output + (1 for upper bounds).

    Args:
        third: Bounds of |∂³ output|, shape (T, m, d, d, d).
        margin: Bounds of rounding in values and slopes, shape (T, m, 1 + d).
        best: Side × output at the best points so far, shape (N,).
        point: These points, shape (N, d).
        jets: Value, gradient and Hessian (upper triangle) of the outputs there, shape (N, q).
        gap: What the bounds may lie above the best values by.
    """

    third: Array
    margin: Array
    best: Array
    point: Array
    jets: Array
    gap: float


@dataclass(frozen=True, eq=False)
class Piece:
    """Boxes with their rows (a box at a node) and items (an output and side of a row).

    Args:
        centre: Shape (B, d).
        radius: Shape (B, d).
        edges: Which lower and upper faces lie on those of the domain, shape (B, 2, d).
        row_start: First row of each box, and the end, shape (B + 1,).
        item_start: First item of each row, and the end, shape (R + 1,).
        node: Node of each row, shape (R,).
        column: 2 output + (1 for upper bounds) of each item, rising within a row, shape (I,).
        rate: Eigenvalues with derivatives, shape (q, B, n).
        share: Shares of P parts of the motion with derivatives, shape (q, B, P, n, m).
        waves: Shape (R, P, 3, n).
    """

    centre: Array
    radius: Array
    edges: Array
    row_start: Array
    item_start: Array
    node: Array
    column: Array
    rate: Array
    share: Array
    waves: Array

    @cached_property
    def row_of_item(self) -> Array:
        """Row of each item, shape (I,)."""
        return np.repeat(np.arange(len(self.node)), np.diff(self.item_start))

    @cached_property
    def box_of_row(self) -> Array:
        """Box of each row, shape (R,)."""
        return np.repeat(np.arange(len(self.centre)), np.diff(self.row_start))
