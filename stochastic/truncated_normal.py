"""The basic random variable θ: a standard normal cut to an interval and normalised on it (paper, section 3.1)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import erf, ndtr, ndtri

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TruncatedNormal:
    """Standard normal law cut to [lower, upper], its density normalised there.

    Args:
        lower: Left end of the support, in standard deviations.
        upper: Right end of the support, greater than `lower`.

    Raises:
        ValueError: The ends are not finite or not in order.
    """

    lower: float = -3.0
    upper: float = 3.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.lower) and np.isfinite(self.upper) and self.lower < self.upper):
            raise ValueError(f"the support of θ is [{self.lower}, {self.upper}]; it needs two finite ends, lower < upper")

    @cached_property
    def mass(self) -> float:
        """Probability that the uncut standard normal gives to the support."""
        return float(erf(self.upper / np.sqrt(2)) - erf(self.lower / np.sqrt(2))) / 2

    def pdf(self, theta: ArrayLike) -> Array:
        """Density f_Θ at `theta` (any shape); zero outside the support."""
        theta = np.asarray(theta, float)
        inside = (theta >= self.lower) & (theta <= self.upper)
        return np.where(inside, np.exp(-(theta**2) / 2) / (np.sqrt(2 * np.pi) * self.mass), 0.0)

    def cdf(self, theta: ArrayLike) -> Array:
        """P(Θ ≤ theta), any shape."""
        theta = np.clip(np.asarray(theta, float), self.lower, self.upper)
        return (ndtr(theta) - ndtr(self.lower)) / self.mass

    def quantile(self, probability: ArrayLike) -> Array:
        """The θ below which a share `probability` in [0, 1] lies, any shape."""
        theta = ndtri(ndtr(self.lower) + np.asarray(probability, float) * self.mass)
        return np.clip(theta, self.lower, self.upper)
