"""Laws of the particle radius: log-normal, cut at both ends (eq. 11, Fig. 11), or measured."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.stochastic.particles.csv_columns import length_columns
from alphacut.stochastic.theta.distribution import TruncatedNormal

MIN_RADIUS, MAX_RADIUS = 1e-12, 1e6  # m; no particle of a material is smaller or larger


def require_radii(key: str, radii: ArrayLike) -> None:
    """Refuse an empty list and radii outside [1e-12, 1e6] m, which have a wrong unit or digit."""
    radii = np.atleast_1d(np.asarray(radii, float))
    wrong = radii[~((radii >= MIN_RADIUS) & (radii <= MAX_RADIUS))]
    value, are_allowed = f"{wrong[0]:.6g} m" if len(wrong) else None, len(radii) and not len(wrong)
    allowed = f"radii from {MIN_RADIUS:g} to {MAX_RADIUS:g} m"
    require(bool(are_allowed), key, value=value, allowed=allowed)


@dataclass(frozen=True)
class LogNormalRadii:
    """r(θ) = exp(μ_r + σ_r θ), θ truncated normal, from `smallest` to `largest` in m (eq. 11).

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
    def label(self) -> str:
        """The law in words."""
        return f"log-normal, σ$_r$ = {self.sigma:.4f}"

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
        """Radius at `theta` (any shape), in m."""
        radius = np.exp(self.mu + self.sigma * np.asarray(theta, float))  # eq. 11
        return np.clip(radius, self.smallest, self.largest)

    def cdf(self, radius: ArrayLike) -> Array:
        """P(r ≤ radius), any shape, `radius` in m."""
        radius = np.asarray(radius, float)
        if self.sigma == 0:
            return np.where(radius < self.smallest, 0.0, 1.0)
        theta = (np.log(np.maximum(radius, MIN_RADIUS**2)) - self.mu) / self.sigma
        return self.distribution.cdf(theta)

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
        return self(self.distribution.sample(number, generator))


@dataclass(frozen=True)
class MeasuredRadii:
    """Radii of a list, in m; the distribution function is linear between neighbouring values.

    `source` is the name of the list.

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
        """Least radius, in m."""
        return self.values[0]

    @property
    def largest(self) -> float:
        """Greatest radius, in m."""
        return self.values[-1]

    @property
    def label(self) -> str:
        """The law in words."""
        return f"{len(self.values)} values of {self.source}"

    @cached_property
    def _grade(self) -> Array:
        """Distribution function at the values; a step where some are equal, or there is one."""
        count = len(self.values)
        return np.asarray(np.linspace(0, 1, count) if count > 1 else np.ones(1), float)

    def cdf(self, radius: ArrayLike) -> Array:
        """P(r ≤ radius), any shape, `radius` in m."""
        # of equal values `interp` takes the last at them, and the first below them
        return np.asarray(np.interp(np.asarray(radius, float), self.values, self._grade, left=0))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
        return np.asarray(np.interp(generator.random(number), self._grade, self.values), float)


RadiusDistribution = LogNormalRadii | MeasuredRadii
