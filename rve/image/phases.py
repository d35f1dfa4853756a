"""Moduli of the phases of an image, and images of the least and the greatest moduli.

The stiffness of a composite grows in the Loewner order with the tensor of every point. So the image
of the least K + G/3 and the least G of each pixel, over all phases it may be and all moduli that
these may have, has a stiffness below every possible one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
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
    """All materials between the least and the greatest moduli."""

    lower: PlaneModuli
    upper: PlaneModuli

    @classmethod
    def of_young(cls, modulus: tuple[float, float], poisson: tuple[float, float]) -> ModuliInterval:
        """Least and greatest plane bulk and shear modulus over intervals of E (Pa) and of ν."""
        # K + G/3 = E/(2 (1 + ν) (1 − 2 ν)) is convex in ν; G decreases
        (young_low, young_high), (nu_low, nu_high) = modulus, poisson
        nu_softest = min(max(nu_low, NU_AT_LEAST_BULK), nu_high)
        least_bulk = PlaneModuli.of_young(young_low, nu_softest).bulk
        least_shear = PlaneModuli.of_young(young_low, nu_high).shear
        greatest_bulk = max(PlaneModuli.of_young(young_high, nu).bulk for nu in poisson)
        greatest_shear = PlaneModuli.of_young(young_high, nu_low).shear
        return cls(PlaneModuli(least_bulk, least_shear), PlaneModuli(greatest_bulk, greatest_shear))


@dataclass(frozen=True)
class ModuliImages:
    """Moduli of each pixel below and above all possible ones, each of shape (rows, columns), in Pa.

    Args:
        bulk: Least and greatest plane-strain bulk modulus K + G/3.
        shear: Least and greatest shear modulus.
    """

    bulk: tuple[Array, Array]
    shear: tuple[Array, Array]

    @property
    def geometric_mean(self) -> ModuliImages:
        """Image of the geometric means of the least and the greatest moduli."""
        bulk, shear = (np.sqrt(low * high) for low, high in (self.bulk, self.shear))
        return ModuliImages((bulk, bulk), (shear, shear))

    def equals(self, images: ModuliImages) -> bool:
        """True if both are the same moduli everywhere."""
        pairs = zip((*self.bulk, *self.shear), (*images.bulk, *images.shear), strict=True)
        return all(np.array_equal(a, b) for a, b in pairs)


def threshold_ranges(grey: Array, thresholds: Sequence[tuple[float, float]]) -> tuple[Rows, Rows]:
    """Least and greatest number of the phase that each pixel may be of, (rows, columns) each.

    A pixel is of phase k if k of the thresholds (least, greatest), rising, are ≤ its grey value.
    """
    least, greatest = np.array(thresholds).reshape(-1, 2).T
    first = np.searchsorted(greatest, grey, side="right")
    last = np.searchsorted(least, grey, side="right")
    return first, last


def moduli_images(first: Rows, last: Rows, phases: Sequence[ModuliInterval]) -> ModuliImages:
    """Least and greatest moduli of each pixel over the phases `first` … `last` it may be of."""
    tables = np.zeros((4, len(phases), len(phases)))  # by first and last
    for code in np.unique(first * len(phases) + last):
        a, b = divmod(int(code), len(phases))
        candidates = phases[a : b + 1]
        tables[:, a, b] = (
            min(phase.lower.bulk for phase in candidates),
            max(phase.upper.bulk for phase in candidates),
            min(phase.lower.shear for phase in candidates),
            max(phase.upper.shear for phase in candidates),
        )
    images = [table[first, last] for table in tables]
    return ModuliImages(bulk=(images[0], images[1]), shear=(images[2], images[3]))
