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
TURN = 4.0
"""Radians within which modes are turned."""


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
        J = side[:, None] * _taylor(piece, problems)[row, output]
        node, m, remainder = piece.node[row], piece.share.shape[-1], problems.remainder
        return cls(
            J[:, 0],
            J[:, 1 : 1 + d],
            _full(J, d),
            piece.radius[piece.box_of_row[row]],
            remainder.tensor[node, output],
            remainder.margin[node, output],
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
    def separable(self) -> Array:
        """Upper bounds with mixed terms of the Hessian moved to its diagonal, shape (I,)."""
        return self.f + separable(self.g, self.H, self.r) + self.rest


def examine(piece: Piece, problems: Problems) -> tuple[Array, Array]:
    """Codes and side × output at the centres, as `Examine`."""
    items, box = Items.of(piece, problems), piece.box_of_row[piece.row_of_item]
    g, r, target = items.g, items.r, problems.best[items.problem] + problems.gap
    code = np.zeros(len(g), np.int32)
    rising = (r > 0) & (np.abs(g) > items.bent + items.wander)
    edge = np.where(g > 0, piece.edges[box, 1], piece.edges[box, 0]).astype(bool)
    open_ = ~(rising & ~edge).any(1)  # the neighbour holds higher points
    open_ &= items.separable > target
    if piece.forced is None:
        left = np.flatnonzero(open_)
        open_[left] = ~_below_turning(piece, problems, items, left)
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


def _taylor(piece: Piece, problems: Problems) -> Array:
    """Values, gradients and Hessians (upper triangle) of all outputs, (R, m, q)."""
    tables, wave = composed(piece), piece.waves(problems.time).reshape(len(piece.node), -1)
    *_, m, q = tables.shape
    flat = tables.reshape(len(tables), -1, m * q)
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


def separable(g: Array, H: Array, r: Array) -> Array:
    """Upper bounds of g·x + x·H·x/2 for |x| ≤ r, mixed terms moved to the diagonal, (I,)."""
    slope, diagonal = np.abs(g), np.einsum("nii->ni", H)
    spread = (np.abs(H) * r[:, None]).sum(-1) / np.where(r > 0, r, 1.0) - np.abs(diagonal)
    bend = diagonal + np.where(r > 0, spread, 0.0)
    inside = (bend < 0) & (slope < -bend * r)
    top = np.where(
        inside, -(slope**2) / np.where(inside, 2 * bend, 1.0), slope * r + 0.5 * bend * r**2
    )
    return np.asarray(top.sum(1))


def _below_turning(piece: Piece, problems: Problems, items: Items, which: Array) -> Array:
    """Mask of items below their targets as modes A exp(i s) whose phases s = ω·x are linear.

    About the centre, with |s| ≤ S, Re A exp(i s) exceeds its quadratic Taylor model by at most
    |Im A| S³/24 + Im A S² s/8 (Chebyshev) + max(Re A, 0) S² s²/24 + |Im A| S⁵/120 + |Re A| S⁶/720.
    """
    row, column, r = piece.row_of_item[which], piece.column[which], items.r[which]
    box, t, d = piece.box_of_row[row], problems.time[piece.node[row]][:, None], r.shape[1]
    wave = piece.waves(problems.time)[row, 0, 0]
    share = piece.share[0, box, 0, :, column // 2]
    A = 2 * (2.0 * (column[:, None] % 2) - 1) * share * wave
    slope = piece.rate[1 : 1 + d, box].imag * t  # (d, I, n)
    S = np.einsum("dik,id->ik", np.abs(slope), r)
    odd, even = np.abs(A.imag), np.abs(A.real)
    rest = _left_out(piece, problems, (row, column // 2), S) * 2 * np.abs(wave)
    rest += odd * (S**3 / 24 + S**5 / 120) + even * S**6 / 720
    room = problems.best[items.problem[which]] + problems.gap - items.margin[which, 0]
    room -= items.f[which] + rest.sum(1)
    g = items.g[which] + np.einsum("ik,dik->id", A.imag * S**2 / 8, slope)
    soft = np.maximum(A.real, 0) * S**2 / 12
    H = items.H[which] + np.einsum("ik,dik,eik->ide", soft, slope, slope)
    below: Array = (separable(g, H, r) <= room) | stays_below(g, H, -r, r, room)
    return below


def _left_out(piece: Piece, problems: Problems, at: tuple[Array, Array], reach: Array) -> Array:
    """What C exp((λ − λ₀ − i ω·x) t) exp(i s) leaves out with C = C₀, λ = λ₀ + i ω·x, (I, n).

    It is a sixth of a bound of the third derivative of their difference, by Leibniz' rule, at `at`:
    rows and outputs. Beyond `TURN` it is 1e30, which closes nothing.
    """
    (row, output), over, r = at, problems.remainder, piece.radius
    box, t = piece.box_of_row[row], problems.time[piece.node[row]][:, None]
    e2, e3 = (_along(over.rate[k], r, k)[box] * t for k in (2, 3))
    c1, c2, c3 = (_along(over.share[k], r, k)[box, :, output] for k in (1, 2, 3))
    c0 = over.share[0].T[output]
    e1 = np.einsum("dbn,bd->bn", np.abs(piece.rate[1 : 1 + r.shape[1]].real), r)[box] * t
    z0, z1 = e1 + e2 / 2, e1 + e2
    swell, curved = 1 + z0 + z0**2, e2 + z1**2  # the first above exp(z0) up to 1.7
    p0, p1, p2 = c1 + c0 * z0 * swell, c1 + c0 * z1, c2 + 2 * c1 * z1 + c0 * curved
    p3 = c3 + 3 * c2 * z1 + 3 * c1 * curved + c0 * (e3 + 3 * e2 * z1 + z1**3)
    third = reach**3 * p0 + (3 * reach**2 * p1 + 3 * reach * p2 + p3) * swell
    return np.where((reach < TURN) & (z0 < 1.7), third / 6, 1e30)


def _along(bound: Array, r: Array, order: int) -> Array:
    """A tensor of bounds (d, …, d, …) times radii (B, d) along `order` axes, shape (B, …)."""
    out = np.broadcast_to(bound, (len(r), *bound.shape))
    for _ in range(order):
        out = np.einsum("bi...,bi->b...", out, r)
    return out


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
