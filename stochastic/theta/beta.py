"""Beta law of θ on a bounded support; with both exponents 1 the uniform law."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betainc, betaincinv, betaln

from alphacut.stochastic.theta.law import Array, require_shares, require_support

LARGEST_EXPONENT = 1000.0


@dataclass(frozen=True)
class Beta:
    """Law of θ whose ξ = (θ − lower)/(upper − lower) has the density ξ^(p−1) (1 − ξ)^(q−1)/B(p, q).

    Johnson, Kotz & Balakrishnan, Continuous Univariate Distributions 2, 1995, chapter 25. Its mean
    is lower + (upper − lower) p/(p + q).

    Args:
        p: Exponent of the lower end, in [1, 1000]; below 1 the density is infinite there.
        q: Exponent of the upper end, in [1, 1000].
        lower: Left end of the support.
        upper: Right end of the support, greater than `lower`.

    Raises:
        ValueError: A value lies outside its range.
    """

    p: float = 1.0
    q: float = 1.0
    lower: float = -3.0
    upper: float = 3.0

    def __post_init__(self) -> None:
        require_support(self.lower, self.upper)
        for name, exponent in (("p", self.p), ("q", self.q)):
            if not 1 <= exponent <= LARGEST_EXPONENT:
                raise ValueError(
                    f"the exponent {name} of the beta law is {exponent:g}; it must lie in [1,"
                    f" {LARGEST_EXPONENT:g}], where the density is finite"
                )

    def xi(self, theta: ArrayLike) -> Array:
        """θ carried to [0, 1], any shape; ends beyond the support stay there."""
        inside = np.clip(np.asarray(theta, float), self.lower, self.upper)
        return np.asarray((inside - self.lower) / (self.upper - self.lower))

    def pdf(self, theta: ArrayLike) -> Array:
        """Density f_Θ at `theta` (any shape); zero outside the support."""
        theta = np.asarray(theta, float)
        inside = (theta >= self.lower) & (theta <= self.upper)
        xi = self.xi(theta)
        scale = np.exp(-betaln(self.p, self.q)) / (self.upper - self.lower)
        return np.where(inside, scale * xi ** (self.p - 1) * (1 - xi) ** (self.q - 1), 0.0)

    def cdf(self, theta: ArrayLike) -> Array:
        """P(Θ ≤ theta), any shape."""
        return np.asarray(betainc(self.p, self.q, self.xi(theta)))

    def quantile(self, probability: ArrayLike) -> Array:
        """The θ below which a share `probability` in [0, 1] lies, any shape."""
        share = np.asarray(probability, float)
        require_shares(share)
        xi = betaincinv(self.p, self.q, share)
        return np.asarray(self.lower + (self.upper - self.lower) * xi)
