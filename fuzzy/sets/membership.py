"""General fuzzy sets by their membership polyline, to be shown and cut."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.sets.numbers import Array, Cut, PiecewiseLinear


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
