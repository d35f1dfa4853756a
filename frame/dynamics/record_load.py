"""Loads at their own times, and rules that integrate smooth kernels against them.

A load is linear between its samples, or that times a sine, and may jump where it begins or ends.
Neither samples nor jumps need lie on nodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, log2

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.structures.loads import History

SAME = 1e-12
"""Distance of a sample from a node, as a share of the step, that is rounding."""
POINTS = 16
"""Points of a rule in each part of a step; interpolation errs by 2 (z/4)^16 / 16!, some 1e-18."""
TURN = 2.0
"""Largest z = |λ| times a part of a step."""
MOST = 4096
"""Parts of a step, at most."""


class Segments:
    """A load over `count` steps, cut at all nodes and samples: linear in each of L segments.

    Attributes:
        step: Step of the nodes in which each segment lies, rising from 0, shape (L,).
        start: Time from the beginning of its step, shape (L,), in s.
        length: Shape (L,), in s.
        first: Load just after its beginning, without a sine, shape (L,), as m/s².
        last: Load just before its end, shape (L,).
    """

    def __init__(self, history: History, step: float, count: int) -> None:
        samples = history.start + np.arange(len(history.samples)) * history.step
        nearest = np.round(samples / step)
        inner = (np.abs(samples - nearest * step) > SAME * step) & (samples < count * step)
        home = np.concatenate([np.arange(count), np.floor(samples[inner] / step).astype(int)])
        start = np.concatenate([np.zeros(count), samples[inner] - home[count:] * step])
        order = np.lexsort((start, home))
        home, start = home[order], start[order]
        end = np.append(start[1:], 0.0)
        end[np.append(np.diff(home) > 0, True)] = step
        self.first, self.last = _linear(history, home * step + start, home * step + end)
        self.step, self.start, self.length = home, start, end - start
        self.history = history

    def magnitudes(self, count: int) -> Array:
        """∫ |f| over every step, at most, shape (count,), as m/s."""
        a, b = np.abs(self.first), np.abs(self.last)
        crossed = self.first * self.last < 0
        mean = np.where(crossed, (a**2 + b**2) / np.where(crossed, a + b, 1.0), a + b) / 2
        return np.bincount(self.step, self.length * mean, count)

    def moments(self, step: float, count: int, order: int) -> Array:
        """∫ T_i(x) f over every step, shape (count, order), with T_i Chebyshev's polynomials.

        x runs from 1 at a step's beginning to −1 at its end; Gauss quadrature is exact, with a sine
        to round-off where it turns by `TURN` in a step at most.
        """
        more = POINTS if self.history.frequency else 0
        points, weights = np.polynomial.legendre.leggauss(order // 2 + 1 + more)
        share = (points + 1) / 2
        since = self.start[:, None] + self.length[:, None] * share
        x = 1 - 2 * since / step
        load = self.first[:, None] * (1 - share) + self.last[:, None] * share
        if self.history.frequency:
            load = load * self.history.wave(self.step[:, None] * step + since)
        load = load * (self.length[:, None] / 2 * weights)
        first = np.searchsorted(self.step, np.arange(count))
        out = np.empty((count, order))
        older, old = np.zeros_like(x), np.ones_like(x)
        for i in range(order):
            out[:, i] = np.add.reduceat((old * load).sum(1), first)
            older, old = old, (x if i == 0 else 2 * x * old - older)
        return out


def _linear(history: History, begin: Array, end: Array) -> tuple[Array, Array]:
    """One-sided values at the ends of intervals that hold no sample inside, without a sine."""
    a, h = history.samples, history.step
    piece = np.floor(((begin + end) / 2 - history.start) / h).astype(int)
    within, after = (piece >= 0) & (piece < len(a) - 1), piece >= len(a) - 1
    k = np.where(within, piece, 0)
    slope = (a[k + 1] - a[k]) / h
    outside = np.where(after & np.array(history.is_held), a[-1], 0.0)

    def at(time: Array) -> Array:
        value = a[k] + slope * (time - history.start - k * h)
        return np.where(within, value, outside)

    return at(begin), at(end)


@dataclass(frozen=True, eq=False)
class LoadRule:
    """∫ f(t_{j+1} − s) a(s) ds over the step from t_j to t_{j+1} is Σ_q weight[j, q] f(tau_q).

    The kernel f is interpolated, the record is not: the weights hold its moments, exact wherever
    its samples and jumps lie.

    Args:
        tau: Times before the end of a step, part by part from that end, shape (Q,), in s.
        weight: Shape (T − 1, Q), in m/s.
    """

    tau: Array
    weight: Array


@lru_cache(maxsize=8)
def load_rule(history: History, step: float, count: int, parts: int) -> LoadRule:
    """The rule for `count` steps, each in equal `parts` with `POINTS` points."""
    h = step / parts
    angle = (np.arange(POINTS) + 0.5) * np.pi / POINTS
    basis = np.cos(np.arange(POINTS)[:, None] * angle) * (2 / POINTS)
    basis[0] /= 2
    moments = Segments(history, h, count * parts).moments(h, count * parts, POINTS)
    weight = (moments @ basis).reshape(count, parts, POINTS)[:, ::-1]
    tau = (np.arange(parts)[:, None] + (1 + np.cos(angle)) / 2) * h
    return LoadRule(tau.ravel(), weight.reshape(count, -1))


def parts_of(fastest: float, step: float) -> int:
    """Parts of a step, 2^k, in which exp(λ τ), |λ| ≤ `fastest`, is interpolated to round-off.

    Raises:
        ValueError: They would be too many.
    """
    turn = max(1.0, fastest * step / TURN)
    parts = 1 << max(0, ceil(log2(turn) - 1e-9))
    if parts > MOST:
        raise ValueError(
            f"step: {step:g} s with motions as fast as {fastest:.3g} rad/s under a record is"
            f" {fastest * step:.2g} rad a step, above {TURN * MOST:g}; take a step of at most"
            f" {TURN * MOST / fastest:.2g} s"
        )
    return parts


def linear_load(history: History, step: float, count: int) -> Array:
    """Loads at both ends of every step, shape (count, 2), as m/s².

    They are those of the straight line with the record's impulse and first moment in the step,
    which is the record where that is linear.
    """
    level, tilt = Segments(history, step, count).moments(step, count, 2).T / step
    return np.stack([level + 3 * tilt, level - 3 * tilt], -1)
