"""Data of the examination of boxes, for the compiled kernel and its twin alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.remainder import Remainder

FACES = 16
"""Codes from here on confine an item to faces: plus 3^axis, once for lower and twice for upper."""


@dataclass(frozen=True, eq=False)
class Problems:
    """Bounds to be proved, and how far third derivatives and rounding reach.

    A problem is an output at a node on a side: number node · 2 m + 2 output + (1 for upper bounds).

    Args:
        time: Nodes, shape (T,).
        remainder: Of quadratic Taylor models over the domain.
        best: Side × output at the best points so far, shape (N,).
        point: These points, shape (N, d).
        jets: Value, gradient and Hessian (upper triangle) of the outputs there, shape (N, q).
        gap: What the bounds may lie above the best values by.
    """

    time: Array
    remainder: Remainder
    best: Array
    point: Array
    jets: Array
    gap: float

    @cached_property
    def third(self) -> Array:
        """Bounds of third derivatives along triples of rising axes, shape (m, triples, T)."""
        tensor = self.remainder.tensor
        axes = np.array(list(combinations_with_replacement(range(tensor.shape[-1]), 3))).T
        return np.ascontiguousarray(np.moveaxis(tensor[:, :, *axes], 0, -1))


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
        jets: Eigenvalues, n, and shares of the motion's P parts, P n m, with derivatives, shape (B,
            q, K).
        modes: How many, n.
        started: Whether the first part is the free motion.
        forced: Waves under a load, the last part, derived by the eigenvalue, shape (R, 3, n).
    """

    centre: Array
    radius: Array
    edges: Array
    row_start: Array
    item_start: Array
    node: Array
    column: Array
    jets: Array
    modes: int
    started: bool
    forced: Array | None

    @property
    def rate(self) -> Array:
        """Eigenvalues with derivatives, shape (q, B, n)."""
        return self.jets[..., : self.modes].swapaxes(0, 1)

    @property
    def share(self) -> Array:
        """Shares with derivatives, shape (q, B, P, n, m)."""
        own, parts = self.jets.swapaxes(0, 1), self.started + (self.forced is not None)
        return own[..., self.modes :].reshape(*own.shape[:2], parts, self.modes, -1)

    def waves(self, time: Array) -> Array:
        """Waves of all parts at the rows, with nodes (T,), shape (R, P, 3, n)."""
        found = [] if self.forced is None else [self.forced]
        if self.started:
            t = time[self.node][:, None]
            wave = np.exp(self.rate[0, self.box_of_row] * t)
            found.insert(0, np.stack([wave, t * wave, t * t * wave], 1))
        return np.stack(found, 1)

    @cached_property
    def row_of_item(self) -> Array:
        """Row of each item, shape (I,)."""
        return np.repeat(np.arange(len(self.node)), np.diff(self.item_start))

    @cached_property
    def box_of_row(self) -> Array:
        """Box of each row, shape (R,)."""
        return np.repeat(np.arange(len(self.centre)), np.diff(self.row_start))
