"""Fuzzy numbers and intervals by their α-cuts (paper, appendix A, Fig. 36)."""

from __future__ import annotations

import itertools
import math
from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from alphacut.fuzzy.drawing import draw_membership, new_axes
from alphacut.fuzzy.sets.given import is_real
from alphacut.fuzzy.tables import membership_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Rows = NDArray[np.intp]


class Cut(NamedTuple):
    """An α-cut: a closed interval."""

    lower: float
    upper: float

    @property
    def width(self) -> float:
        """Upper less lower end."""
        return self.upper - self.lower


class Cuts(NamedTuple):
    """Nested α-cuts with linear ends between them: `alpha` rises from 0 to 1."""

    alpha: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]


class FuzzyNumber(ABC):
    """A normal, convex fuzzy set over the reals whose membership is piecewise linear."""

    @property
    @abstractmethod
    def cuts(self) -> Cuts:
        """The α-cuts at the corners of the membership function."""

    @cached_property
    def modal(self) -> float:
        """The value of membership 1, or the middle of the modal interval."""
        lower, upper = self.cut(1.0)
        return lower if lower == upper else (lower + upper) / 2

    @property
    def support(self) -> Cut:
        """The closed support, which is the cut at α = 0."""
        return self.cut(0.0)

    def cut(self, alpha: float) -> Cut:
        """The set of values with membership at least `alpha` in [0, 1]; at 0 the closed support.

        Raises:
            ValueError: `alpha` lies outside [0, 1].
        """
        if not 0 <= alpha <= 1:
            raise ValueError(f"the α of a cut is {alpha:g}; it must lie in [0, 1]")
        levels, lower, upper = self.cuts
        return Cut(
            float(_interpolate(alpha, levels, lower)), float(_interpolate(alpha, levels, upper))
        )

    def known(self, alpha: float) -> float:
        """Greatest level up to `alpha` whose cut is no wider than it is told."""
        return alpha

    def plot(self, axes: Axes | None = None, *, quantity: str = "p", name: str = "") -> Axes:
        """Draw the membership function (Fig. 36).

        Args:
            axes: Where to draw; a new figure if not given.
            quantity: Label of the abscissa, with its unit.
            name: Name in the legend of the axes; none if empty.

        Returns:
            The axes drawn on.
        """
        axes = new_axes(axes)
        draw_membership(axes, *self.cuts, name=name)
        axes.set_xlabel(quantity)
        return axes

    def _repr_html_(self) -> str:
        """The membership function as a small drawing, for notebooks."""
        return membership_svg(*self.cuts)

    def membership(self, x: ArrayLike) -> Array:
        """Grade of membership μ in [0, 1] at `x`, any shape; not a number where `x` is none."""
        levels, lower, upper = map(np.asarray, self.cuts)
        x = np.asarray(x, float)
        grade: Array = np.minimum(
            _highest_level(x, levels, lower), _highest_level(-x, levels, -upper)
        )
        return np.where(np.isnan(x), np.nan, grade)

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: object) -> object:
        """NumPy's signs act as the number's own; its functions are refused with what does them."""
        if method == "__call__" and len(inputs) == 2:
            with suppress(AttributeError):  # of functions that are no sign, such as numpy.hypot
                return ufunc(*map(_boxed, inputs))
        raise TypeError(
            f"numpy.{ufunc.__name__} takes no fuzzy number; take propagate or, of one number,"
            f" fuzzy.apply(numpy.{ufunc.__name__}, number)"
        )

    def __add__(self, other: FuzzyNumber | float) -> FuzzyNumber:
        return OPERATORS["+"](self, other)

    def __radd__(self, other: float) -> FuzzyNumber:
        return OPERATORS["+"](other, self)

    def __sub__(self, other: FuzzyNumber | float) -> FuzzyNumber:
        return OPERATORS["-"](self, other)

    def __rsub__(self, other: float) -> FuzzyNumber:
        return OPERATORS["-"](other, self)

    def __mul__(self, other: FuzzyNumber | float) -> FuzzyNumber:
        return OPERATORS["*"](self, other)

    def __rmul__(self, other: float) -> FuzzyNumber:
        return OPERATORS["*"](other, self)

    def __truediv__(self, other: FuzzyNumber | float) -> FuzzyNumber:
        return OPERATORS["/"](self, other)

    def __rtruediv__(self, other: float) -> FuzzyNumber:
        return OPERATORS["/"](other, self)

    def __neg__(self) -> FuzzyNumber:
        return OPERATORS["-"](0.0, self)

    def __pow__(self, exponent: int) -> FuzzyNumber:
        return OPERATORS["**"](self, exponent)


def _boxed(value: object) -> NDArray[np.object_]:
    """NumPy's numbers as Python's, anything else as an array of no dimension."""
    if isinstance(value, np.ndarray | np.generic):
        return np.asarray(value).astype(object)
    box = np.empty((), object)
    box[()] = value
    return box


OPERATORS: dict[str, Callable[[FuzzyNumber | float, FuzzyNumber | float], FuzzyNumber]] = {}
"""Functions behind the signs; `fuzzy.sets.arithmetic` enters its own."""


def _interpolate(alpha: float, levels: Sequence[float], ends: Sequence[float]) -> float:
    """The end of the cut at `alpha`, exact at the given levels."""
    right = bisect_right(levels, alpha)
    if right == len(levels):
        return ends[-1]
    share = (alpha - levels[right - 1]) / (levels[right] - levels[right - 1])
    rise = ends[right] - ends[right - 1]
    return ends[right - 1] + share * rise if share < 0.5 else ends[right] - (1 - share) * rise


def _highest_level(x: Array, levels: Array, lower: Array) -> Array:
    """The highest α whose lower end does not exceed x; 0 where none does."""
    right = np.searchsorted(lower, x, side="right")
    inner = np.clip(right, 1, len(lower) - 1)
    rise = lower[inner] - lower[inner - 1]
    share = np.divide(x - lower[inner - 1], rise, out=np.zeros_like(x), where=rise > 0)
    level = levels[inner - 1] + share * (levels[inner] - levels[inner - 1])
    return np.where(right == 0, 0.0, np.where(right == len(lower), 1.0, level))


WHOLE = 2**63
"""Largest whole number taken; larger ones are written as decimals."""


def _require_order(kind: str, values: Sequence[float], order: str) -> None:
    wrong = [
        value
        for value in values
        if not is_real(value) or (isinstance(value, int) and abs(value) > WHOLE)
    ]
    if wrong:
        raise ValueError(
            f"the {kind} holds {wrong[0]!r}; it needs plain numbers: convert units before, and"
            " write large whole ones as 1e30"
        )
    if not (all(map(math.isfinite, values)) and all(a <= b for a, b in itertools.pairwise(values))):
        shown = ", ".join(f"{value:g}" for value in values)
        raise ValueError(f"the {kind} is [{shown}]; it needs {order}, all finite")


@dataclass(frozen=True)
class Crisp(FuzzyNumber):
    """A single value of membership 1.

    Raises:
        ValueError: The value is not finite.
    """

    value: float

    def __post_init__(self) -> None:
        _require_order("crisp number", [self.value], "one value")

    @property
    def cuts(self) -> Cuts:
        """The value itself at every level."""
        return Cuts((0.0, 1.0), (self.value,) * 2, (self.value,) * 2)


@dataclass(frozen=True)
class Interval(FuzzyNumber):
    """A crisp interval: membership 1 between its ends, 0 outside.

    Raises:
        ValueError: The ends are not finite or not in order.
    """

    lower: float
    upper: float

    def __post_init__(self) -> None:
        _require_order("interval", [self.lower, self.upper], "lower <= upper")

    @property
    def cuts(self) -> Cuts:
        """The interval itself at every level."""
        return Cuts((0.0, 1.0), (self.lower,) * 2, (self.upper,) * 2)


@dataclass(frozen=True)
class Triangular(FuzzyNumber):
    """Triangular fuzzy number.

    Args:
        lower: Left end of the support.
        modal: Value of membership 1.
        upper: Right end of the support.

    Raises:
        ValueError: The three are not finite or not in order.
    """

    lower: float
    modal: float = field()  # declared anew: the base class derives it from the cuts
    upper: float

    def __post_init__(self) -> None:
        _require_order("triangle", [self.lower, self.modal, self.upper], "lower <= modal <= upper")

    @property
    def cuts(self) -> Cuts:
        """Support and modal value."""
        return Cuts((0.0, 1.0), (self.lower, self.modal), (self.upper, self.modal))


@dataclass(frozen=True)
class Trapezoidal(FuzzyNumber):
    """Fuzzy interval with straight flanks.

    Args:
        lower: Left end of the support.
        left: Left end of the modal interval.
        right: Right end of the modal interval.
        upper: Right end of the support.

    Raises:
        ValueError: The four are not finite or not in order.
    """

    lower: float
    left: float
    right: float
    upper: float

    def __post_init__(self) -> None:
        _require_order(
            "trapezoid",
            [self.lower, self.left, self.right, self.upper],
            "lower <= left <= right <= upper",
        )

    @property
    def cuts(self) -> Cuts:
        """Support and modal interval."""
        return Cuts((0.0, 1.0), (self.lower, self.left), (self.upper, self.right))


@dataclass(frozen=True)
class PiecewiseLinear(FuzzyNumber):
    """Fuzzy number from nested α-cuts, linear between them.

    Args:
        alpha: Levels, rising from 0 to 1, at least two.
        lower: Lower ends of the cuts, not falling with α.
        upper: Upper ends of the cuts, not rising with α.

    Raises:
        ValueError: Lengths differ, levels do not rise from 0 to 1, or cuts are not finite, nested
            intervals.
    """

    alpha: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("alpha", "lower", "upper"):  # arrays are welcome; tuples are kept
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))
        if not len(self.alpha) == len(self.lower) == len(self.upper) >= 2:
            sizes = (
                f"{len(self.alpha)} level{'s' * (len(self.alpha) != 1)}, {len(self.lower)} lower"
                f" and {len(self.upper)} upper ends"
            )
            raise ValueError(
                f"the α-cuts have {sizes}; they need as many ends as levels, two levels or more"
            )
        if self.alpha[0] != 0 or self.alpha[-1] != 1 or not all(np.diff(self.alpha) > 0):
            raise ValueError(
                f"the levels of the α-cuts are {list(self.alpha)}; they must rise from 0 to 1"
            )
        _require_order(
            "row of cut ends",
            [*self.lower, *self.upper[::-1]],
            "nested cuts, lower ends rising and upper ends falling with α",
        )

    @property
    def cuts(self) -> Cuts:
        """The cuts it was made from."""
        return Cuts(self.alpha, self.lower, self.upper)
