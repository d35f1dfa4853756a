"""Truncated normal law of the basic random variable θ (section 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import erfc, sqrt

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require
from alphacut.stochastic.theta.law import require_shares, require_support

__all__ = ["Array", "TruncatedNormal"]


@dataclass(frozen=True)
class TruncatedNormal:
    """Standard normal law cut to [lower, upper], its density normalised there.

    Args:
        lower: Left end of the support, in standard deviations.
        upper: Right end of the support, greater than `lower`.

    Raises:
        RefusedError: The ends are not finite or not in order.
    """

    lower: float = -3.0
    upper: float = 3.0

    def __post_init__(self) -> None:
        require_support(self.lower, self.upper, unit=1.0)
        cure = "the standard normal law gives this one no probability"
        ends = [self.lower, self.upper]
        require(self.mass > 0, "support of θ", ends, "ends nearer to 0", cure)

    @cached_property
    def mass(self) -> float:
        """Probability that the uncut standard normal gives to the support."""
        return float(self._below(self.upper))

    def _below(self, theta: ArrayLike) -> Array:
        """Uncut probability of [lower, theta], a difference of the smaller tails."""
        if self.lower > 0:
            return _normal(-self.lower) - _normal(-np.asarray(theta))
        return _normal(theta) - _normal(self.lower)

    def pdf(self, theta: ArrayLike) -> Array:
        """Density f_Θ at `theta` (any shape); zero outside the support."""
        theta = np.asarray(theta, float)
        inside = (theta >= self.lower) & (theta <= self.upper)
        return np.where(inside, np.exp(-(theta**2) / 2) / (np.sqrt(2 * np.pi) * self.mass), 0.0)

    def cdf(self, theta: ArrayLike) -> Array:
        """P(Θ ≤ theta), any shape."""
        inside = np.clip(np.asarray(theta, float), self.lower, self.upper)
        return np.asarray(self._below(inside) / self.mass, float)

    def quantile(self, probability: ArrayLike) -> Array:
        """The θ below which a share `probability` in [0, 1] lies, any shape."""
        from scipy.special import ndtri

        share = np.asarray(probability, float)
        require_shares(share)
        theta = (
            -ndtri(_normal(-self.lower) - share * self.mass)
            if self.lower > 0
            else ndtri(_normal(self.lower) + share * self.mass)
        )
        return np.asarray(np.clip(theta, self.lower, self.upper))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent values of θ, shape (number,)."""
        return self.quantile(generator.random(number))


def _normal(theta: ArrayLike) -> Array:
    """Distribution function of the standard normal law, any shape; SciPy would start later."""
    values = np.asarray(theta, float)
    shares = [erfc(-one / sqrt(2)) / 2 for one in values.ravel()]
    return np.array(shares).reshape(values.shape)
