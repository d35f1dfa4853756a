"""Upper envelopes of functions a cos φ + b sin φ + c over the circle, many at once.

Two such functions meet at most twice, so the envelope of k of them has at most 2k − 2 arcs. The
sweep walks around the circle: it takes the uppermost function, finds the first angle at which
another one rises above it, and looks again just beyond. With t = tan(δ/2) the difference ahead of
the current angle is a quadratic in t, so that no step needs an angle but the winner's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import FailedError


def anomaly(psi: Array, near: Array, far: Array) -> Array:
    """Return the hyperbolic anomaly s of the angle ψ: tanh(s/2) = √(near/far) tan(ψ/2), shape (m,).

    Args:
        psi: Angle from the direction of the neighbour, shape (m,), brought to [−π, π] here.
        near: d + Δ, twice the least distance of the wall from the centre, shape (m,).
        far: d − Δ, shape (m,).
    """
    psi = psi - 2 * np.pi * np.round(psi / (2 * np.pi))
    return np.asarray(
        2 * np.arctanh(np.clip(np.sqrt(near / far) * np.tan(psi / 2), -1 + 2**-53, 1 - 2**-53))
    )


def sector_area(start: Array, end: Array, near: Array, far: Array) -> Array:
    """Return the area between centre and hyperbolic wall from anomaly `start` to `end`, (m,).

    Args:
        start: Anomaly at the beginning of the arc, shape (m,).
        end: Anomaly at its end, shape (m,).
        near: d + Δ, shape (m,).
        far: d − Δ, shape (m,).
    """
    middle, half = (start + end) / 2, (end - start) / 2
    sum_, difference = 2 / near, 2 / far  # M + C, M − C
    bulge = 2 * np.sinh(middle / 2) ** 2 * np.sinh(half) + _sinh_less_argument(half)
    return np.asarray(
        ((sum_ + difference) / 2 * bulge + difference * half) / (sum_ * difference) ** 1.5
    )


def _sinh_less_argument(x: Array) -> Array:
    """Return sinh x − x to full relative precision, by its series for |x| < 1."""
    square, series = x * x, np.ones_like(x)
    for k in range(9, 0, -1):
        series = 1 + series * square / ((2 * k + 2) * (2 * k + 3))
    return np.where(np.abs(x) < 1, x * square / 6 * series, np.sinh(x) - x)


# the sweep goes this far past a crossing before it looks which function is uppermost: shorter arcs
# are left out
STRIDE = 1e-13


@dataclass(frozen=True)
class Arcs:
    """Arcs of envelopes.

    Args:
        owner: Envelope that each arc belongs to, shape (m,), rising; the arcs of one envelope in
            the order of φ.
        function: Index of the function that is uppermost on the arc, shape (m,), counted through
            all envelopes.
        start: φ at which the arc begins, shape (m,).
        end: φ at which it ends, `start` ≤ `end`, shape (m,).
    """

    owner: Rows
    function: Rows
    start: Array
    end: Array


def upper_envelopes(a: Array, b: Array, c: Array, counts: Rows) -> Arcs:
    """Return the arcs of the upper envelopes of groups of functions a cos φ + b sin φ + c.

    Args:
        a: Coefficients of cos φ, shape (k,), the groups one after the other.
        b: Coefficients of sin φ, shape (k,).
        c: Constants, shape (k,).
        counts: Functions in each group, shape (n,), sum k; a group of none has no arcs.

    Raises:
        FailedError: A sweep does not close; this would be an error of the program.
    """
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.intp)
    order = np.argsort(counts, kind="stable")
    order = order[counts[order] > 0]
    nothing = np.zeros(0, np.intp)
    parts: list[tuple[Rows, Rows, Array, Array]] = [(nothing, nothing, np.zeros(0), np.zeros(0))]
    while len(order):
        # groups of like size share one padded table, small enough for the cache; the padding
        # repeats the last function
        width = int(counts[order[: max(1, len(order) // 64)]][-1])
        width = max(width, int(counts[order[0]]) + 2)
        take = min(
            int(np.searchsorted(counts[order], width, side="right")), max(1, 60_000 // width)
        )
        group, order = order[:take], order[take:]
        table = first[group, None] + np.minimum(
            np.arange(counts[group].max()), counts[group, None] - 1
        )
        parts.append(_sweep(a[table], b[table], c[table], table, group))
    owner, function, start, end = (np.concatenate(column) for column in zip(*parts, strict=True))
    rank = np.lexsort((start, owner))
    return Arcs(owner[rank], function[rank], start[rank], end[rank])


def _sweep(
    a: Array, b: Array, c: Array, table: Rows, group: Rows
) -> tuple[Rows, Rows, Array, Array]:
    """Return the arcs of n upper envelopes by one sweep around the circle.

    Args:
        a: Coefficients of cos φ, shape (n, w), one row a group.
        b: Coefficients of sin φ, shape (n, w).
        c: Constants, shape (n, w).
        table: Index of each function among all groups, shape (n, w).
        group: Number of each group, shape (n,).

    Returns:
        Group, function, start and end of each arc, as of `Arcs`.
    """
    row = np.arange(len(a), dtype=np.intp)
    summit = np.argmax(np.hypot(a, b) + c, axis=1)  # the highest of all is on the envelope
    phi = np.arctan2(b[row, summit], a[row, summit])
    live, limit = row, phi + 2 * np.pi
    crossings: list[tuple[Rows, Rows, Array]] = []  # row, function that takes over, angle
    for step in range(4 * a.shape[1] + 16):
        after = phi + STRIDE if step else phi
        current, ahead = _next_crossing(a, b, c, after)
        crossings.append((live, current, phi))
        phi = after + ahead
        on = phi < limit
        if not on.all():
            a, b, c, live, limit, phi = a[on], b[on], c[on], live[on], limit[on], phi[on]
        if not len(live):
            return _arcs(crossings, table, group)
    raise FailedError(
        "an envelope did not close after four times as many steps as it has functions"
    )


def _arcs(
    crossings: list[tuple[Rows, Rows, Array]], table: Rows, group: Rows
) -> tuple[Rows, Rows, Array, Array]:
    """Return group, function, start and end of the arcs between the crossings of a sweep.

    An arc across the start of the sweep is joined into one.

    Args:
        crossings: Rows, columns of functions that become uppermost, and φ of each step.
        table: Index of each function among all groups, shape (n, w).
        group: Number of each group, shape (n,).
    """
    live, function, start = (np.concatenate(column) for column in zip(*crossings, strict=True))
    order = np.argsort(live, kind="stable")
    live, start = live[order], start[order]
    function = table[live, function[order]]
    last = np.flatnonzero(np.append(live[1:] != live[:-1], True))
    first = np.concatenate([[0], last[:-1] + 1])
    end = np.append(start[1:], 0.0)
    end[last] = start[first] + 2 * np.pi
    joined = (function[first] == function[last]) & (first != last)
    start[first[joined]] = start[last[joined]] - 2 * np.pi
    keep = np.ones(len(live), bool)
    keep[last[joined]] = False
    return group[live[keep]], function[keep], start[keep], end[keep]


def _next_crossing(a: Array, b: Array, c: Array, phi: Array) -> tuple[Rows, Array]:
    """Return the uppermost function of each row at φ, and the angle to its next crossing.

    The difference g ≤ 0 of another function to the uppermost one has at φ the value −h, the slope q
    and the oscillating part p; d is its constant. Ahead by δ, with t = tan(δ/2), it crosses zero
    where (d − p) t² + 2 q t − h = 0, at the root where it rises. The largest 1/t is the nearest
    crossing; it is computed without cancellation.

    Args:
        a: Coefficients of cos φ, shape (n, w).
        b: Coefficients of sin φ, shape (n, w).
        c: Constants, shape (n, w).
        phi: Angles, shape (n,).

    Returns:
        Column of the uppermost function, shape (n,), and the angle from φ at which another one
        rises above it, 2π if none does, shape (n,).
    """
    row = np.arange(len(a))
    cos, sin = np.cos(phi)[:, None], np.sin(phi)[:, None]
    wave = a * cos + b * sin
    slope = b * cos - a * sin
    value, scale = wave + c, np.abs(a) + np.abs(b)
    top = np.argmax(value, axis=1)
    level = value >= value[row, top][:, None] - 2e-15 * (scale + scale[row, top][:, None])
    # of those that are uppermost but for round-off, the one that rises
    current = np.argmax(np.where(level, slope, -np.inf), axis=1)
    wave -= wave[row, current][:, None]
    slope -= slope[row, current][:, None]
    constant = c - c[row, current][:, None]
    below = np.abs(np.minimum(wave + constant, 0))
    bend = constant - wave
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(slope**2 + bend * below)  # nan: the two never meet
        cotangent = np.where(slope >= 0, (slope + root) / below, bend / (root - slope))
    tangent = (below == 0) & (slope == 0)
    cotangent[tangent] = np.where(bend[tangent] > 0, np.inf, -np.inf)
    # one function twice, but for round-off
    same = np.abs(bend) + np.abs(slope) + below <= 1e-14 * scale
    cotangent[np.isnan(cotangent) | same] = -np.inf
    return current, 2 * np.arctan2(1.0, cotangent.max(axis=1))
