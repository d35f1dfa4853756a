"""Anisotropy within proved bounds: E in every direction, and the nearest isotropic tensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve.anisotropy import directional_young
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.stochastic.theta.truncated_normal import Array

ANGLES = np.linspace(0, np.pi, 361)


@dataclass(frozen=True)
class Directions:
    """Stiffness over all rotations.

    Args:
        angle: Directions from 0 to π, in radians, shape (n,).
        lower: Lower bound of the plane-strain Young's modulus along each, in Pa.
        upper: Upper bound.
        isotropic: K + G/3 and G of the isotropic tensor nearest to the middle of the bounds, in Pa.
        distance: Of the middle from that tensor, relative (Frobenius norm of fourth-order tensors).
    """

    angle: Array
    lower: Array
    upper: Array
    isotropic: tuple[float, float]
    distance: float

    @property
    def least(self) -> tuple[float, float]:
        """Bounds of the least modulus of all directions, in Pa."""
        return float(self.lower.min()), float(self.upper.min())

    @property
    def greatest(self) -> tuple[float, float]:
        """Bounds of the greatest modulus of all directions, in Pa."""
        return float(self.lower.max()), float(self.upper.max())


def directions(bounds: StiffnessBounds) -> Directions:
    """Anisotropy of a stiffness between bounds."""
    middle = (bounds.lower + bounds.upper) / 2
    weights = np.array([[1, 1, 2], [1, 1, 2], [2, 2, 4]])  # of Voigt entries in the tensor's norm
    bulk = (middle[0, 0] + middle[1, 1] + 2 * middle[0, 1]) / 4
    shear = (middle[0, 0] + middle[1, 1] - 2 * middle[0, 1] + 4 * middle[2, 2]) / 8
    nearest = np.array(
        [[bulk + shear, bulk - shear, 0], [bulk - shear, bulk + shear, 0], [0, 0, shear]]
    )
    distance = np.sqrt((weights * (middle - nearest) ** 2).sum() / (weights * middle**2).sum())
    return Directions(
        ANGLES,
        directional_young(bounds.lower, ANGLES),
        directional_young(bounds.upper, ANGLES),
        (float(bulk), float(shear)),
        float(distance),
    )
