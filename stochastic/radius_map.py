"""The map θ ↦ r(θ) of the random variable θ to the reduced particle radius (paper, eq. 12).

This differs from the paper in: 1. The Hermite functions take ξ = (θ − lower)/(upper − lower) ∈ [0,
1] and not θ itself; the slopes a2, a4 are not rescaled. 2. The radius is bounded by the square
cell, r < 1, and not by √(π/4).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from numbers import Real
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.stochastic.theta.distribution import (
    ThetaDistribution,
    TruncatedNormal,
    require_distribution,
    require_support,
)

RADII = "radii inside (0, 1), in halves of the cell's side"
"""What is allowed, for messages."""


class RadiusMap(Protocol):
    """Random radius of the cell problem: the distribution of θ, and the map from θ to the radius.

    Any object with these two members will do; every model of the cell calls `require_map`.

    Example:
        >>> radius_map: RadiusMap = HermiteMap(0.2, 0.1, 0.8, 0.2)
        >>> radius_map.distribution
        TruncatedNormal(lower=-3.0, upper=3.0)
    """

    @property
    def distribution(self) -> ThetaDistribution:
        """Distribution of θ."""

    def __call__(self, theta: ArrayLike) -> Array:
        """Return the radius over half the cell's side, in (0, 1), at `theta` (any shape)."""


def require_map(radius_map: RadiusMap) -> None:
    """Raise for a radius map whose θ has no bounded support, or whose radii leave (0, 1).

    The radii are tested at 65 equally spaced θ, ends included.

    Args:
        radius_map: Function of θ with the attribute `distribution`, the distribution of θ.

    Raises:
        RefusedError: It is no such function; the distribution lacks members or has a support that
            is not finite, not in order or too narrow; or the radii are not one for each θ, or
            outside (0, 1).
    """
    is_map = callable(radius_map) and hasattr(radius_map, "distribution")
    value = type(radius_map).__name__
    require(is_map, "radius map", value, allowed="functions of θ with its `distribution`")
    distribution = radius_map.distribution
    require_distribution(distribution)
    require_support(distribution.lower, distribution.upper)
    # Only the values of a user's map are known, so they are sampled.
    theta = np.linspace(distribution.lower, distribution.upper, 65)
    radii = np.asarray(radius_map(theta), float)
    allowed = f"the shape of θ, {theta.shape}"
    has_shape = radii.shape == theta.shape
    require(has_shape, "shape of the radii", value=radii.shape, allowed=allowed)
    is_inside = (radii > 0) & (radii < 1)
    row = int(np.argmin(is_inside))
    require(is_inside.all(), f"r at θ = {theta[row]:.4g}", value=f"{radii[row]:.4g}", allowed=RADII)


@dataclass(frozen=True)
class HermiteMap:
    """Cubic Hermite map r(θ) = Σ a_i h_i(ξ), ξ ∈ [0, 1] (eq. 12), of radii over half a side.

    Args:
        a1: Radius at the lower end of θ.
        a2: Slope dr/dξ there.
        a3: Radius at the upper end.
        a4: Slope dr/dξ there.
        distribution: Distribution of θ.

    Raises:
        RefusedError: r(θ) leaves (0, 1) somewhere on the support.

    Example:
        >>> HermiteMap(a1=0.2, a2=0.1, a3=0.8, a4=0.2)([-3, 0, 3])
        array([0.2   , 0.4875, 0.8   ])
    """

    a1: float
    a2: float
    a3: float
    a4: float
    distribution: ThetaDistribution = field(default_factory=TruncatedNormal)

    def __post_init__(self) -> None:
        """Check the map.

        Raises:
            RefusedError: `distribution` is no distribution of θ, a value is no finite real number,
                or r(θ) leaves (0, 1) somewhere on the support.
        """
        require_distribution(self.distribution)
        values = (self.a1, self.a2, self.a3, self.a4)
        # NaN is inside no limits, so that values that are no numbers are refused by the same check.
        low = high = np.nan
        if all(isinstance(value, Real) and np.isfinite(value) for value in values):
            low, high = self.extremes()
        shown = f"{low:.4g} … {high:.4g}"
        cure = "lower a1 or a3, or the slopes a2, a4"
        is_inside = low > 0 and high < 1
        require(is_inside, f"r of the map {values}", value=shown, allowed=RADII, cure=cure)

    @property
    def monomials(self) -> Array:
        """Coefficients of 1, ξ, ξ², ξ³, shape (4,), from which eq. 12 is evaluated."""
        # eq. 12 sorted by powers: h1 = 1 − 3 ξ² + 2 ξ³, h2 = ξ − 2 ξ² + ξ³, h3 = 3 ξ² − 2 ξ³ and
        # h4 = −ξ² + ξ³.
        quadratic = 3 * (self.a3 - self.a1) - 2 * self.a2 - self.a4
        cubic = 2 * (self.a1 - self.a3) + self.a2 + self.a4
        return np.array([self.a1, self.a2, quadratic, cubic])

    def xi(self, theta: ArrayLike) -> Array:
        """Return ξ = (θ − lower)/(upper − lower) in [0, 1], any shape."""
        width = self.distribution.upper - self.distribution.lower
        return np.asarray((np.asarray(theta, float) - self.distribution.lower) / width)

    def __call__(self, theta: ArrayLike) -> Array:
        """Return the reduced radius at `theta`, any shape."""
        radius = np.polynomial.polynomial.polyval(self.xi(theta), self.monomials)  # eq. 12
        return np.asarray(radius, float)

    def extremes(self) -> tuple[float, float]:
        """Return the smallest and the largest radius on the support of θ.

        They are in halves of the cell's side, at the ends of the support or where dr/dξ = 0. They
        may be outside (0, 1); such a map is refused when it is made.
        """
        # dr/dξ is a quadratic: its roots are the inner extremes. `polyder` gives coefficients by
        # rising powers, `roots` takes them by falling ones.
        roots = np.roots(np.polynomial.polynomial.polyder(self.monomials)[::-1])
        is_real = abs(roots.imag) < 1e-12  # the rounding of a double root
        inner = roots.real[is_real & (roots.real > 0) & (roots.real < 1)]
        xi = np.concatenate([[0.0, 1.0], inner])
        radii = np.polynomial.polynomial.polyval(xi, self.monomials)
        return float(radii.min()), float(radii.max())
