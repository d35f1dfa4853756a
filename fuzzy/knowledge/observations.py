"""Measured values as intervals: exact, rounded, censored, or known between two ends."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.sets.numbers import Array

Values = (
    Sequence[float]
    | Sequence[tuple[float, float]]
    | Sequence[Sequence[float]]
    | NDArray[np.float64]
)
Bounds = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class Observations:
    """Values that are known to lie between two ends each, both rows in rising order.

    Args:
        lower: Lower ends, shape (n,), rising; −∞ where a value is only known from above.
        upper: Upper ends, shape (n,), rising; ∞ where a value is only known from below.
        bounds: Physically possible values; infinite where none is given.
    """

    lower: Array
    upper: Array
    bounds: tuple[float, float]

    @classmethod
    def of(
        cls, values: Values, bounds: Bounds | None = None, resolution: float = 0.0
    ) -> Observations:
        """Values as they were given.

        Args:
            values: Numbers, shape (n,), or pairs of a lower and an upper end, shape (n, 2),
                infinite where a value is censored.
            bounds: Physically possible values; None where there is no bound.
            resolution: Step to which the values were rounded: each is known to half of it.

        Raises:
            ValueError: There is no value, one is no number, a pair is not in order, or a value lies
                outside the bounds.
        """
        low, high = limits(bounds)
        rows = _pairs(values)
        if not (np.isfinite(resolution) and resolution >= 0):
            raise ValueError(
                f"the resolution is {resolution!r}; it must be the step to which values were"
                f" rounded, 0 or more"
            )
        lower, upper = rows[:, 0] - resolution / 2, rows[:, 1] + resolution / 2
        outside = np.flatnonzero((upper < low) | (lower > high))
        if len(outside):
            value = " … ".join(f"{end:g}" for end in np.unique(rows[outside[0]]))
            what = f"the value {value} lies outside the bounds [{low:g}, {high:g}]"
            raise ValueError(f"{what}; widen them or correct the value")
        return cls(np.sort(np.maximum(lower, low)), np.sort(np.minimum(upper, high)), (low, high))

    @property
    def count(self) -> int:
        """Number of values n."""
        return len(self.lower)

    @property
    def exact(self) -> bool:
        """Whether every value is known exactly."""
        return bool((self.lower == self.upper).all())

    def mapped(self, function: np.ufunc) -> Observations:
        """The observations through a rising function, as a logarithm."""
        with np.errstate(divide="ignore"):
            low, high = (float(function(end)) for end in self.bounds)
            return Observations(function(self.lower), function(self.upper), (low, high))


def limits(bounds: Bounds | None) -> tuple[float, float]:
    """Physical bounds; infinite where none is given.

    Raises:
        ValueError: They are not two numbers in order.
    """
    try:
        lower, upper = (None, None) if bounds is None else bounds
        low = -np.inf if lower is None else float(lower)
        high = np.inf if upper is None else float(upper)
    except (TypeError, ValueError):
        raise ValueError(
            f"the bounds are {bounds!r}; they must be (lower, upper), None where there is none"
        ) from None
    if not low < high:
        raise ValueError(
            f"the bounds are [{low:g}, {high:g}]; the lower one must be less than the upper one"
        )
    return low, high


def _pairs(values: Values) -> Array:
    """Lower and upper ends, shape (n, 2)."""
    try:
        rows = _numbers(values)
    except (TypeError, ValueError):
        raise ValueError(
            f"the values are {values!r}; they must be numbers, or pairs (lower, upper)"
        ) from None
    if not len(rows):
        raise ValueError("there is no value; one or more are needed")
    wrong = np.flatnonzero(
        ~(rows[:, 0] <= rows[:, 1]) | np.isposinf(rows[:, 0]) | np.isneginf(rows[:, 1])
    )
    if len(wrong):
        first, last = rows[wrong[0]].tolist()
        shown = f"[{first}, {last}]" if first > last else f"{first}"
        raise ValueError(
            f"value {wrong[0] + 1} is {shown}; it must be a finite number, or a pair (lower,"
            f" upper) in order"
        )
    return rows


def _numbers(values: Values) -> Array:
    """Numbers as pairs of equal ends, pairs as they are, shape (n, 2)."""
    masked = bool(np.ma.is_masked(values))  # type: ignore[no-untyped-call]
    if any(isinstance(end, str) for value in values for end in _ends(value)):
        raise TypeError("text is no measured number")
    if masked or (isinstance(values, np.ndarray) and np.iscomplexobj(values)):
        raise TypeError("masked and complex values are no measured numbers")
    try:
        table = np.asarray(values, float)
    except ValueError:  # numbers and pairs, mixed
        return np.array([np.broadcast_to(np.asarray(value, float), 2) for value in values]).reshape(
            -1, 2
        )
    if table.ndim == 1:
        return np.column_stack([table, table])
    if table.ndim != 2 or table.shape[1] != 2:
        raise ValueError
    return table


def _ends(value: object) -> Iterable[object]:
    return value if isinstance(value, list | tuple) else (value,)
