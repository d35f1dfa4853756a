"""Law of the radii as a packing needs it."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.stochastic.theta.truncated_normal import Array


class RadiusLaw(Protocol):
    """A distribution of radii in m between `smallest` and `largest`."""

    @property
    def smallest(self) -> float:
        """Least radius, in m."""

    @property
    def largest(self) -> float:
        """Greatest radius, in m."""

    @property
    def label(self) -> str:
        """The law in words."""

    def cdf(self, radius: ArrayLike) -> Array:
        """P(r ≤ radius), any shape."""

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
