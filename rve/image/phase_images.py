"""Images of moduli, least and greatest, from phases that are not certain.

The stiffness of a composite grows in the Loewner order with the tensor of every point. So the image
of the least K + G/3 and the least G of each pixel, over all phases it may be and all moduli that
these may have, has a stiffness below every possible one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.rve.image.moduli import ModuliInterval


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
    def half_way(self) -> ModuliImages:
        """One image between both: the geometric means of the moduli."""
        bulk, shear = (np.sqrt(low * high) for low, high in (self.bulk, self.shear))
        return ModuliImages((bulk, bulk), (shear, shear))

    def same(self, images: ModuliImages) -> bool:
        """True if both are the same moduli everywhere."""
        pairs = zip((*self.bulk, *self.shear), (*images.bulk, *images.shear), strict=True)
        return all(np.array_equal(a, b) for a, b in pairs)


def threshold_ranges(grey: Array, thresholds: Sequence[tuple[float, float]]) -> tuple[Rows, Rows]:
    """Least and greatest number of each pixel's phase.

    Args:
        grey: Grey values, shape (rows, columns).
        thresholds: Least and greatest value of each threshold, rising; a pixel is of phase k if k
            thresholds are ≤ its grey value.
    """
    first, last = (
        np.searchsorted(np.array([t[end] for t in thresholds]), grey, side="right")
        for end in (1, 0)
    )
    return first, last


def moduli_images(first: Rows, last: Rows, phases: Sequence[ModuliInterval]) -> ModuliImages:
    """Least and greatest moduli of pixels of the phases `first` … `last`."""
    pairs = np.unique(first * len(phases) + last)
    tables = np.zeros((4, len(phases), len(phases)))
    for a, b in (divmod(int(pair), len(phases)) for pair in pairs):
        bulks = [(p.lower.bulk, p.upper.bulk) for p in phases[a : b + 1]]
        shears = [(p.lower.shear, p.upper.shear) for p in phases[a : b + 1]]
        least = np.min([bulks, shears], axis=1)[:, 0]
        greatest = np.max([bulks, shears], axis=1)[:, 1]
        tables[:, a, b] = least[0], greatest[0], least[1], greatest[1]
    images = [table[first, last] for table in tables]
    return ModuliImages((images[0], images[1]), (images[2], images[3]))
