"""Data of the examination of boxes, for the compiled kernel and its twin alike."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.remainder import Remainder


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
        parts = [] if self.forced is None else [self.forced]
        if self.started:
            t = time[self.node][:, None]
            wave = np.exp(self.rate[0, self.box_of_row] * t)
            parts.insert(0, np.stack([wave, t * wave, t * t * wave], 1))
        return np.stack(parts, 1)

    @cached_property
    def box_of_row(self) -> Array:
        """Box of each row, shape (R,)."""
        return np.repeat(np.arange(len(self.centre)), np.diff(self.row_start))

    def tables(self) -> Array:
        """Factors of waves in values, gradients and Hessians, shape (B, m, 6 P n, q).

        Along the third axis are all parts, orders of the waves and modes, each with its real and
        its imaginary part.
        """
        rate, C, d = self.rate[..., None, :, None], self.share, self.centre.shape[1]
        out = np.zeros((*C.shape[1:3], 3, *C.shape[3:], len(C)), complex)  # (B, P, 3, n, m, q)
        out[:, :, 0] = np.moveaxis(C, 0, -1)
        for i in range(d):
            out[:, :, 1, ..., 1 + i] = C[0] * rate[1 + i]
        for a, (row, column) in enumerate(zip(*np.triu_indices(d), strict=True), 1 + d):
            i, j = int(row), int(column)
            x, y = rate[1 + i], rate[1 + j]
            out[:, :, 1, ..., a] = C[1 + i] * y + C[1 + j] * x + C[0] * rate[a]
            out[:, :, 2, ..., a] = C[0] * x * y
        both = 2 * np.stack([out.real, -out.imag], 4)  # (B, P, 3, n, 2, m, q)
        flat = both.reshape(len(out), -1, *out.shape[-2:])
        return np.ascontiguousarray(flat.swapaxes(1, 2))

    def examined(self, problems: Problems) -> tuple[Array, Array, Array]:
        """Codes, side × output at the centres and upper bounds of all items; see `kernel`."""
        from alphacut.frame.certificate.kernel import examine  # Numba takes time to import

        over, d = problems.remainder, self.centre.shape[1]
        free = self.share[0, :, 0].swapaxes(1, 2)  # (B, m, n)
        shares, rates = (
            _in_planes(x) for x in (free.swapaxes(1, 2), self.rate[1 : 1 + d].swapaxes(0, 1))
        )
        flat = [x.reshape(d**order, -1) for order, x in enumerate(over.share)]
        bounds = (over.tensor, over.margin, over.rate[2].reshape(d * d, -1))
        bounds += (over.rate[3].reshape(d**3, -1), flat[0][0], *flat[1:])
        wave = np.ascontiguousarray(self.waves(problems.time)).reshape(len(self.node), -1)
        outcome: tuple[Array, Array, Array] = examine(
            (self.row_start, self.item_start, self.node, self.column),
            (self.centre, self.radius, self.edges, self.tables(), shares, rates),
            wave.view(float),
            problems.time,
            tuple(np.ascontiguousarray(x, float) for x in bounds),
            (problems.best, problems.point, problems.jets),
            problems.gap,
            self.forced is None,
        )
        return outcome


def _in_planes(x: Array) -> Array:
    """Complex numbers as pairs of reals along a last axis."""
    return np.ascontiguousarray(x).view(float).reshape(*x.shape, 2)
