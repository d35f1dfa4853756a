"""Arithmetic of arrays of closed intervals, rounded outwards."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

# relative step out after each operation: above its rounding error, of NumPy's functions too
OUTWARDS = 4e-16
TINY = 1e-300  # where a result underflows


@dataclass(frozen=True)
class Interval:
    """Arrays of lower and upper ends."""

    low: Array
    high: Array

    @classmethod
    def exact(cls, value: float) -> Interval:
        """The interval of one number."""
        return cls(np.asarray(float(value)), np.asarray(float(value)))

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __add__(self, other: Interval) -> Interval:
        return _out(self.low + other.low, self.high + other.high)

    def __sub__(self, other: Interval) -> Interval:
        return self + -other

    def __mul__(self, other: Interval) -> Interval:
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return _out(*_hull([np.where(np.isnan(end), 0.0, end) for end in ends]))

    def __truediv__(self, other: Interval) -> Interval:
        safe = (other.low > 0) | (other.high < 0)
        below, above = (np.where(safe, end, 1.0) for end in (other.low, other.high))
        quotient = self * _out(1 / above, 1 / below)
        return Interval(
            np.where(safe, quotient.low, -np.inf), np.where(safe, quotient.high, np.inf)
        )

    def __pow__(self, exponent: int) -> Interval:
        if exponent < 0:
            return Interval.exact(1.0) / self**-exponent
        ends = [self.low**exponent, self.high**exponent]
        low, high = _hull(ends)
        if exponent % 2 == 0 and exponent > 0:
            low = np.where((self.low <= 0) & (self.high >= 0), 0.0, low)
        return _out(low, high)

    def __abs__(self) -> Interval:
        ends = np.abs(self.low), np.abs(self.high)
        inside = (self.low <= 0) & (self.high >= 0)
        return Interval(np.where(inside, 0.0, np.minimum(*ends)), np.maximum(*ends))

    def rising(self, function: Callable[[Array], Array]) -> Interval:
        """The image under a function that rises."""
        with np.errstate(over="ignore", invalid="ignore"):
            return _out(function(self.low), function(self.high))

    def root(self) -> Interval:
        """The image under the square root of what is not negative, for ends have rounding errors.

        Raises:
            ValueError: An interval is negative as a whole.
        """
        if (self.high < 0).any():
            raise ValueError("the outline takes sqrt of a negative value; write sqrt(max(…, 0))")
        return Interval(np.maximum(self.low, 0), self.high).rising(np.sqrt)

    def cosine(self) -> Interval:
        """The image under the cosine."""
        slack = 1e-15 * (1 + np.maximum(np.abs(self.low), np.abs(self.high)))
        low, high = _hull([np.cos(self.low), np.cos(self.high)])
        crest, trough = (
            np.ceil((self.low - shift - slack) / (2 * np.pi))
            <= np.floor((self.high - shift + slack) / (2 * np.pi))
            for shift in (0.0, np.pi)
        )
        return _out(np.where(trough, -1.0, low), np.where(crest, 1.0, high))


def least(first: Interval, second: Interval) -> Interval:
    """The smaller of two values."""
    return Interval(np.minimum(first.low, second.low), np.minimum(first.high, second.high))


def greatest(first: Interval, second: Interval) -> Interval:
    """The greater of two values."""
    return Interval(np.maximum(first.low, second.low), np.maximum(first.high, second.high))


def _hull(ends: list[Array]) -> tuple[Array, Array]:
    return np.minimum.reduce(ends), np.maximum.reduce(ends)


def _out(low: Array, high: Array) -> Interval:
    return Interval(low - OUTWARDS * np.abs(low) - TINY, high + OUTWARDS * np.abs(high) + TINY)
