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
    """Return the hyperbolic anomaly s of points on walls: tanh(s/2) = √(near/far) tan(ψ/2).

    s is the parameter along the hyperbola, 0 at the point nearest to the disc's centre. At infinity
    and beyond it is about ±37.

    Args:
        psi: Angle ψ of each point at the disc's centre, from the direction of the neighbour, any
            number of turns, shape (m,).
        near: Twice the distance of the wall's nearest point from the disc's centre, positive, shape
            (m,).
        far: Twice the distance of this point from the neighbour's centre, positive, shape (m,).
    """
    psi = psi - 2 * np.pi * np.round(psi / (2 * np.pi))
    tanh = np.sqrt(near / far) * np.tan(psi / 2)
    # The largest number below 1 keeps the anomaly finite where the wall is at infinity.
    largest = 1 - 2**-53
    return np.asarray(2 * np.arctanh(np.clip(tanh, -largest, largest)))


def sector_area(start: Array, end: Array, near: Array, far: Array) -> Array:
    """Return the area between a disc's centre and its hyperbolic wall over an arc, shape (m,).

    The wall is 1/ρ = M cos ψ + C with M + C = 2/near and M − C = 2/far, ρ the distance from the
    disc's centre, ψ the angle from the direction of the neighbour. The anomaly s of a point is
    defined by tanh(s/2) = √(near/far) tan(ψ/2). The area is in the square of the unit of `near`.

    Args:
        start: Anomaly at the beginning of the arc, shape (m,).
        end: Anomaly at its end, shape (m,).
        near: Twice the distance of the wall's nearest point from the disc's centre, shape (m,).
        far: Twice the distance of this point from the neighbour's centre, shape (m,).
    """
    midpoint = (start + end) / 2
    half = (end - start) / 2
    M_plus_C = 2 / near
    M_minus_C = 2 / far
    M = (M_plus_C + M_minus_C) / 2
    # The area is M (cosh(midpoint) sinh(half) − half) + (M − C) half, over ((M + C) (M − C))^1.5.
    # With cosh x − 1 = 2 sinh²(x/2), and sinh x − x by `_sinh_less_argument`, nothing cancels.
    sinh_term = 2 * np.sinh(midpoint / 2) ** 2 * np.sinh(half) + _sinh_less_argument(half)
    return np.asarray((M * sinh_term + M_minus_C * half) / (M_plus_C * M_minus_C) ** 1.5)


def _sinh_less_argument(x: Array) -> Array:
    """Return sinh x − x to full relative precision, by its series for |x| < 1."""
    square = x * x
    series = np.ones_like(x)
    for k in range(9, 0, -1):
        series = 1 + series * square / ((2 * k + 2) * (2 * k + 3))
    return np.where(np.abs(x) < 1, x * square / 6 * series, np.sinh(x) - x)


@dataclass(frozen=True)
class Arcs:
    """Arcs of upper envelopes, ordered by their envelope and angle.

    Args:
        owner: Envelope that each arc belongs to, shape (m,).
        function: The function that is uppermost there, counted through all envelopes, shape (m,).
        start: Angle φ where the arc begins, shape (m,).
        end: Angle where it ends, shape (m,).
    """

    owner: Ints
    function: Ints
    start: Array
    end: Array

    def select(self, keep: Ints) -> Arcs:
        """Return the arcs with these indices."""
        return Arcs(self.owner[keep], self.function[keep], self.start[keep], self.end[keep])

    @classmethod
    def joined(cls, parts: list[Arcs]) -> Arcs:
        """Return the arcs of all parts, one part after another.

        Args:
            parts: At least one. They are not sorted by envelope again.
        """
        return cls(
            owner=np.concatenate([part.owner for part in parts]),
            function=np.concatenate([part.function for part in parts]),
            start=np.concatenate([part.start for part in parts]),
            end=np.concatenate([part.end for part in parts]),
        )


def upper_envelopes(a: Array, b: Array, c: Array, counts: Ints) -> Arcs:
    """Return the arcs of the upper envelopes of groups of functions a cos φ + b sin φ + c.

    Args:
        a: Coefficients of cos φ, shape (k,), the groups one after the other; b and c likewise.
        b: Coefficients of sin φ, shape (k,).
        c: Constants, shape (k,).
        counts: Number of functions in each group, shape (n,), sum k > 0; a group of none has no
            arcs.

    Returns:
        Arcs sorted by group and then by angle. The arcs of a group cover the circle once. They
        start at any angle, so that some may lie outside [−π, π].

    Raises:
        FailedError: A sweep around the circle does not end.
    """
    # A table with more entries does not fit into the cache.
    max_entries = 60_000
    first = np.append(0, np.cumsum(counts)[:-1]).astype(np.intp)
    pending = np.argsort(counts, kind="stable")
    pending = pending[counts[pending] > 0]
    parts = []
    while len(pending):
        # Groups of similar size share one padded table. Pending groups are sorted by size. Those up
        # to `width` functions are taken: the size at the end of their first 64th, but at least two
        # more than the smallest size.
        width = int(counts[pending[: max(1, len(pending) // 64)]][-1])
        width = max(width, int(counts[pending[0]]) + 2)
        n_fitting = int(np.searchsorted(counts[pending], width, side="right"))
        n_groups = min(n_fitting, max(1, max_entries // width))
        group = pending[:n_groups]
        pending = pending[n_groups:]
        columns = np.arange(counts[group].max())
        last_column = counts[group, None] - 1
        table = first[group, None] + np.minimum(columns, last_column)  # the last one is repeated
        parts.append(_sweep(a[table], b[table], c[table], table=table, group=group))
    arcs = Arcs.joined(parts)
    return arcs.select(np.lexsort((arcs.start, arcs.owner)))


def _sweep(a: Array, b: Array, c: Array, *, table: Ints, group: Ints) -> Arcs:
    """Return the arcs of n upper envelopes by one sweep around the circle.

    Args:
        a: Coefficients of cos φ of the w functions of each envelope, shape (n, w).
        b: Coefficients of sin φ.
        c: Constants.
        table: Number of each function, counted through all envelopes, shape (n, w).
        group: Number of each envelope, shape (n,).

    Raises:
        FailedError: The sweep does not end.
    """
    # Each sweep begins where the function with the highest maximum has it: there it is uppermost.
    row: Ints = np.arange(len(a), dtype=np.intp)
    highest = np.argmax(np.hypot(a, b) + c, axis=1)
    phi = np.arctan2(b[row, highest], a[row, highest])

    # An arc shorter than the stride is left out: the sweep looks so far beyond each crossing which
    # function is uppermost. It is far above the rounding of an angle.
    stride = 1e-13
    open_rows = row
    limit = phi + 2 * np.pi
    rows = []
    columns = []
    starts = []
    for step in range(4 * a.shape[1] + 16):
        after = phi + stride if step else phi
        uppermost, angle_ahead = _next_crossing(a, b, c, after)
        rows.append(open_rows)
        columns.append(uppermost)
        starts.append(phi)
        phi = after + angle_ahead
        is_open = phi < limit
        if not is_open.all():
            a = a[is_open]
            b = b[is_open]
            c = c[is_open]
            phi = phi[is_open]
            open_rows = open_rows[is_open]
            limit = limit[is_open]
        if not len(open_rows):
            break
    else:
        raise FailedError("an envelope did not close after four times as many steps as functions")

    # Arcs by row; each ends where the next one of its row begins, and the last one a turn after the
    # beginning of the first.
    row = np.concatenate(rows)
    order = np.argsort(row, kind="stable")
    row = row[order]
    start = np.concatenate(starts)[order]
    function = table[row, np.concatenate(columns)[order]]
    last = np.flatnonzero(np.append(row[1:] != row[:-1], True))
    first = np.append(0, last[:-1] + 1)
    end = np.append(start[1:], 0.0)
    end[last] = start[first] + 2 * np.pi

    # Where the last arc of a row is of the same function as the first, both are one.
    is_joined = (function[first] == function[last]) & (first != last)
    start[first[is_joined]] = start[last[is_joined]] - 2 * np.pi
    keep = np.ones(len(row), bool)
    keep[last[is_joined]] = False
    return Arcs(group[row], function, start, end).select(np.flatnonzero(keep))


def _next_crossing(a: Array, b: Array, c: Array, phi: Array) -> tuple[Ints, Array]:
    """Return the uppermost function of each row at an angle, and how far ahead it is crossed.

    The functions are a cos φ + b sin φ + c. Another function less the uppermost one has, at φ, the
    value −h ≤ 0 and the slope q; −h = p + d with the oscillating part p and the constant d. At φ +
    δ, with t = tan(δ/2), this difference is zero where (d − p) t² + 2 q t − h = 0. The root where
    it rises is taken, and of all functions the largest 1/t, which is the nearest crossing.

    Args:
        a: Coefficients of cos φ, shape (n, w).
        b: Coefficients of sin φ, shape (n, w).
        c: Constants, shape (n, w).
        phi: Angle of each row, shape (n,).

    Returns:
        Column of the uppermost function, shape (n,); of several that are equal the one that rises
        most. And the angle from φ to its next crossing, in [0, 2 π], 2 π for none, shape (n,).
    """
    row = np.arange(len(a))
    cos = np.cos(phi)[:, None]
    sin = np.sin(phi)[:, None]
    wave = a * cos + b * sin
    slope = b * cos - a * sin
    value = wave + c

    # Of the functions that are uppermost but for rounding, the one that rises most is uppermost
    # just ahead of φ.
    scale = np.abs(a) + np.abs(b)
    top = np.argmax(value, axis=1)
    rounding = 2e-15 * (scale + scale[row, top][:, None])
    is_top = value >= value[row, top][:, None] - rounding
    uppermost = np.argmax(np.where(is_top, slope, -np.inf), axis=1)

    p = wave - wave[row, uppermost][:, None]
    q = slope - slope[row, uppermost][:, None]
    d = c - c[row, uppermost][:, None]
    h = np.abs(np.minimum(p + d, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(q**2 + (d - p) * h)  # NaN where the two never meet
        # Two equal forms of the root; each is used where its terms do not cancel.
        inverse_t = np.where(q >= 0, (q + root) / h, (d - p) / (root - q))
    is_tangent = (h == 0) & (q == 0)
    inverse_t[is_tangent] = np.where((d - p)[is_tangent] > 0, np.inf, -np.inf)
    is_same_function = np.abs(d - p) + np.abs(q) + h <= 1e-14 * scale
    inverse_t[np.isnan(inverse_t) | is_same_function] = -np.inf
    return uppermost, 2 * np.arctan2(1.0, inverse_t.max(axis=1))
