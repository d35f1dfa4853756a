"""The cell: two elastic phases and a random radius, and the loads it is homogenised under."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from numbers import Real

import numpy as np

from alphacut.stochastic import RadiusMap
from alphacut.stochastic.theta.truncated_normal import Array

STRAIN = 0.01  # eq. 15
IN_GPA = (0.01, 1e4)  # E that is no solid's in Pa (soft gels have 1e4) and is one's in GPa or MPa
# eq. 15 as (ε11, ε22, 2 ε12); ε12 is the tensor component
LOADS = np.array([[STRAIN, STRAIN, 0.0], [0.0, 0.0, 2 * STRAIN]])
# with the third, the whole planar stiffness follows
THREE_LOADS = np.vstack([LOADS, [[STRAIN, -STRAIN, 0.0]]])


@dataclass(frozen=True)
class Phase:
    """An isotropic elastic material in plane strain.

    Args:
        modulus: Young's modulus in Pa, positive.
        poisson: Poisson's ratio, inside (−1, 0.5).

    Raises:
        ValueError: A value lies outside its range.
    """

    modulus: float
    poisson: float = 0.3

    def __post_init__(self) -> None:
        for what, value in (("Young's modulus", self.modulus), ("Poisson's ratio", self.poisson)):
            if not isinstance(value, Real) or isinstance(value, bool):
                raise ValueError(
                    f"{what} is {value!r}; a phase takes plain numbers, in Pa: a fuzzy one is an"
                    " input of fuzzy.propagate, and each sample makes its own phase"
                )
        if not (np.isfinite(self.modulus) and self.modulus > 0):
            raise ValueError(
                f"Young's modulus is {self.modulus:g} Pa; it must be positive and finite"
            )
        if IN_GPA[0] <= self.modulus < IN_GPA[1] and self.modulus != 1:  # 1 scales others
            told = f"Young's modulus is {self.modulus:g} Pa, softer than any gel"
            warnings.warn(f"{told}; a phase takes Pa, 1 GPa is 1e9", stacklevel=3)
        if not -1 < self.poisson < 0.5:
            raise ValueError(f"Poisson's ratio is {self.poisson:g}; it must lie inside (-1, 0.5)")

    @property
    def stiffness(self) -> Array:
        """Plane-strain stiffness in Voigt order (11, 22, 12 with 2 ε12), (3, 3), in Pa (eq. 6)."""
        e, nu = self.modulus, self.poisson
        unit = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]])
        return e / ((1 + nu) * (1 - 2 * nu)) * unit


@dataclass(frozen=True)
class Cell:
    """Periodic square cell of side 2 with one centred circular particle of random radius r(θ).

    Args:
        matrix: Material outside the particle.
        inclusion: Material of the particle.
        radius: Map θ ↦ r(θ) in (0, 1), with the law of θ.
    """

    matrix: Phase
    inclusion: Phase
    radius: RadiusMap


MODULI = ("C11+C12", "C11-C12", "C33")


def square_voigt(bulk: Array, deviator: Array, shear: Array) -> Array:
    """Voigt matrices (…, 3, 3) of square symmetry from C11 + C12, C11 − C12 and C33."""
    voigt = np.zeros((*bulk.shape, 3, 3))
    voigt[..., 0, 0] = voigt[..., 1, 1] = (bulk + deviator) / 2
    voigt[..., 0, 1] = voigt[..., 1, 0] = (bulk - deviator) / 2
    voigt[..., 2, 2] = shear
    return voigt


def square_moduli(stiffness: Array) -> Array:
    """C11 + C12, C11 − C12 and C33 of the square-symmetric part, shape (…, 3)."""
    mean, lateral = (stiffness[..., 0, 0] + stiffness[..., 1, 1]) / 2, stiffness[..., 0, 1]
    return np.stack([mean + lateral, mean - lateral, stiffness[..., 2, 2]], axis=-1)


def with_ratio(moduli: Array) -> Array:
    """C11 + C12, C11 − C12, C33 and the ratio of the last two, shape (…, 4), from the first three.

    Both moduli of the ratio come from one discretisation and err alike, so that its error is judged
    by itself.
    """
    return np.concatenate([moduli, moduli[..., 1:2] / moduli[..., 2:3]], axis=-1)


def with_ratio_errors(errors: Array) -> Array:
    """Relative errors of the three moduli and of the ratio, shape (…, 4), from the first three.

    For errors that know nothing of one another.
    """
    apart = (1 + errors[..., 1:2]) * (1 + errors[..., 2:3]) - 1
    return np.concatenate([errors, apart], axis=-1)
