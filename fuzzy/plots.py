"""General fuzzy sets and their pictures: memberships (paper, Fig. 36) and α-cuts (Fig. 37)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.sets.boxes import levels
from alphacut.fuzzy.sets.numbers import (
    Array,
    Crisp,
    Cut,
    FuzzyNumber,
    Interval,
    PiecewiseLinear,
    Trapezoidal,
    Triangular,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# Okabe and Ito: told apart by everyone
_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


def plot_membership(
    axes: Axes, sets: Mapping[str, FuzzyNumber | FuzzySet], *, quantity: str = "p"
) -> None:
    """Draw membership functions, each under its name.

    Args:
        axes: Where to draw.
        sets: Fuzzy numbers and sets by name.
        quantity: What the abscissa shows, with its unit.
    """
    for (name, fuzzy), colour in zip(sets.items(), _COLOURS * len(sets), strict=False):
        x, grade = _outline(fuzzy)
        axes.plot(x, grade, color=colour, label=name, linewidth=1.8)
        axes.fill_between(x, grade, color=colour, alpha=0.12, linewidth=0)
    axes.set(xlabel=quantity, ylabel="membership μ", ylim=(0, 1.08))
    axes.legend(
        fontsize="small", frameon=False, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=3
    )


def plot_cuts(
    axes: Axes, number: FuzzyNumber, alpha: Sequence[float], *, quantity: str = "p"
) -> None:
    """Draw a fuzzy number decomposed into α-cuts.

    Args:
        axes: Where to draw.
        number: The number.
        alpha: Levels.
        quantity: What the abscissa shows, with its unit.
    """
    x, grade = _outline(number)
    axes.plot(x, grade, color=_COLOURS[0], linewidth=1.8)
    for level in alpha:
        cut = number.cut(level)
        axes.plot(cut, (level, level), color=_COLOURS[1], marker="|", markersize=9, linewidth=1.4)
        axes.annotate(
            f"α = {level:.3g}",
            (cut.upper, level),
            xytext=(5, 2),
            textcoords="offset points",
            fontsize="small",
        )
    axes.margins(x=0.15)  # room for the labels
    axes.set(xlabel=quantity, ylabel="membership μ, α", ylim=(-0.03, 1.12))


def _outline(fuzzy: FuzzyNumber | FuzzySet) -> tuple[list[float], list[float]]:
    """Corners of the membership function, with its jumps."""
    if isinstance(fuzzy, FuzzySet):
        return [fuzzy.x[0], *fuzzy.x, fuzzy.x[-1]], [0.0, *fuzzy.grade, 0.0]
    alpha, lower, upper = fuzzy.cuts
    return [lower[0], *lower, *upper[::-1], upper[0]], [0.0, *alpha, *alpha[::-1], 0.0]


def figure_36() -> Figure:
    """Crisp, interval, triangular, trapezoidal and non-convex subnormal sets (Fig. 36)."""
    from matplotlib.figure import Figure

    x = np.linspace(9, 11, 81)
    waves = 0.45 * np.sin(np.pi * (x - 9) / 2) + 0.3 * np.sin(3 * np.pi * (x - 9) / 2) ** 2
    sets: dict[str, FuzzyNumber | FuzzySet] = {
        "crisp number": Crisp(1.0),
        "crisp interval": Interval(2.0, 3.0),
        "triangular fuzzy number": Triangular(4.0, 4.5, 5.0),
        "fuzzy interval": Trapezoidal(6.0, 6.5, 7.5, 8.0),
        "non-convex, subnormal fuzzy set": FuzzySet(tuple(x), tuple(np.clip(waves, 0, 1))),
    }
    figure = Figure(figsize=(7.2, 2.9), layout="constrained")
    plot_membership(figure.subplots(), sets)
    return figure


def figure_37() -> Figure:
    """The paper's Fig. 37: a triangular number decomposed into six α-cuts."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.2, 3.0), layout="constrained")
    plot_cuts(figure.subplots(), Triangular(1.0, 2.0, 3.5), levels(5))
    return figure


@dataclass(frozen=True)
class FuzzySet:
    """Fuzzy set of the reals, piecewise linear, 0 outside (appendix A, Fig. 36).

    Args:
        x: Points, not falling; two equal ones make a jump.
        grade: Membership there, in [0, 1].

    Raises:
        ValueError: Lengths differ, points fall, or a grade leaves [0, 1].
    """

    x: tuple[float, ...]
    grade: tuple[float, ...]

    def __post_init__(self) -> None:
        for name in ("x", "grade"):
            object.__setattr__(self, name, tuple(float(value) for value in getattr(self, name)))
        if len(self.x) != len(self.grade) or len(self.x) < 2:
            raise ValueError(
                f"the fuzzy set has {len(self.x)} points and {len(self.grade)} grades; it needs as"
                " many of both, two or more"
            )
        if not np.isfinite(self.x).all() or any(b < a for a, b in pairwise(self.x)):
            raise ValueError(
                f"the points of the fuzzy set are {list(self.x)}; they must be finite and not fall"
            )
        if not all(0 <= grade <= 1 for grade in self.grade):
            raise ValueError(
                f"the grades of the fuzzy set are {list(self.grade)}; they must lie in [0, 1]"
            )

    @property
    def height(self) -> float:
        """Highest grade: 1 for a normal set, less for a subnormal one."""
        return max(self.grade)

    @property
    def convex(self) -> bool:
        """True if every cut is one interval."""
        top = int(np.argmax(self.grade))
        rising, falling = self.grade[: top + 1], self.grade[top:]
        return all(a <= b for a, b in pairwise(rising)) and all(
            a >= b for a, b in pairwise(falling)
        )

    def membership(self, x: ArrayLike) -> Array:
        """Grade of membership at `x`, any shape; the higher one at a jump."""
        x = np.asarray(x, float)
        knots, grades = np.array(self.x), np.array(self.grade)
        inside: Array = np.interp(x, knots, grades, left=0.0, right=0.0)
        for knot in set(self.x):
            inside = np.where(x == knot, grades[knots == knot].max(), inside)
        return inside

    def cut(self, alpha: float) -> tuple[Cut, ...]:
        """The α-cut as intervals from left to right, several where not convex.

        Raises:
            ValueError: `alpha` lies outside (0, 1].
        """
        if not 0 < alpha <= 1:
            raise ValueError(f"the α of a cut is {alpha:g}; it must lie in (0, 1]")
        pieces: list[Cut] = []
        for (a, p), (b, q) in pairwise(zip(self.x, self.grade, strict=True)):
            if max(p, q) < alpha:
                continue
            at = a if p == q else a + (b - a) * (alpha - p) / (q - p)
            piece = Cut(a if p >= alpha else at, b if q >= alpha else at)
            if pieces and piece.lower <= pieces[-1].upper:
                pieces[-1] = Cut(pieces[-1].lower, piece.upper)
            else:
                pieces.append(piece)
        return tuple(pieces)

    def to_number(self) -> PiecewiseLinear:
        """The same as a fuzzy number, to compute with.

        Raises:
            ValueError: The set is subnormal or not convex, so that it is no fuzzy number.
        """
        if self.height < 1:
            reason = f"its highest grade is {self.height:g}, so its cut at α = 1 is empty"
            raise ValueError(
                f"the fuzzy set is subnormal and cannot be computed with: {reason}; scale its"
                " grades to reach 1"
            )
        if not self.convex:
            reason = "its grades fall and rise again, so its cuts are not intervals"
            raise ValueError(
                f"the fuzzy set is not convex and cannot be computed with: {reason}; take its"
                " convex hull or its parts"
            )
        levels = sorted({0.0, 1.0, *self.grade})
        cuts = [self.cut(level) if level else (Cut(self.x[0], self.x[-1]),) for level in levels]
        return PiecewiseLinear(
            tuple(levels), tuple(cut[0].lower for cut in cuts), tuple(cut[-1].upper for cut in cuts)
        )

    def _refuse(self, other: object) -> NoReturn:
        self.to_number()
        raise ValueError("a fuzzy set is shown, not computed with; take its to_number()")

    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = (
        _refuse
    )
