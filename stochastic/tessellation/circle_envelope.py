"""Upper envelopes of functions a cos φ + b sin φ + c over the circle, many at once.

Two such functions meet at most twice, so the envelope of k of them has at most 2k − 2 arcs. The
sweep walks around the circle: it takes the uppermost function, finds the first angle at which
another one rises above it, and looks again just beyond. With t = tan(δ/2) the difference ahead of
the current angle is a quadratic in t, so that no step needs an angle but the winner's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import FailedError


def anomaly(psi: Array, near: Array, far: Array) -> Array:
    """Hyperbolic anomaly s of points on walls at angle ψ: tanh(s/2) = √(near/far) tan(ψ/2), (m,).

    ψ is measured from the direction of the neighbour; `near` and `far` are as of `sector_area`.
    """
    psi = psi - 2 * np.pi * np.round(psi / (2 * np.pi))
    tanh = np.clip(np.sqrt(near / far) * np.tan(psi / 2), -1 + 2**-53, 1 - 2**-53)
    return np.asarray(2 * np.arctanh(tanh))


def sector_area(start: Array, end: Array, near: Array, far: Array) -> Array:
    """Area between a disc's centre and its hyperbolic wall over an arc of anomalies, shape (m,).

    The wall is 1/ρ = M cos ψ + C with M + C = 2/near and M − C = 2/far, ρ the distance from the
    disc's centre, ψ the angle from the direction of the neighbour: `near` is twice the distance of
    its nearest point from the centre, `far` the same from the neighbour's centre.
    """
    middle, half = (start + end) / 2, (end - start) / 2
    M_plus_C, M_minus_C = 2 / near, 2 / far
    M = (M_plus_C + M_minus_C) / 2
    # cosh(middle) sinh(half) − half, without cancellation
    sinh_term = 2 * np.sinh(middle / 2) ** 2 * np.sinh(half) + _sinh_less_argument(half)
    return np.asarray((M * sinh_term + M_minus_C * half) / (M_plus_C * M_minus_C) ** 1.5)


def _sinh_less_argument(x: Array) -> Array:
    """Return sinh x − x to full relative precision, by its series for |x| < 1."""
    square, series = x * x, np.ones_like(x)
    for k in range(9, 0, -1):
        series = 1 + series * square / ((2 * k + 2) * (2 * k + 3))
    return np.where(np.abs(x) < 1, x * square / 6 * series, np.sinh(x) - x)


# the sweep goes this far past a crossing before it looks which function is uppermost: shorter arcs
# are left out
STRIDE = 1e-13
MAX_TABLE = 60_000  # entries of a table of functions: what the cache holds


@dataclass(frozen=True)
class Arcs:
    """Arcs of envelopes from φ = `start` to `end`, ordered by their `owner` and φ, (m,) each.

    `owner` is the envelope that each belongs to, `function` the index of the function that is
    uppermost there, counted through all envelopes.
    """

    owner: Ints
    function: Ints
    start: Array
    end: Array


def upper_envelopes(a: Array, b: Array, c: Array, counts: Ints) -> Arcs:
    """Arcs of the upper envelopes of groups of functions a cos φ + b sin φ + c.

    Args:
        a: Coefficients of cos φ, shape (k,), the groups one after the other; b and c likewise.
        b: Coefficients of sin φ.
        c: Constants.
        counts: Functions in each group, shape (n,), sum k; a group of none has no arcs.
    """
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.intp)
    pending = np.argsort(counts, kind="stable")
    pending = pending[counts[pending] > 0]
    no_rows, no_angles = np.zeros(0, np.intp), np.zeros(0)
    parts: list[tuple[Ints, Ints, Array, Array]] = [(no_rows, no_rows, no_angles, no_angles)]
    while len(pending):
        # groups of like size share one padded table, small enough for the cache
        width = int(counts[pending[: max(1, len(pending) // 64)]][-1])
        width = max(width, int(counts[pending[0]]) + 2)
        n_fitting = int(np.searchsorted(counts[pending], width, side="right"))
        n_groups = min(n_fitting, max(1, MAX_TABLE // width))
        group, pending = pending[:n_groups], pending[n_groups:]
        columns = np.arange(counts[group].max())
        table = first[group, None] + np.minimum(columns, counts[group, None] - 1)  # last repeated
        parts.append(_sweep(a[table], b[table], c[table], table, group))
    owner, function, start, end = map(np.concatenate, zip(*parts, strict=True))
    order = np.lexsort((start, owner))
    return Arcs(owner[order], function[order], start[order], end[order])


def _sweep(
    a: Array, b: Array, c: Array, table: Ints, group: Ints
) -> tuple[Ints, Ints, Array, Array]:
    """Arcs of n upper envelopes by one sweep around the circle, from functions in tables (n, w)."""
    row: Ints = np.arange(len(a), dtype=np.intp)
    highest = np.argmax(np.hypot(a, b) + c, axis=1)  # its maximum is on the envelope
    phi = np.arctan2(b[row, highest], a[row, highest])
    open_rows, limit = row, phi + 2 * np.pi
    crossings: list[tuple[Ints, Ints, Array]] = []  # row, function that becomes uppermost, angle
    for step in range(4 * a.shape[1] + 16):
        after = phi + STRIDE if step else phi
        uppermost, angle_ahead = _next_crossing(a, b, c, after)
        crossings.append((open_rows, uppermost, phi))
        phi = after + angle_ahead
        is_open = phi < limit
        if not is_open.all():
            a, b, c, phi = a[is_open], b[is_open], c[is_open], phi[is_open]
            open_rows, limit = open_rows[is_open], limit[is_open]
        if not len(open_rows):
            break
    else:
        raise FailedError("an envelope did not close after four times as many steps as functions")
    row, column, start = map(np.concatenate, zip(*crossings, strict=True))
    order = np.argsort(row, kind="stable")
    row, start = row[order], start[order]
    function = table[row, column[order]]
    last = np.flatnonzero(np.append(row[1:] != row[:-1], True))  # arc of each row
    first = np.concatenate([[0], last[:-1] + 1])
    end = np.append(start[1:], 0.0)
    end[last] = start[first] + 2 * np.pi
    is_joined = (function[first] == function[last]) & (first != last)
    start[first[is_joined]] = start[last[is_joined]] - 2 * np.pi
    keep = np.ones(len(row), bool)
    keep[last[is_joined]] = False
    return group[row[keep]], function[keep], start[keep], end[keep]


def _next_crossing(a: Array, b: Array, c: Array, phi: Array) -> tuple[Ints, Array]:
    """Uppermost function (n,) of each row at angles φ (n,), and the angle to its next crossing."""
    # The difference g ≤ 0 of another function to the uppermost one has at φ the value −h, the slope
    # q, the oscillating part p and the constant d. Ahead by δ, with t = tan(δ/2), it is zero where
    # (d − p) t² + 2 q t − h = 0, at the root where it rises; the largest 1/t is the nearest
    # crossing
    row = np.arange(len(a))
    cos, sin = np.cos(phi)[:, None], np.sin(phi)[:, None]
    wave = a * cos + b * sin
    slope = b * cos - a * sin
    value, scale = wave + c, np.abs(a) + np.abs(b)
    top = np.argmax(value, axis=1)
    round_off = 2e-15 * (scale + scale[row, top][:, None])
    is_top = value >= value[row, top][:, None] - round_off
    # of those that are uppermost but for round-off, the one that rises most
    uppermost = np.argmax(np.where(is_top, slope, -np.inf), axis=1)
    p = wave - wave[row, uppermost][:, None]
    q = slope - slope[row, uppermost][:, None]
    d = c - c[row, uppermost][:, None]
    h = np.abs(np.minimum(p + d, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(q**2 + (d - p) * h)  # nan: the two never meet
        inverse_t = np.where(q >= 0, (q + root) / h, (d - p) / (root - q))
    is_tangent = (h == 0) & (q == 0)
    inverse_t[is_tangent] = np.where((d - p)[is_tangent] > 0, np.inf, -np.inf)
    is_equal = np.abs(d - p) + np.abs(q) + h <= 1e-14 * scale  # the same function twice
    inverse_t[np.isnan(inverse_t) | is_equal] = -np.inf
    return uppermost, 2 * np.arctan2(1.0, inverse_t.max(axis=1))
