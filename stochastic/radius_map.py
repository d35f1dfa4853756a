"""The map θ ↦ r(θ) of a truncated normal to the reduced particle radius (paper, eq. 12).

This differs from the paper in: 1. The Hermite functions take ξ = (θ − lower)/(upper − lower) ∈ [0,
1] and not θ itself; the slopes a2, a4 are not rescaled. 2. The radius is bounded by the square
cell, r < 1, and not by √(π/4).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from alphacut.stochastic.theta.truncated_normal import Array, TruncatedNormal


class RadiusMap(Protocol):
    """Random radius of the cell problem: its law and the map from θ."""

    @property
    def distribution(self) -> TruncatedNormal:
        """Law of θ."""

    def __call__(self, theta: ArrayLike) -> Array:
        """Radius over half the cell's side, in (0, 1), at `theta` (any shape)."""


@dataclass(frozen=True)
class HermiteMap:
    """Cubic Hermite map r(θ) = Σ a_i h_i(ξ), ξ ∈ [0, 1] (eq. 12).

    Args:
        a1: Radius at the lower end of θ, dimensionless (radius over half the side of the cell).
        a2: Slope dr/dξ at the lower end.
        a3: Radius at the upper end.
        a4: Slope dr/dξ at the upper end.
        distribution: Law of θ.

    Raises:
        ValueError: r(θ) leaves (0, 1) somewhere on the support.
    """

    a1: float
    a2: float
    a3: float
    a4: float
    distribution: TruncatedNormal = field(default_factory=TruncatedNormal)

    def __post_init__(self) -> None:
        finite = bool(np.isfinite([self.a1, self.a2, self.a3, self.a4]).all())
        low, high = self.extremes() if finite else (np.nan, np.nan)
        if not (low > 0 and high < 1):  # also catches nan
            raise ValueError(
                f"the radius map a1 = {self.a1:g}, a2 = {self.a2:g}, a3 = {self.a3:g}, a4 ="
                f" {self.a4:g} gives radii from {low:.4g} to {high:.4g}; they must stay inside (0,"
                " 1), in halves of the cell's side: lower a1 or a3, or the slopes a2, a4"
            )

    @property
    def monomials(self) -> Array:
        """Coefficients of 1, ξ, ξ², ξ³, shape (4,)."""
        a1, a2, a3, a4 = self.a1, self.a2, self.a3, self.a4
        return np.array([a1, a2, 3 * (a3 - a1) - 2 * a2 - a4, 2 * (a1 - a3) + a2 + a4])

    def xi(self, theta: ArrayLike) -> Array:
        """θ carried to [0, 1]."""
        law = self.distribution
        return (np.asarray(theta, float) - law.lower) / (law.upper - law.lower)

    def __call__(self, theta: ArrayLike) -> Array:
        """Reduced radius at `theta`, any shape."""
        return np.polynomial.polynomial.polyval(self.xi(theta), self.monomials)  # eq. 12

    def slope(self, theta: ArrayLike) -> Array:
        """dr/dξ at `theta`, any shape."""
        return np.polynomial.polynomial.polyval(
            self.xi(theta), np.polynomial.polynomial.polyder(self.monomials)
        )

    def extremes(self) -> tuple[float, float]:
        """Least and greatest radius on the support."""
        turning = np.roots(np.polynomial.polynomial.polyder(self.monomials)[::-1])
        inner = turning.real[(abs(turning.imag) < 1e-12) & (turning.real > 0) & (turning.real < 1)]
        radii = np.polynomial.polynomial.polyval(
            np.concatenate([[0.0, 1.0], inner]), self.monomials
        )
        return float(radii.min()), float(radii.max())

    @property
    def is_monotone(self) -> bool:
        """True if r never falls as θ rises."""
        _, b, c, d = self.monomials
        turning = [-c / (3 * d)] if d else []
        lowest = [
            b + 2 * c * x + 3 * d * x * x for x in (0.0, 1.0, *(x for x in turning if 0 < x < 1))
        ]
        return bool(min(lowest) >= 0)
