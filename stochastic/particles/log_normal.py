"""The law of the particle radius: log-normal, cut at both ends (paper, eq. 11, Fig. 11)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from alphacut.stochastic.theta.quadrature import gauss_rule
from alphacut.stochastic.theta.truncated_normal import Array, TruncatedNormal


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
        return float(np.log(self.largest / self.smallest)) / (
            self.distribution.upper - self.distribution.lower
        )

    @property
    def mu(self) -> float:
        """Position parameter μ_r, for radii in m."""
        return float(np.log(self.smallest)) - self.sigma * self.distribution.lower

    def __call__(self, theta: ArrayLike) -> Array:
        """Radius at `theta` (any shape), in m."""
        # eq. 11
        return np.clip(
            np.exp(self.mu + self.sigma * np.asarray(theta, float)), self.smallest, self.largest
        )

    def cdf(self, radius: ArrayLike) -> Array:
        """P(r ≤ radius), any shape, `radius` in m."""
        radius = np.asarray(radius, float)
        if self.sigma == 0:
            return np.where(radius < self.smallest, 0.0, 1.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            theta = (np.log(np.maximum(radius, 0)) - self.mu) / self.sigma
        return self.distribution.cdf(theta)

    @property
    def mean_square(self) -> float:
        """Mean of r², in m²."""
        rule = gauss_rule(self.distribution, points=40)
        return float(rule.mean(self(rule.nodes) ** 2))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent radii, shape (number,), in m."""
        return self(self.distribution.sample(number, generator))
