"""Measured values as intervals: exact, rounded, censored, or known between two ends."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError, checked_number, require

Values = Sequence[float] | Sequence[tuple[float, float]] | NDArray[np.float64]
Limits = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Observations:
    """Values that are known to lie between two ends each, both rows in rising order.

    Args:
        lower: Lower ends, shape (n,), rising; −∞ where a value is only known from above.
        upper: Upper ends, shape (n,), rising; ∞ where a value is only known from below.
        bounds: Physically possible values; infinite where there is none.
    """

    lower: Array
    upper: Array
    bounds: tuple[float, float]

    @classmethod
    def from_values(cls, values: Values, bounds: Limits | None = None) -> Observations:
        """Return the observations of values as they were measured, within physical bounds.

        Args:
            values: Numbers, shape (n,), or pairs of a lower and an upper end, shape (n, 2),
                infinite where a value is censored; also mixed.
            bounds: Physically possible values; None where there is no bound.

        Raises:
            RefusedError: There is no value, a value is not a number, a pair is not in order, or a
                value lies outside the bounds.
        """
        low, high = _limits(bounds)
        ends = np.array([_ends(number, value) for number, value in enumerate(values, 1)])
        require(len(ends) > 0, "values", value=list(values), allowed="one or more")
        lower, upper = ends.T
        is_possible = (upper >= low) & (lower <= high)
        row = int(np.argmin(is_possible))
        allowed = f"values within the bounds [{low:g}, {high:g}]"
        require(is_possible.all(), f"value {row + 1}", value=ends[row].tolist(), allowed=allowed)
        return cls(np.sort(np.maximum(lower, low)), np.sort(np.minimum(upper, high)), (low, high))

    @property
    def count(self) -> int:
        """Number of values n."""
        return len(self.lower)

    @property
    def exact(self) -> bool:
        """True if every value is known exactly."""
        return bool((self.lower == self.upper).all())

    @property
    def is_censored(self) -> bool:
        """True if a value has an infinite end, which no bound replaces."""
        return bool(np.isinf([self.lower, self.upper]).any())

    def mapped(self, function: np.ufunc) -> Observations:
        """Observations of a rising function of the values, such as the logarithm."""
        with np.errstate(divide="ignore"):
            low, high = (float(function(end)) for end in self.bounds)
            return Observations(function(self.lower), function(self.upper), (low, high))


def _limits(bounds: Limits | None) -> tuple[float, float]:
    """Return the physical bounds as two floats, infinite where there is none."""
    lower, upper = (None, None) if bounds is None else bounds
    low = -np.inf if lower is None else checked_number("lower bound", lower)
    high = np.inf if upper is None else checked_number("upper bound", upper)
    allowed = "(lower, upper) with lower < upper, None for none"
    require(low < high, "bounds", value=bounds, allowed=allowed)
    return low, high


def _is_number(value: object) -> bool:
    """True for a number that a float can hold; truth values are none."""
    if isinstance(value, bool) or not isinstance(value, int | float | np.number):
        return False
    return not isinstance(value, int) or abs(value) < sys.float_info.max


def _ends(position: int, value: object) -> tuple[float, float]:
    """Lower and upper end of a measured value, which is a number or a pair.

    Args:
        position: Position of the value in the list, from 1, for the message.
        value: The value.
    """
    ends = np.atleast_1d(np.asarray(value, object))
    has_ends = ends.ndim == 1 and len(ends) in (1, 2) and not np.ma.is_masked(value)  # type: ignore[no-untyped-call]
    if has_ends and all(_is_number(end) for end in ends):
        low, high = float(ends[0]), float(ends[-1])
        if low <= high and np.isfinite((low, high)).any():  # at most one end is infinite
            return low, high
    allowed = "finite numbers, or pairs (lower, upper) in order, one end of which may be infinite"
    raise RefusedError(f"value {position}", value, allowed)
