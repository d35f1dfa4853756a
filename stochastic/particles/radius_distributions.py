"""Distributions of the particle radius: truncated log-normal (eq. 11, Fig. 11), or measured."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.csv_columns import length_columns
from alphacut.base.errors import RefusedError, require
from alphacut.stochastic.theta.distribution import TruncatedNormal


def require_radii(key: str, radii: ArrayLike) -> None:
    """Raise for no radius at all, and for radii outside [1e-12, 1e6] m.

    Such radii have a wrong unit or digit.

    Args:
        key: Name of the radii in the message.
        radii: One radius or several in one dimension, in m; NaN is outside.

    Raises:
        RefusedError: There is no radius, or one is outside; the first such one is shown.
    """
    radii = np.atleast_1d(np.asarray(radii, float))
    wrong = radii[~((radii >= 1e-12) & (radii <= 1e6))]
    allowed = "radii from 1e-12 to 1e+06 m"
    require(len(radii) > 0, key, value=None, allowed=allowed)
    if len(wrong):
        raise RefusedError(key, f"{wrong[0]:.6g} m", allowed)


@dataclass(frozen=True)
class LogNormalRadii:
    """Log-normal radii r(θ) = exp(μ_r + σ_r θ) of a truncated normal θ (eq. 11).

    Args:
        smallest: Smallest radius in m, at the lower end of θ.
        largest: Largest radius in m, at its upper end.

    Raises:
        RefusedError: The radii are out of range or not in order.
    """

    smallest: float
    largest: float

    distribution: ClassVar[TruncatedNormal] = TruncatedNormal()

    def __post_init__(self) -> None:
        require_radii("smallest_radius", self.smallest)
        require_radii("largest_radius", self.largest)
        allowed = f"radii from smallest_radius = {self.smallest:g} m on"
        rising = self.smallest <= self.largest
        require(rising, "largest_radius", value=f"{self.largest:g} m", allowed=allowed)

    @property
    def sigma(self) -> float:
        """Scale parameter σ_r; ln 10/6 for a factor of ten on [-3, 3]."""
        width = self.distribution.upper - self.distribution.lower
        return float(np.log(self.largest / self.smallest)) / width

    @property
    def mu(self) -> float:
        """Position parameter μ_r, for radii in m."""
        return float(np.log(self.smallest)) - self.sigma * self.distribution.lower

    def __call__(self, theta: ArrayLike) -> Array:
        """Return the radius at `theta` (any shape), in m."""
        radius = np.exp(self.mu + self.sigma * np.asarray(theta, float))  # eq. 11
        # Rounding of exp must not pass the ends, which packings rely on.
        return np.clip(radius, self.smallest, self.largest)

    def cdf(self, radius: ArrayLike) -> Array:
        """Return P(r ≤ radius), any shape, `radius` in m."""
        radius = np.asarray(radius, float)
        if self.sigma == 0:
            return np.where(radius < self.smallest, 0.0, 1.0)
        positive = np.maximum(radius, 1e-24)  # below all radii that are allowed
        return self.distribution.cdf((np.log(positive) - self.mu) / self.sigma)

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """Draw independent radii, shape (number,), in m."""
        return self(self.distribution.sample(number, generator))


@dataclass(frozen=True)
class MeasuredRadii:
    """Radii of a list; their distribution function is linear between neighbouring values.

    Args:
        values: The radii in m.
        source: Name of the list.

    Raises:
        RefusedError: The list is empty, or a value is out of range.
    """

    values: tuple[float, ...]
    source: str = "a list"

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(sorted(float(value) for value in self.values)))
        require_radii(self.source, self.values)

    @classmethod
    def read(cls, path: Path) -> MeasuredRadii:
        """Return the radii of a CSV file with a column r, or d of diameters, as ``d [mm]``."""
        rows, values = length_columns(path, ("r",))
        for row, radius in zip(rows, values[:, 0], strict=True):
            require_radii(f"{path.name}, row {row}", radius)
        return cls(tuple(values[:, 0]), path.name)

    @property
    def smallest(self) -> float:
        """Smallest radius, in m."""
        return self.values[0]

    @property
    def largest(self) -> float:
        """Largest radius, in m."""
        return self.values[-1]

    @cached_property
    def _grade(self) -> Array:
        """Distribution function at the values; a step where some are equal, or there is one."""
        count = len(self.values)
        return np.asarray(np.linspace(0, 1, count) if count > 1 else np.ones(1), float)

    def cdf(self, radius: ArrayLike) -> Array:
        """Return P(r ≤ radius), any shape, `radius` in m."""
        # At equal values `interp` takes the last one, and below them the first one.
        return np.asarray(np.interp(np.asarray(radius, float), self.values, self._grade, left=0))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """Draw independent radii, shape (number,), in m."""
        # The inverse of the distribution function, at uniform probabilities.
        return np.asarray(np.interp(generator.random(number), self._grade, self.values), float)


RadiusDistribution = LogNormalRadii | MeasuredRadii
