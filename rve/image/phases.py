"""Images as cells: the phases of pixels or voxels, and the least and greatest moduli of each.

The stiffness of a composite grows in the Loewner order with the tensor of every point. So the image
of the least K + G/3 and the least G of each pixel, over all phases it may be and all moduli that
these may have, has a stiffness below every possible one.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError

MIN_MODULUS, MAX_MODULUS = 1e-60, 1e60  # Pa; products of four moduli must be numbers
RIGID = 1e18  # Young's modulus in Pa from which on a phase is taken as rigid
PORE_RATIO, RIGID_RATIO = 1e-6, 1e4
"""Moduli that fields take for a pore and a rigid phase, over the least and the greatest of others:
more for rigid ones takes a multiple of the iterations, which for pores grow by the logarithm."""
NU_AT_LEAST_BULK = -0.25  # Poisson's ratio of the least plane-strain bulk modulus at a fixed E


@dataclass(frozen=True)
class PhaseModuli:
    """Moduli of an isotropic material, in plane strain or in space.

    Args:
        bulk: Bulk modulus in Pa, from `MIN_MODULUS` to `MAX_MODULUS`, 0 of a pore or infinite of a
            rigid phase: of plane strain K + G/3, K being that of space.
        shear: Shear modulus G, in Pa, of the same range.

    Raises:
        RefusedError: A modulus lies outside its range.
    """

    bulk: float
    shear: float

    def __post_init__(self) -> None:
        """Refuse moduli outside (`MIN_MODULUS`, `MAX_MODULUS`)."""
        for name, value in (("bulk", self.bulk), ("shear", self.shear)):
            if value not in (0.0, math.inf) and not MIN_MODULUS < value < MAX_MODULUS:
                allowed = f"values in ({MIN_MODULUS:g}, {MAX_MODULUS:g}) Pa"
                raise RefusedError(f"{name} modulus of a phase", f"{value:g} Pa", allowed)

    @classmethod
    def of_young(cls, modulus: float, poisson: float, dimension: int = 2) -> PhaseModuli:
        """From Young's modulus in Pa and Poisson's ratio, inside (−1, 0.5); 2 is plane strain.

        A modulus from `RIGID` on is infinite.
        """
        if not -1 < poisson < 0.5:
            raise RefusedError("Poisson's ratio of a phase", poisson, "values in (-1, 0.5)")
        modulus = math.inf if modulus >= RIGID else modulus
        shear = modulus / (2 * (1 + poisson))
        bulk = modulus / (3 * (1 - 2 * poisson))
        return cls(bulk + shear / 3 if dimension == 2 else bulk, shear)


@dataclass(frozen=True)
class ModuliInterval:
    """All materials between the least and the greatest moduli."""

    lower: PhaseModuli
    upper: PhaseModuli

    @classmethod
    def of_young(
        cls, modulus: tuple[float, float], poisson: tuple[float, float], dimension: int = 2
    ) -> ModuliInterval:
        """Least and greatest bulk and shear modulus over intervals of E (Pa) and of ν."""
        # K + G/3 = E/(2 (1 + ν) (1 − 2 ν)) is convex in ν; K increases with it, G decreases
        ratios = *poisson, min(max(poisson[0], NU_AT_LEAST_BULK), poisson[1])
        softest, stiffest = (
            [PhaseModuli.of_young(young, nu, dimension) for nu in ratios] for young in modulus
        )
        return cls(
            PhaseModuli(min(x.bulk for x in softest), min(x.shear for x in softest)),
            PhaseModuli(max(x.bulk for x in stiffest), max(x.shear for x in stiffest)),
        )


@dataclass(frozen=True)
class ModuliImages:
    """Moduli of each cell of a grid below and above all possible ones, of its shape, in Pa.

    Args:
        bulk: Least and greatest bulk modulus; of pixels that of plane strain, K + G/3.
        shear: Least and greatest shear modulus.
    """

    bulk: tuple[Array, Array]
    shear: tuple[Array, Array]

    @property
    def geometric_mean(self) -> ModuliImages:
        """Image of the geometric means of the least and the greatest moduli."""
        with np.errstate(invalid="ignore"):  # 0 times infinity, which is taken as 0
            bulk, shear = (
                np.where(low > 0, np.sqrt(low * high), 0) for low, high in (self.bulk, self.shear)
            )
        return ModuliImages((bulk, bulk), (shear, shear))

    def moduli_of_fields(self, end: int) -> tuple[Array, Array] | None:
        """Bulk and shear moduli for stresses (end 0) or displacements (1); None if none bounds.

        Rigid phases leave no displacement to bound from above. The lower bound holds with a rigid
        phase too soft, the upper one with a pore a little too stiff, since stiffer phases make a
        stiffer cell. For stresses pores keep the modulus 0.
        """
        moduli = self.bulk[end], self.shear[end]
        if end and any(np.isinf(x).any() for x in moduli):
            return None
        clipped = []
        for values in moduli:
            finite = values[(values > 0) & np.isfinite(values)]
            least = PORE_RATIO * finite.min() if end else 0.0
            clipped.append(np.clip(values, least, RIGID_RATIO * finite.max()))
        return clipped[0], clipped[1]

    def equals(self, images: ModuliImages) -> bool:
        """True if both are the same moduli everywhere."""
        pairs = zip((*self.bulk, *self.shear), (*images.bulk, *images.shear), strict=True)
        return all(np.array_equal(a, b) for a, b in pairs)


def threshold_ranges(grey: Array, thresholds: Sequence[tuple[float, float]]) -> tuple[Ints, Ints]:
    """Least and greatest number of the phase that each pixel may be of, (rows, columns) each.

    A pixel is of phase k if k of the thresholds (lower, upper), rising, are ≤ its grey value.
    """
    lower, upper = np.array(thresholds).reshape(-1, 2).T
    first = np.searchsorted(upper, grey, side="right")
    last = np.searchsorted(lower, grey, side="right")
    return first, last


def moduli_images(first: Ints, last: Ints, phases: Sequence[ModuliInterval]) -> ModuliImages:
    """Least and greatest moduli of each pixel over the phases `first` … `last` it may be of."""
    lower, upper = (
        np.array([(end.bulk, end.shear) for end in ends])
        for ends in ([phase.lower for phase in phases], [phase.upper for phase in phases])
    )
    tables = np.zeros((2, 2, len(phases), len(phases)))  # (modulus, end, first, last)
    for a, b in combinations_with_replacement(range(len(phases)), 2):
        tables[:, 0, a, b] = lower[a : b + 1].min(axis=0)
        tables[:, 1, a, b] = upper[a : b + 1].max(axis=0)
    (bulk_low, bulk_high), (shear_low, shear_high) = tables[..., first, last]
    return ModuliImages(bulk=(bulk_low, bulk_high), shear=(shear_low, shear_high))


def require_phases(grey: Array, thresholds: tuple[tuple[float, float], ...]) -> None:
    """Refuse thresholds (lower, upper), rising, that may leave a phase without a pixel."""
    low, high = float(grey.min()), float(grey.max())
    for lower, upper in thresholds:
        if not (low < lower and upper <= high):
            span = f"{lower:g}" if lower == upper else f"[{lower:g}, {upper:g}]"
            raise RefusedError("threshold", span, f"grey values of the image, {low:g} to {high:g}")
    for (_, lower), (upper, _) in pairwise(thresholds):  # of the pixels surely between both
        if not ((grey >= lower) & (grey < upper)).any():
            what = f"{lower:g} and {upper:g}"
            raise RefusedError("threshold", what, "rising values with pixels between them")
