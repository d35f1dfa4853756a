"""Elastic moduli of the phases of an image, as values and as intervals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError

LEAST, GREATEST = 1e-60, 1e60  # Pa; products of four moduli must be numbers
NU_AT_LEAST_BULK = -0.25  # Poisson's ratio of the least plane-strain bulk modulus at a fixed E


@dataclass(frozen=True)
class PlaneModuli:
    """Moduli of an isotropic material in plane strain.

    Args:
        bulk: Plane-strain bulk modulus K + G/3, in Pa, from `LEAST` to `GREATEST`; K is that of
            three dimensions.
        shear: Shear modulus G, in Pa, of the same range.

    Raises:
        RefusedError: A modulus lies outside its range.
    """

    bulk: float
    shear: float

    def __post_init__(self) -> None:
        """Refuse moduli outside (`LEAST`, `GREATEST`)."""
        for name, value in (("plane-strain bulk", self.bulk), ("shear", self.shear)):
            if not LEAST < value < GREATEST:
                allowed = f"values in ({LEAST:g}, {GREATEST:g}) Pa"
                raise RefusedError(f"{name} modulus of a phase", f"{value:g} Pa", allowed)

    @classmethod
    def of_young(cls, modulus: float, poisson: float) -> PlaneModuli:
        """From Young's modulus in Pa and Poisson's ratio, inside (−1, 0.5)."""
        if not -1 < poisson < 0.5:
            raise RefusedError("Poisson's ratio of a phase", poisson, "values in (-1, 0.5)")
        shear = modulus / (2 * (1 + poisson))
        return cls(modulus / (3 * (1 - 2 * poisson)) + shear / 3, shear)

    @property
    def stiffness(self) -> Array:
        """Plane-strain stiffness in Voigt order (11, 22, 12 with 2 ε12), shape (3, 3), in Pa."""
        k, g = self.bulk, self.shear
        return np.array([[k + g, k - g, 0], [k - g, k + g, 0], [0, 0, g]])


@dataclass(frozen=True)
class ModuliInterval:
    """All materials between two.

    Args:
        lower: Least moduli.
        upper: Greatest moduli, none below its least.
    """

    lower: PlaneModuli
    upper: PlaneModuli

    @classmethod
    def of_young(cls, modulus: tuple[float, float], poisson: tuple[float, float]) -> ModuliInterval:
        """Least and greatest plane bulk and shear modulus over intervals of E (Pa) and of ν.

        The bulk modulus E/(2 (1 + ν) (1 − 2 ν)) is convex in ν; the shear modulus decreases.
        """
        (young_low, young_high), (nu_low, nu_high) = modulus, poisson
        nu_softest = min(max(nu_low, NU_AT_LEAST_BULK), nu_high)
        least_bulk = PlaneModuli.of_young(young_low, nu_softest).bulk
        least_shear = PlaneModuli.of_young(young_low, nu_high).shear
        greatest_bulk = max(PlaneModuli.of_young(young_high, nu).bulk for nu in poisson)
        greatest_shear = PlaneModuli.of_young(young_high, nu_low).shear
        return cls(PlaneModuli(least_bulk, least_shear), PlaneModuli(greatest_bulk, greatest_shear))
