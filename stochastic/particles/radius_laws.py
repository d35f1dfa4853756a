"""Laws of the particle radius: log-normal, cut at both ends (eq. 11, Fig. 11), or measured."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.stochastic.particles.csv_columns import LengthColumns, length_columns
from alphacut.stochastic.theta.truncated_normal import Array, TruncatedNormal


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


@dataclass(frozen=True)
class LogNormalRadii:
    """r(θ) = exp(μ_r + σ_r θ), θ truncated normal, between the limits (eq. 11).

    Args:
        smallest: Radius at the lower end of θ, in m, positive.
        largest: Radius at the upper end, in m; equal to `smallest` for discs of one size.
        distribution: Law of θ.

    Raises:
        ValueError: The radii are not positive, finite and in order.
    """

    smallest: float
    largest: float
    distribution: TruncatedNormal = field(default_factory=TruncatedNormal)

    def __post_init__(self) -> None:
        if not 0 < self.smallest <= self.largest < np.inf:
            raise ValueError(
                f"the radii go from {self.smallest:g} to {self.largest:g} m; they need 0 < smallest"
                " <= largest, both finite"
            )

    @property
    def label(self) -> str:
        """The law in words."""
        return f"log-normal, σ_r = {self.sigma:.4f}"

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
        with np.errstate(divide="ignore", invalid="ignore"):
            theta = (np.log(np.maximum(radius, 0)) - self.mu) / self.sigma
        return self.distribution.cdf(theta)

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
        return self(self.distribution.sample(number, generator))


@dataclass(frozen=True)
class TabulatedRadii:
    """Distribution function of radii at rising radii, linear between them.

    Args:
        radii: In m, positive and rising, at least two.
        shares: The function there, by number, from 0 to 1, nowhere falling.
        label: The law in words.

    Raises:
        ValueError: The table is none of a distribution function.
    """

    radii: tuple[float, ...]
    shares: tuple[float, ...]
    label: str = "a table"

    def __post_init__(self) -> None:
        radii, shares = np.array(self.radii), np.array(self.shares)
        if len(radii) != len(shares) or len(radii) < 2 or not 0 < radii[0] < radii[-1] < np.inf:
            raise ValueError(
                f"a table of {len(radii)} radii and {len(shares)} shares makes no law; it needs as"
                " many of both, at least two, and positive radii"
            )
        ends = abs(shares[0]) < 1e-12 and abs(shares[-1] - 1) < 1e-12
        if not (ends and (np.diff(shares) >= 0).all() and (np.diff(radii) > 0).all()):
            raise ValueError("radii must rise, and shares must rise from 0 to 1")

    @property
    def smallest(self) -> float:
        """Least radius, in m."""
        return self.radii[0]

    @property
    def largest(self) -> float:
        """Greatest radius, in m."""
        return self.radii[-1]

    def cdf(self, radius: ArrayLike) -> Array:
        """P(r ≤ radius), any shape, `radius` in m."""
        return np.asarray(np.interp(np.asarray(radius, float), self.radii, self.shares))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
        return np.asarray(np.interp(generator.random(number), self.shares, self.radii))


SLIP = 1e4  # times the median, or below it: no size of a sieve curve or of a list of particles


def refuse_slip(path: Path, sizes: LengthColumns) -> None:
    """Refuse positive sizes of which one is out of all proportion, as a slip makes it."""
    ratios = sizes.values[:, 0] / np.median(sizes.values[:, 0])
    worst = int(np.abs(np.log(ratios)).argmax())
    if not 1 / SLIP <= ratios[worst] <= SLIP:
        raise ValueError(
            f"{path}: row {sizes.rows[worst]} has a size {ratios[worst]:.3g} times the median,"
            f" no list or sieve has {SLIP:g} times it, up or down; correct the row or remove it"
        )


@dataclass(frozen=True)
class MeasuredRadii:
    """Radii of a list; the distribution function is linear between neighbouring values.

    Args:
        values: The list, in m, at least one, positive.
        source: What to call it.

    Raises:
        ValueError: The list is empty, or a value is not positive and finite.
    """

    values: tuple[float, ...]
    source: str = "a list"

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", tuple(sorted(float(value) for value in self.values)))
        if not self.values:
            raise ValueError("the list of radii is empty; it needs at least one")
        if not all(0 < value < np.inf for value in self.values):
            span = f"from {self.values[0]:g} to {self.values[-1]:g} m"
            raise ValueError(f"the radii go {span}; they must be positive and finite")

    @classmethod
    def read(cls, path: Path, unit: str = "") -> MeasuredRadii:
        """Read a CSV file with a column r, or d for diameters, and its unit: ``d [mm]``.

        Raises:
            ValueError: The file cannot be read, or a row makes no sense (row and reason).
        """
        found = length_columns(path, ("r",), unit)
        radii = found.values[:, 0]
        wrong = found.rows[~((radii > 0) & (radii < np.inf))][:10]
        if len(wrong) or not len(radii):
            told = "; ".join(f"row {row} holds no positive number" for row in wrong)
            told = told or "it holds no row"
            raise ValueError(f"{path}: {told}; it needs a radius or diameter in each row")
        refuse_slip(path, found)
        return cls(tuple(map(float, radii)), path.name)

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
        return np.linspace(0, 1, len(self.values)) if len(self.values) > 1 else np.ones(1)

    def cdf(self, radius: ArrayLike) -> Array:
        """P(r ≤ radius), any shape, `radius` in m."""
        # of equal values `interp` takes the last at them, and the first below them
        return np.asarray(np.interp(np.asarray(radius, float), self.values, self._grade, left=0))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
        return np.interp(generator.random(number), self._grade, self.values)
