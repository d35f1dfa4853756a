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

    Args:
        grey: Grey values, shape (rows, columns).
        thresholds: Least and greatest value of each threshold, rising; a pixel is of phase k if k
            thresholds are ≤ its grey value.
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
