"""Laws of the basic random variable θ (section 3.1); the truncated normal is the paper's."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import erfc, sqrt
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import is_number, require

MIN_WIDTH = 1e-4  # of a support over its greater end, so that rounding is small beside it


class ThetaDistribution(Protocol):
    """Law of θ on a bounded support, with a density.

    Laws that can be hashed (frozen dataclasses) have their quadrature rules kept.
    """

    @property
    def lower(self) -> float:
        """Left end of the support, finite."""

    @property
    def upper(self) -> float:
        """Right end of the support, finite and greater than `lower`."""

    def pdf(self, theta: ArrayLike) -> Array:
        """Density f_Θ at `theta` (any shape), finite; its integral over the support is 1."""

    def cdf(self, theta: ArrayLike) -> Array:
        """P(Θ ≤ theta), any shape: 0 at `lower` and 1 at `upper`."""

    def quantile(self, probability: ArrayLike) -> Array:
        """Return θ with P(Θ ≤ θ) = probability in [0, 1], any shape."""


def require_distribution(law: object) -> None:
    """Refuse what is no `ThetaDistribution`, as a name or a frozen law of SciPy."""
    ends = getattr(law, "lower", None), getattr(law, "upper", None)
    is_law = all(map(is_number, ends)) and callable(getattr(law, "pdf", None))
    cure = "give the law itself, as TruncatedNormal(-3, 3)"
    if hasattr(law, "ppf"):
        cure = "for scipy.stats.norm give TruncatedNormal(-3, 3); else a class with these members"
    shown = type(law).__name__ if not isinstance(law, str) else repr(law)
    allowed = "a law with lower, upper, pdf, cdf and quantile"
    require(is_law, "law of θ", value=shown, allowed=allowed, cure=cure)


def require_support(lower: float, upper: float, unit: float = 0.0) -> None:
    """Refuse a support of θ that is not finite, not in order, or too narrow for its rounding."""
    least = MIN_WIDTH * max(abs(lower), abs(upper), unit)
    is_ordered = np.isfinite(lower) and np.isfinite(upper) and lower < upper
    is_wide = is_ordered and upper - lower >= 0.999 * least  # 9.999 … 10 is wide enough
    distance = f", {least:.2g} or more apart" if is_ordered else ""
    allowed = f"two finite ends, rising{distance}"
    require(is_wide, "support of θ", value=[lower, upper], allowed=allowed)


@dataclass(frozen=True)
class TruncatedNormal:
    """Standard normal law cut to [lower, upper], in standard deviations, and normalised there.

    Raises:
        RefusedError: The ends are not finite or not in order.

    Example:
        >>> TruncatedNormal().quantile(0.5).item()
        0.0
    """

    lower: float = -3.0
    upper: float = 3.0

    def __post_init__(self) -> None:
        require_support(self.lower, self.upper, unit=1.0)
        cure = "the standard normal law gives this one no probability"
        ends = [self.lower, self.upper]
        require(self.mass > 0, "support of θ", value=ends, allowed="ends nearer to 0", cure=cure)

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
        """Return θ with P(Θ ≤ θ) = probability in [0, 1], any shape."""
        from scipy.special import ndtri

        p = np.asarray(probability, float)
        wrong = p[~((p >= 0) & (p <= 1))]
        value = next(wrong.flat, None)
        require(not wrong.size, "probability", value=value, allowed="values in [0, 1]")
        if self.lower > 0:  # by the smaller tail
            theta = -ndtri(_normal(-self.lower) - p * self.mass)
        else:
            theta = ndtri(_normal(self.lower) + p * self.mass)
        return np.asarray(np.clip(theta, self.lower, self.upper))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """`number` independent values of θ, shape (number,)."""
        return self.quantile(generator.random(number))


def _normal(theta: ArrayLike) -> Array:
    """Distribution function of the standard normal law, any shape; SciPy would start later."""
    values = np.asarray(theta, float)
    shares = [erfc(-value / sqrt(2)) / 2 for value in values.ravel()]
    return np.array(shares).reshape(values.shape)
