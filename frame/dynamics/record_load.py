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
MAX_TURN = 2.0
"""Largest z = |λ| times a part of a step."""
MAX_PARTS = 4096
"""Most parts of a step."""


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
        self.first, self.last = _end_values(history, home * step + start, home * step + end)
        self.step, self.start, self.length = home, start, end - start
        self.history = history

    def magnitudes(self, count: int) -> Array:
        """Return ∫ |f| over each step, shape (count,), as m/s; an upper bound with a sine.

        Where a segment crosses zero, |f| is two triangles.
        """
        a, b = np.abs(self.first), np.abs(self.last)
        crosses_zero = self.first * self.last < 0
        triangles = (a**2 + b**2) / np.where(crosses_zero, a + b, 1.0)
        mean = np.where(crosses_zero, triangles, a + b) / 2
        return np.bincount(self.step, self.length * mean, count)

    def moments(self, step: float, count: int, order: int) -> Array:
        """Return moments ∫ T_i(x) f dt of the load f over each step, shape (count, order).

        T_i are Chebyshev's polynomials, and x runs from 1 at a step's beginning to −1 at its end.
        Gauss quadrature is exact, with a sine to round-off where it turns by `MAX_TURN` in a step
        at most. The `count` steps have the length `step`, in s.
        """
        sine_points = POINTS if self.history.frequency else 0
        points, weights = np.polynomial.legendre.leggauss(order // 2 + 1 + sine_points)
        fraction = (points + 1) / 2  # of a segment
        since = self.start[:, None] + self.length[:, None] * fraction
        x = 1 - 2 * since / step
        load = self.first[:, None] * (1 - fraction) + self.last[:, None] * fraction
        if self.history.frequency:
            load = load * self.history.wave(self.step[:, None] * step + since)
        load = load * (self.length[:, None] / 2 * weights)
        first_segment = np.searchsorted(self.step, np.arange(count))  # of each step
        moments = np.empty((count, order))
        previous, polynomial = np.zeros_like(x), np.ones_like(x)
        for i in range(order):
            moments[:, i] = np.add.reduceat((polynomial * load).sum(1), first_segment)
            following = x if i == 0 else 2 * x * polynomial - previous
            previous, polynomial = polynomial, following
        return moments


def _end_values(history: History, begin: Array, end: Array) -> tuple[Array, Array]:
    """Return g just after the beginnings and just before the ends of intervals, shape (L,) each.

    g is the load without its sine, and no interval has a sample inside.
    """
    a, h = history.samples, history.step
    piece = np.floor(((begin + end) / 2 - history.start) / h).astype(int)  # between samples
    is_sampled, is_after = (piece >= 0) & (piece < len(a) - 1), piece >= len(a) - 1
    k = np.where(is_sampled, piece, 0)
    slope = (a[k + 1] - a[k]) / h
    outside = np.where(is_after & np.array(history.is_held), a[-1], 0.0)

    def value_at(time: Array) -> Array:
        value = a[k] + slope * (time - history.start - k * h)
        return np.where(is_sampled, value, outside)

    return value_at(begin), value_at(end)


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
    """Return the rule that integrates smooth kernels against a load over each of `count` steps.

    Kernels are interpolated at `POINTS` Chebyshev points in each of `parts` equal parts of a step,
    whose length is `step`, in s.
    """
    h = step / parts
    angle = (np.arange(POINTS) + 0.5) * np.pi / POINTS
    # Chebyshev coefficients of an interpolant by its values, shape (coefficients, points)
    basis = np.cos(np.arange(POINTS)[:, None] * angle) * (2 / POINTS)
    basis[0] /= 2
    moments = Segments(history, h, count * parts).moments(h, count * parts, POINTS)
    weight = (moments @ basis).reshape(count, parts, POINTS)[:, ::-1]  # from a step's end
    tau = (np.arange(parts)[:, None] + (1 + np.cos(angle)) / 2) * h
    return LoadRule(tau.ravel(), weight.reshape(count, -1))


def parts_per_step(fastest: float, step: float) -> int:
    """Return the number of parts of a step, a power of 2, for interpolation to round-off.

    Args:
        fastest: Largest |λ| of the functions exp(λ τ) to interpolate, in rad/s.
        step: Length of a step, in s.

    Raises:
        ValueError: There would be more than `MAX_PARTS`.
    """
    least_parts = max(1.0, fastest * step / MAX_TURN)
    parts = 1 << max(0, ceil(log2(least_parts) - 1e-9))
    if parts > MAX_PARTS:
        raise ValueError(
            f"step: {step:g} s with motions as fast as {fastest:.3g} rad/s under a record is"
            f" {fastest * step:.2g} rad a step, above {MAX_TURN * MAX_PARTS:g}; take a step of at"
            f" most {MAX_TURN * MAX_PARTS / fastest:.2g} s"
        )
    return parts


def linear_load(history: History, step: float, count: int) -> Array:
    """Return the best straight line through a load in each step by its end values, (count, 2).

    It has the load's impulse and first moment in the step, and is the load where that is linear.
    """
    mean, tilt = Segments(history, step, count).moments(step, count, 2).T / step
    return np.stack([mean + 3 * tilt, mean - 3 * tilt], -1)
