"""The radius map of particles of one size, by the fraction of the cell that they take."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.stochastic.particles.shapes import DISCS, Shape
from alphacut.stochastic.theta.distribution import ThetaDistribution, TruncatedNormal


@dataclass(frozen=True)
class FractionMap:
    """Radius map of particles that take the same fraction of the cell at all θ.

    Args:
        fraction: Area fraction of discs, or volume fraction of spheres.
        shape: `DISCS` or `SPHERES`.
        distribution: Distribution of θ, on which nothing depends.

    Example:
        >>> FractionMap(0.2)([-3, 0, 3])
        array([0.5046265, 0.5046265, 0.5046265])
    """

    fraction: float
    shape: Shape = DISCS
    distribution: ThetaDistribution = field(default_factory=TruncatedNormal)

    def __call__(self, theta: ArrayLike) -> Array:
        """Return the reduced radius, in the shape of `theta`."""
        radius = self.shape.reduced_radius(self.fraction)
        return np.full(np.shape(theta), radius)
