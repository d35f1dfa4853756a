"""Examination of boxes in NumPy: the twin of kernel.c, test by test, for all items together."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.piece import FACES, Piece, Problems

SWEEPS = 8
NEAR = 2.0
"""Radii within which the best point counts as near."""


@dataclass(frozen=True, eq=False)
class Items:
    """Quadratic Taylor models of items at the centres of their boxes, times their sides.

    Args:
        f: Values, shape (I,).
        g: Gradients, shape (I, d).
        H: Hessians, shape (I, d, d).
        r: Radii of the boxes, shape (I, d).
        third: Bounds of third derivatives, shape (I, d, d, d).
        margin: Bounds of rounding, shape (I, 1 + d).
        problem: Numbers of the problems, shape (I,).
    """

    f: Array
    g: Array
    H: Array
    r: Array
    third: Array
    margin: Array
    problem: Array

    @classmethod
    def of(cls, piece: Piece, problems: Problems) -> Items:
        """The items of a piece."""
        d, row = piece.centre.shape[1], piece.row_of_item
        output, side = piece.column // 2, 2.0 * (piece.column % 2) - 1
        J = side[:, None] * _taylor(piece, composed(piece))[row, output]
        node, m = piece.node[row], problems.third.shape[1]
        return cls(
            J[:, 0],
            J[:, 1 : 1 + d],
            _full(J, d),
            piece.radius[piece.box_of_row[row]],
            problems.third[node, output],
            problems.margin[node, output],
            node * 2 * m + piece.column,
        )

    @cached_property
    def bent(self) -> Array:
        """What the Hessian may change the gradient by, shape (I, d)."""
        return np.asarray((np.abs(self.H) * self.r[:, None]).sum(-1))

    @cached_property
    def pull(self) -> Array:
        """Twice what third derivatives may change the gradient by, shape (I, d)."""
        return np.asarray(np.einsum("nijk,nj,nk->ni", self.third, self.r, self.r))

    @cached_property
    def rest(self) -> Array:
        """Bound of what the Taylor models leave out, and of rounding, shape (I,)."""
        return np.asarray((self.pull * self.r).sum(-1) / 6 + self.margin[:, 0])

    @property
    def wander(self) -> Array:
        """Bound of what third derivatives and rounding change the gradient by, shape (I, d)."""
        return self.pull / 2 + self.margin[:, 1:]

    @property
    def steepest(self) -> Array:
        """Upper bounds without regard to signs, shape (I,)."""
        linear: Array = ((np.abs(self.g) + self.bent / 2) * self.r).sum(-1)
        return self.f + linear + self.rest

    @property
    def separable(self) -> Array:
        """Upper bounds with mixed terms of the Hessian moved to its diagonal, shape (I,)."""
        r, slope, diagonal = self.r, np.abs(self.g), np.einsum("nii->ni", self.H)
        spread = self.bent / np.where(r > 0, r, 1.0) - np.abs(diagonal)
        bend = diagonal + np.where(r > 0, spread, 0.0)
        inside = (bend < 0) & (slope < -bend * r)
        top = np.where(
            inside, -(slope**2) / np.where(inside, 2 * bend, 1.0), slope * r + 0.5 * bend * r**2
        )
        return np.asarray(self.f + top.sum(1) + self.rest)


def examine(piece: Piece, problems: Problems) -> tuple[Array, Array]:
    """Codes and side × output at the centres, as `Examine`."""
    items, box = Items.of(piece, problems), piece.box_of_row[piece.row_of_item]
    g, r, target = items.g, items.r, problems.best[items.problem] + problems.gap
    code = np.zeros(len(g), np.int32)
    open_ = items.steepest > target
    rising = (r > 0) & (np.abs(g) > items.bent + items.wander)
    edge = np.where(g > 0, piece.edges[box, 1], piece.edges[box, 0]).astype(bool)
    open_ &= ~(rising & ~edge).any(1)  # the neighbour holds higher points
    open_ &= items.separable > target
    faces = (np.where(rising, np.where(g > 0, 2, 1), 0) * 3 ** np.arange(g.shape[1])).sum(1)
    faced = open_ & (faces > 0)
    code[faced] = FACES + faces[faced]
    left = np.flatnonzero(open_ & ~faced)
    room = target - items.f - items.rest
    left = left[~stays_below(g[left], items.H[left], -r[left], r[left], room[left])]
    left = left[~_below_near_best(problems, items, left, piece.centre[box[left]])]
    weight = np.where(r > 0, r * (2 * items.wander + 0.5 * items.bent), -1.0)
    code[left] = 1 + weight[left].argmax(1)
    return code, items.f


def bounds(piece: Piece, problems: Problems) -> tuple[Array, Array]:
    """Upper bounds of side × output in the boxes, shape (I,), and numbers of the problems."""
    items = Items.of(piece, problems)
    return items.separable, items.problem


def composed(piece: Piece) -> Array:
    """G: what waves carry into values, gradients and Hessians, (B, P, 3, n, m, q), complex."""
    rate, C = piece.rate[..., None, :, None], piece.share
    d = piece.centre.shape[1]
    out = np.zeros((*C.shape[1:3], 3, *C.shape[3:], len(C)), complex)
    out[:, :, 0] = np.moveaxis(C, 0, -1)
    for i in range(d):
        out[:, :, 1, ..., 1 + i] = C[0] * rate[1 + i]
    for a, (row, column) in enumerate(zip(*np.triu_indices(d), strict=True), 1 + d):
        i, j = int(row), int(column)
        x, y = rate[1 + i], rate[1 + j]
        out[:, :, 1, ..., a] = C[1 + i] * y + C[1 + j] * x + C[0] * rate[a]
        out[:, :, 2, ..., a] = C[0] * x * y
    return out


def _taylor(piece: Piece, tables: Array) -> Array:
    """Values, gradients and Hessians (upper triangle) of all outputs, (R, m, q)."""
    *_, m, q = tables.shape
    flat = tables.reshape(len(tables), -1, m * q)
    wave = piece.waves.reshape(len(piece.waves), -1)
    out = np.empty((len(wave), m * q))
    for box, table in enumerate(flat):
        rows = slice(piece.row_start[box], piece.row_start[box + 1])
        out[rows] = 2 * (wave[rows].real @ table.real - wave[rows].imag @ table.imag)
    return out.reshape(-1, m, q)


def _full(J: Array, d: int) -> Array:
    """Hessians (…, d, d) from their upper triangles."""
    place = np.empty((d, d), int)
    row, column = np.triu_indices(d)
    place[row, column] = place[column, row] = 1 + d + np.arange(len(row))
    return J[..., place]


def _below_near_best(problems: Problems, items: Items, which: Array, centre: Array) -> Array:
    """Mask of items whose Taylor model at the near best point allows no more than the gap."""
    d, r, problem = centre.shape[1], items.r[which], items.problem[which]
    low, high = (centre + sign * r - problems.point[problem] for sign in (-1, 1))
    off = np.maximum(np.maximum(low, -high), 0)
    near = np.flatnonzero((off <= NEAR * r + 1e-12).all(1))
    side = 2.0 * (problem[near, None] % 2) - 1
    jet = side * problems.jets[problem[near]]
    span = np.maximum(np.maximum(np.abs(low), np.abs(high)), 1e-9)[near]
    # the cubic remainder is at most Σ bend_i x_i² / 6
    bend = np.einsum("nijk,nj,nk->ni", items.third[which[near]], span, span) / span
    softer = _full(jet, d) + bend[..., None] / 3 * np.eye(d)
    excess = jet[:, 0] - problems.best[problem[near]]
    allowed = problems.gap - items.margin[which[near], 0] - excess
    below = np.zeros(len(r), bool)
    below[near] = stays_below(jet[:, 1 : 1 + d], softer, low[near], high[near], allowed)
    return below


def stays_below(g: Array, H: Array, low: Array, high: Array, allowed: Array) -> Array:
    """Mask of quadratics g·x + x·H·x/2 that are proved to stay below `allowed` (N,) on boxes.

    Above the quadratic lies the same plus Σ s_i (x_i − low_i)(high_i − x_i)/2 (αBB: Adjiman and
    Floudas), above that, where it is concave, each of its tangents.
    """
    d, width = g.shape[1], high - low
    wide = width > 0
    safe = np.where(wide, width, 1.0)
    outward = ((high <= 0) & (g > 0)) | ((low >= 0) & (g < 0))
    shift = np.where(wide, allowed[:, None] / (d * safe**2), 0.0)
    shift += np.where(wide & outward, np.abs(g) / safe, 0.0)
    pair = wide[:, :, None] & wide[:, None, :]
    bend = np.where(pair, shift[:, :, None] * np.eye(d) - H, np.eye(d))
    open_ = np.flatnonzero(
        (allowed > 0)
        & _positive(bend, np.where(wide, shift + np.abs(np.einsum("nii->ni", H)), 0.0))
    )
    below = np.zeros(len(g), bool)
    g, H, low, high, shift, wide = (x[open_] for x in (g, H, low, high, shift, wide))
    x = np.clip(0.0, low, high)
    for _ in range(SWEEPS):
        curved = np.einsum("nij,nj->ni", H, x)
        value = ((g + curved / 2) * x + shift / 2 * (x - low) * (high - x)).sum(1)
        slope = g + curved + shift / 2 * (low + high - 2 * x)
        tangent = value + np.where(wide, np.maximum(slope * (high - x), slope * (low - x)), 0).sum(
            1
        )
        below[open_[tangent <= allowed[open_]]] = True
        rest = (tangent > allowed[open_]) & (value <= allowed[open_])
        open_ = open_[rest]
        g, H, low, high, shift, wide, x, slope = (
            a[rest] for a in (g, H, low, high, shift, wide, x, slope)
        )
        for i in range(d):
            bent = np.where(wide[:, i], shift[:, i] - H[:, i, i], 1.0)
            moved = np.clip(x[:, i] + slope[:, i] / bent, low[:, i], high[:, i]) - x[:, i]
            moved = np.where(wide[:, i], moved, 0.0)
            x[:, i] += moved
            slope += H[:, i] * moved[:, None]
            slope[:, i] -= shift[:, i] * moved
    return below


def _positive(A: Array, size: Array) -> Array:
    """Mask of symmetric matrices (N, d, d) with positive pivots, beside `size` (N, d)."""
    d = A.shape[1]
    L, ok = np.zeros_like(A), np.ones(len(A), bool)
    for i in range(d):
        for j in range(i + 1):
            total = A[:, i, j] - (L[:, i, :j] * L[:, j, :j]).sum(1)
            if i == j:
                ok &= total > 1e-12 * size[:, i]
                L[:, i, i] = np.sqrt(np.where(ok, total, 1.0))
            else:
                L[:, i, j] = total / L[:, j, j]
    return ok
