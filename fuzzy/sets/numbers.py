"""Fuzzy numbers and intervals by their α-cuts (paper, appendix A, Fig. 36)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, checked_number, require
from alphacut.base.extras import extra_named

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Cut(NamedTuple):
    """An α-cut: a closed interval."""

    lower: float
    upper: float

    @property
    def width(self) -> float:
        """Length of the interval."""
        return self.upper - self.lower


class Cuts(NamedTuple):
    """Nested α-cuts with linear ends between them: `alpha` rises from 0 to 1."""

    alpha: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]


class FuzzyNumber(ABC):
    """A normal, convex fuzzy set over the reals whose membership is piecewise linear.

    Example:
        >>> Triangular(1, 2, 4).membership([1.5, 2.0, 5.0])
        array([0.5, 1. , 0. ])
    """

    @property
    @abstractmethod
    def cuts(self) -> Cuts:
        """The α-cuts at the corners of the membership function."""

    @property
    def encloses(self) -> str:
        """Name of a set of joint values of several inputs that the box of their cuts encloses.

        Such a set, as "the learned set", may be smaller than the box: what is reached in the box
        need not be reached in the set. Empty where all of the box counts.
        """
        return ""

    @cached_property
    def nominal(self) -> float:
        """The value of membership 1, or the midpoint of the interval of such values."""
        lower, upper = self.cut(1.0)
        return lower if lower == upper else (lower + upper) / 2

    @property
    def support(self) -> Cut:
        """The closed support, which is the cut at α = 0."""
        return self.cut(0.0)

    def cut(self, alpha: float) -> Cut:
        """Return the α-cut: the closed interval of the values of membership `alpha` or more.

        At 0 it is the closed support. Between the corners of the membership function, which `cuts`
        holds, its ends are interpolated linearly.

        Args:
            alpha: Level in [0, 1].

        Raises:
            RefusedError: The level is outside [0, 1].
        """
        alpha = checked_level(alpha)
        cuts = self.cuts
        lower = _interpolate(alpha, cuts.alpha, cuts.lower)
        return Cut(lower, _interpolate(alpha, cuts.alpha, cuts.upper))

    def membership(self, x: ArrayLike) -> Array:
        """Return the grade of membership μ in [0, 1] at some values.

        It is 0 outside the cut at α = 0, 1 inside the cut at α = 1, and linear between the corners.

        Args:
            x: Values of any shape, which the result has, too. It is NaN where `x` is NaN.

        Raises:
            RefusedError: This is a number of measured values, which do not decide the cut at α = 0.
        """
        cuts = self.cuts
        x = np.asarray(x, float)
        # Where ends of several levels are equal, `interp` takes the last one: the highest level.
        # It needs rising ends. The upper ends fall with α, so that all signs are changed.
        left = np.interp(x, cuts.lower, cuts.alpha, left=0)
        right = np.interp(-x, -np.asarray(cuts.upper), cuts.alpha, left=0)
        return np.asarray(np.minimum(left, right))

    def plot(self, axes: Axes | None = None, **line: object) -> Axes:
        """Draw the membership function on Matplotlib axes, new ones by default, and return them.

        `line` has keywords of `Axes.plot`, such as `color`.

        Raises:
            RefusedError: This is a number of measured values, which do not decide the cut at α = 0.
            MissingLibraryError: New axes are to be made, and Matplotlib is not installed.
        """
        if axes is None:
            axes = new_axes()
        cuts = self.cuts
        support = cuts.lower[:1], cuts.upper[:1]  # where the function falls to 0
        values = np.concatenate([support[0], cuts.lower, cuts.upper[::-1], support[1]])
        levels = np.concatenate([[0.0], cuts.alpha, cuts.alpha[::-1], [0.0]])
        drawn: dict[str, Any] = line
        axes.plot(values, levels, **drawn)
        return axes


def new_axes() -> Axes:
    """Axes of a new figure of Matplotlib, which is imported now."""
    with extra_named():
        import matplotlib.pyplot as plt

    axes: Axes = plt.subplots()[1]
    return axes


def checked_level(alpha: float) -> float:
    """Return the level as a float; RefusedError for one outside [0, 1]."""
    return checked_number("alpha", alpha, least=0, most=1)


def checked_levels(alpha: Iterable[float]) -> tuple[float, ...]:
    """Return levels as a tuple of floats.

    Raises:
        RefusedError: It is a single value, there is no level, or they do not rise strictly within
            [0, 1].
    """
    try:
        given = tuple(alpha)
    except TypeError:
        cure = "put a single value into brackets"
        raise RefusedError("alpha", alpha, "a list of levels, as levels(4)", cure) from None
    levels = tuple(map(checked_level, given))
    ordered = bool(levels) and (np.diff(levels) > 0).all()
    require(ordered, "alpha", value=list(levels), allowed="levels that rise within [0, 1]")
    return levels


def _interpolate(alpha: float, levels: Sequence[float], ends: Sequence[float]) -> float:
    """Return the end of a cut at level `alpha` by linear interpolation; exact at `levels`.

    Args:
        alpha: Level, from the first of `levels` on. At the last one and above, the last end holds.
        levels: Strictly rising levels, one or more.
        ends: The lower ends of the cuts at the levels, or their upper ends.
    """
    right = bisect_right(levels, alpha)
    if right == len(levels):
        return float(ends[-1])
    fraction = (alpha - levels[right - 1]) / (levels[right] - levels[right - 1])
    rise = ends[right] - ends[right - 1]
    # The nearer end is the base, so that rounding does not lead out of the two ends.
    if fraction < 0.5:
        return float(ends[right - 1] + fraction * rise)
    return float(ends[right] - (1 - fraction) * rise)


@dataclass(frozen=True)
class _Corners(FuzzyNumber):
    """Base of numbers with straight flanks: their fields are the corners in rising order."""

    def __post_init__(self) -> None:
        key = type(self).__name__
        names = [corner.name for corner in fields(self)]
        corners = [checked_number(key, getattr(self, name)) for name in names]
        is_rising = (np.diff(corners) >= 0).all()
        require(is_rising, key, value=corners, allowed=" <= ".join(names))

    @cached_property
    def cuts(self) -> Cuts:
        """The support and the values of membership 1, which are the middle corner or middle two."""
        corners = [getattr(self, corner.name) for corner in fields(self)]
        left = corners[(len(corners) - 1) // 2]
        right = corners[len(corners) // 2]
        return Cuts((0.0, 1.0), (corners[0], left), (corners[-1], right))


@dataclass(frozen=True)
class Crisp(_Corners):
    """A single value of membership 1."""

    value: float


@dataclass(frozen=True)
class Interval(_Corners):
    """A crisp interval: membership 1 between its finite ends, 0 outside.

    Example:
        >>> Interval(3, 5).cut(0.5), Interval(3, 5).nominal
        (Cut(lower=3.0, upper=5.0), 4.0)
    """

    lower: float
    upper: float


@dataclass(frozen=True)
class Triangular(_Corners):
    """Triangular fuzzy number: ends of the support, and between them the value of membership 1.

    Raises:
        RefusedError: The three are not finite or not in order.

    Example:
        >>> Triangular(1, 2, 4).cut(0.5)
        Cut(lower=1.5, upper=3.0)
    """

    lower: float
    nominal: float = field()  # declared anew: the base class derives it from the cuts
    upper: float


@dataclass(frozen=True)
class Trapezoidal(_Corners):
    """Fuzzy interval with straight flanks: membership 1 from `left` to `right`, 0 at the others."""

    lower: float
    left: float
    right: float
    upper: float


@dataclass(frozen=True)
class _Nested(FuzzyNumber):
    """Base of numbers from nested cuts at some levels."""

    alpha: tuple[float, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]

    to_one: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check the fields, and replace them by tuples of floats.

        Raises:
            RefusedError: Levels do not rise strictly from 0 to at most 1 (to exactly 1 if the class
                asks for it by `to_one`), lengths differ, an end is not finite, lower ends fall or
                upper ends rise with the level, or the last lower end exceeds the last upper one.
        """
        levels = checked_levels(self.alpha)
        lower = tuple(float(end) for end in self.lower)
        upper = tuple(float(end) for end in self.upper)
        # The cut at 0 is the support, without which no number is bounded.
        is_complete = levels[0] == 0 and (levels[-1] == 1 or not self.to_one)
        is_complete = is_complete and len(levels) == len(lower) == len(upper)
        last = "to" if self.to_one else "up to"
        allowed = f"levels that rise from 0 {last} 1, one for each end"
        require(is_complete, "alpha", value=(levels, len(lower), len(upper)), allowed=allowed)
        # Cuts are nested if the lower ends rise, the upper ends fall and the last cut is not empty.
        ends = np.array(lower + upper[::-1])
        are_nested = np.isfinite(ends).all() and (np.diff(ends) >= 0).all()
        allowed = "finite ends, lower ones rising, upper falling"
        require(are_nested, "cuts", value=ends.tolist(), allowed=allowed)
        object.__setattr__(self, "alpha", levels)
        object.__setattr__(self, "lower", lower)
        object.__setattr__(self, "upper", upper)


@dataclass(frozen=True)
class PiecewiseLinear(_Nested):
    """Fuzzy number from nested α-cuts, linear between them.

    Args:
        alpha: Levels, rising from 0 to 1.
        lower: Lower ends of the cuts, not falling with α.
        upper: Upper ends of the cuts, not rising with α.

    Raises:
        RefusedError: Lengths differ, levels do not rise from 0 to 1, or cuts are not finite, nested
            intervals.
    """

    to_one = True

    @property
    def cuts(self) -> Cuts:
        """The cuts it was made from."""
        return Cuts(self.alpha, self.lower, self.upper)


@dataclass(frozen=True)
class Stepwise(_Nested):
    """Fuzzy number from nested cuts, each of which holds from its level up to the next one.

    Args:
        alpha: Levels, rising from 0 to at most 1.
        lower: Lower ends of the cuts, not falling with α.
        upper: Upper ends of the cuts, not rising with α.
        encloses: Name of a set as of `FuzzyNumber.encloses`.
    """

    encloses: str = ""

    @cached_property
    def cuts(self) -> Cuts:
        """The cuts as corners of a membership function: levels, lower and upper ends.

        The cut at `alpha[k]` holds up to the next level. Here it stands twice, at `alpha[k]` and at
        the largest float below `alpha[k + 1]`, the last cut at 1. Interpolated linearly, the ends
        then jump from cut to cut within one unit of rounding.
        """
        starts = np.array(self.alpha)
        ends = np.append(np.nextafter(starts[1:], 0.0), 1.0)
        # Each cut stands twice, at the first and the last level where it holds, unless these are
        # one, as for a cut at α = 1.
        levels = np.stack([starts, ends], axis=1).ravel()
        is_kept = np.append(True, np.diff(levels) != 0)
        lower = np.repeat(self.lower, 2)[is_kept]
        upper = np.repeat(self.upper, 2)[is_kept]
        return Cuts(tuple(levels[is_kept].tolist()), tuple(lower.tolist()), tuple(upper.tolist()))

    def cut(self, alpha: float) -> Cut:
        """The cut that holds at `alpha` in [0, 1]; RefusedError for a level outside."""
        # The last level that is not above α
        at = bisect_right(self.alpha, checked_level(alpha)) - 1
        return Cut(self.lower[at], self.upper[at])


def enclosed_set(numbers: Iterable[FuzzyNumber]) -> str:
    """Return the names of the sets that the box of some numbers encloses; empty without one."""
    names = [number.encloses for number in numbers if number.encloses]
    return " and ".join(dict.fromkeys(names))


def outer_steps(
    alpha: Sequence[float] | Array,
    lower: Sequence[float] | Array,
    upper: Sequence[float] | Array,
    *,
    encloses: str = "",
) -> Stepwise:
    """Return the fuzzy number that has the given nested cuts, and between two levels the wider one.

    The first cut holds from α = 0 on, and the last one up to 1. A level that rounding has lifted
    above a decimal, as 0.1 + 0.2, counts as that decimal.

    Args:
        alpha: Levels in [0, 1], strictly rising, one or more, shape (A,).
        lower: Lower ends of the cuts, not falling, shape (A,).
        upper: Upper ends of the cuts, not rising, shape (A,).
        encloses: Name of a set of joint values of several inputs that the box of their cuts
            encloses, such as "the learned set"; empty where all of the box counts.

    Raises:
        RefusedError: The cuts are not nested, not finite, or not as many as the levels.
    """
    # A level such as 0.1 + 0.2 lies above 0.3 by rounding. The cut at 0.3 would then be the wider
    # one of the level below.
    levels = [min(float(level), round(float(level), 12)) for level in alpha]
    levels[0] = 0.0
    return Stepwise(tuple(levels), tuple(lower), tuple(upper), encloses)


def fuzzy_number(alpha: Array, cuts: Array) -> FuzzyNumber:
    """Return the fuzzy number of α-cuts; between two levels the wider cut holds.

    Args:
        alpha: Rising levels, shape (levels,).
        cuts: Lower and upper ends, nested, shape (levels, 2). The first cut holds from α = 0 on. If
            1 is the only level, the result is the mean of both ends, a crisp number.

    Raises:
        RefusedError: An end is not finite, or the cuts are not nested.
    """
    # The level 1 alone does not say what the support is.
    if tuple(alpha) == (1.0,):
        return Crisp(float(cuts.mean()))
    return outer_steps(alpha, cuts[:, 0], cuts[:, 1])
