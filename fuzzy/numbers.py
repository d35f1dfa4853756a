"""Fuzzy numbers and intervals by their α-cuts (paper, appendix A)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np


class Cut(NamedTuple):
    """An α-cut: a closed interval."""

    lower: float
    upper: float

    @property
    def width(self) -> float:
        """Upper less lower end."""
        return self.upper - self.lower


class FuzzyNumber(Protocol):
    """A normal, convex fuzzy set over the reals."""

    @property
    def modal(self) -> float:
        """The value of membership 1, or the middle of the modal interval."""

    def cut(self, alpha: float) -> Cut:
        """The set of values with membership at least `alpha` in [0, 1]; at 0 the closed support."""


@dataclass(frozen=True)
class Triangular:
    """Triangular fuzzy number.

    Args:
        lower: Left end of the support.
        modal: Value of membership 1.
        upper: Right end of the support.

    Raises:
        ValueError: The three are not finite or not in order.
    """

    lower: float
    modal: float
    upper: float

    def __post_init__(self) -> None:
        if not (np.isfinite([self.lower, self.modal, self.upper]).all() and self.lower <= self.modal <= self.upper):
            raise ValueError(
                f"the triangle is [{self.lower:g}, {self.modal:g}, {self.upper:g}]; it needs lower <= modal <= upper, all finite"
            )

    def cut(self, alpha: float) -> Cut:
        """The α-cut, `alpha` in [0, 1]."""
        return Cut(self.lower + alpha * (self.modal - self.lower), self.upper + alpha * (self.modal - self.upper))
