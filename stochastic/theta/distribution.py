"""Distributions of the basic random variable θ (section 3.1), as the truncated normal one."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from math import erfc, sqrt
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, is_number, require


class ThetaDistribution(Protocol):
    """Distribution of θ on a bounded support, with a density.

    The quadrature rules of distributions that can be hashed (frozen dataclasses) are cached.
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


def require_distribution(distribution: object) -> None:
    """Raise for what is no distribution of θ, such as a name or a frozen distribution of SciPy.

    It must have numbers `lower` and `upper` and a function `pdf`. Nothing else is checked.

    Raises:
        RefusedError: One of the three is missing.
    """
    has_lower = is_number(getattr(distribution, "lower", None))
    has_upper = is_number(getattr(distribution, "upper", None))
    if has_lower and has_upper and callable(getattr(distribution, "pdf", None)):
        return
    cure = "give the law itself, as TruncatedNormal(-3, 3)"
    if hasattr(distribution, "ppf"):
        cure = "for scipy.stats.norm give TruncatedNormal(-3, 3); else a class with these members"
    shown = type(distribution).__name__
    if isinstance(distribution, str):
        shown = repr(distribution)
    raise RefusedError("law of θ", shown, "a law with lower, upper, pdf, cdf and quantile", cure)


def require_matching_density(distribution: ThetaDistribution, heights: Array) -> None:
    """Raise unless the distribution function of θ is the integral of its density.

    It must be 0 and 1 at the ends of the support, and rise over each layer by the integral of the
    density, to 1e-6.

    Args:
        distribution: The distribution.
        heights: Ends of the layers, rising from 0 to 1 over the support.

    Raises:
        RefusedError: It is not.
    """
    from scipy.integrate import quad  # takes time to import

    tolerance = 1e-6
    levels = distribution.lower + heights * (distribution.upper - distribution.lower)
    values = np.asarray(distribution.cdf(levels), float)
    key = "distribution function of θ"
    is_whole = abs(values[0]) <= tolerance and abs(values[-1] - 1) <= tolerance
    ends = f"{values[0]:.6g} and {values[-1]:.6g} at the ends of the support"
    cure = "cut the law at its support: divide density and distribution function by the same mass"
    require(is_whole, key, ends, "0 and 1", cure)
    for (low, high), rise in zip(pairwise(levels), np.diff(values), strict=True):
        integral, error = quad(lambda theta: float(distribution.pdf(theta)), low, high, limit=200)
        found = f"rising by {rise:.6g} from {low:.4g} to {high:.4g}"
        is_integral = abs(rise - integral) <= tolerance + error
        require(is_integral, key, found, f"{integral:.6g}, the integral of the density", cure)


def require_support(lower: float, upper: float, unit: float = 0.0) -> None:
    """Raise for a support of θ that is not finite, not in order, or too narrow for its rounding.

    Its width must be at least 1e-4 of its larger end. Then the rounding of θ, 1e-16 of that end, is
    at most 1e-12 of the width.

    Args:
        lower: Lower end of the support.
        upper: Upper end.
        unit: Magnitude that counts as an end as well, of distributions with a unit of their own.

    Raises:
        RefusedError: It is such a support.
    """
    min_width = 1e-4 * max(abs(lower), abs(upper), unit)
    is_ordered = np.isfinite(lower) and np.isfinite(upper) and lower < upper
    is_wide = is_ordered and upper - lower >= 0.999 * min_width  # 9.999 … 10 is wide enough
    distance = f", {min_width:.2g} or more apart" if is_ordered else ""
    allowed = f"two finite ends, rising{distance}"
    require(is_wide, "support of θ", value=[lower, upper], allowed=allowed)


@dataclass(frozen=True)
class TruncatedNormal:
    """Standard normal distribution, truncated to [lower, upper] in standard deviations.

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
        """Return the probability that the standard normal distribution gives to [lower, theta].

        It is not divided by the probability of the support. For a support above 0 it is the
        difference of two upper tails, since lower tails would both be nearly 1 and lose digits.

        Args:
            theta: Values in the support, any shape.
        """
        if self.lower > 0:
            return _normal(-self.lower) - _normal(-np.asarray(theta))
        return _normal(theta) - _normal(self.lower)

    def pdf(self, theta: ArrayLike) -> Array:
        """Return the density f_Θ at `theta` (any shape); zero outside the support."""
        theta = np.asarray(theta, float)
        inside = (theta >= self.lower) & (theta <= self.upper)
        return np.where(inside, np.exp(-(theta**2) / 2) / (np.sqrt(2 * np.pi) * self.mass), 0.0)

    def cdf(self, theta: ArrayLike) -> Array:
        """Return P(Θ ≤ theta), any shape."""
        inside = np.clip(np.asarray(theta, float), self.lower, self.upper)
        return np.asarray(self._below(inside) / self.mass, float)

    def quantile(self, probability: ArrayLike) -> Array:
        """Return θ with P(Θ ≤ θ) = probability, in the shape of `probability`.

        0 gives the lower and 1 the upper end of the support, but for rounding.

        Args:
            probability: Probabilities in [0, 1], any shape.

        Raises:
            RefusedError: A probability is outside [0, 1] or NaN.
        """
        from scipy.special import ndtri

        p = np.asarray(probability, float)
        wrong = p[~((p >= 0) & (p <= 1))]
        value = next(wrong.flat, None)
        require(not wrong.size, "probability", value=value, allowed="values in [0, 1]")
        if self.lower > 0:  # by the smaller tail, as in `_below`
            theta = -ndtri(_normal(-self.lower) - p * self.mass)
        else:
            theta = ndtri(_normal(self.lower) + p * self.mass)
        return np.asarray(np.clip(theta, self.lower, self.upper))

    def sample(self, number: int, generator: np.random.Generator) -> Array:
        """Draw independent values of θ, shape (number,)."""
        return self.quantile(generator.random(number))


def _normal(theta: ArrayLike) -> Array:
    """Return the distribution function of the standard normal distribution.

    SciPy has it, but takes a third of a second to be imported.

    Args:
        theta: Values in standard deviations, any shape, infinite ones too; NaN gives NaN.

    Returns:
        Probabilities, in the shape of `theta`.
    """
    values = np.asarray(theta, float)
    # `erfc` keeps the digits of small tails, which 1 + erf would lose.
    probabilities = [erfc(-value / sqrt(2)) / 2 for value in values.ravel()]
    return np.array(probabilities).reshape(values.shape)
