"""Images as cells: the phases of pixels or voxels, and the lower and upper moduli of each.

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
from alphacut.base.errors import RefusedError, require

RIGID = 1e18
"""Young's modulus in Pa from which on a phase is taken as rigid."""


@dataclass(frozen=True)
class PhaseModuli:
    """Moduli of an isotropic material, in plane strain or in space.

    Args:
        bulk: Bulk modulus in Pa, 0 of a pore or infinite of a rigid phase. In plane strain it is
            K + G/3, K being that of space.
        shear: Shear modulus G in Pa, 0 or infinite likewise.

    Raises:
        RefusedError: A modulus is so small or large that products of four moduli are no numbers.
    """

    bulk: float
    shear: float

    def __post_init__(self) -> None:
        for name, value in (("bulk", self.bulk), ("shear", self.shear)):
            is_allowed = value in (0.0, math.inf) or 1e-60 < value < 1e60
            allowed = "values in (1e-60, 1e+60) Pa"
            require(is_allowed, f"{name} modulus of a phase", f"{value:g} Pa", allowed)

    @classmethod
    def of_young(cls, modulus: float, poisson: float, dimension: int = 2) -> PhaseModuli:
        """Return the moduli of a Young's modulus in Pa and a Poisson's ratio inside (−1, 0.5).

        Dimension 2 is plane strain. A modulus from `RIGID` on is taken as infinite.
        """
        is_stable = -1 < poisson < 0.5
        require(is_stable, "Poisson's ratio of a phase", poisson, "values in (-1, 0.5)")
        modulus = math.inf if modulus >= RIGID else modulus
        shear = modulus / (2 * (1 + poisson))
        bulk = modulus / (3 * (1 - 2 * poisson))
        return cls(bulk + shear / 3 if dimension == 2 else bulk, shear)


@dataclass(frozen=True)
class ModuliInterval:
    """All materials whose bulk and shear moduli lie between those of two materials."""

    lower: PhaseModuli
    upper: PhaseModuli

    @classmethod
    def of_young(
        cls, modulus: tuple[float, float], poisson: tuple[float, float], dimension: int = 2
    ) -> ModuliInterval:
        """Return the smallest and largest moduli over intervals of E (Pa) and of ν.

        Args:
            modulus: Lower and upper end of Young's modulus.
            poisson: Lower and upper end of Poisson's ratio.
            dimension: 2 for plane strain, 3 for space.
        """
        # At a fixed E the modulus G falls and K rises with ν. K + G/3 = E/(2 (1 + ν) (1 − 2 ν)) is
        # convex in ν and smallest at ν = −1/4; so this ν, moved into the interval, counts as well.
        nearest = min(max(poisson[0], -0.25), poisson[1])
        lower_young, upper_young = modulus
        softest = [PhaseModuli.of_young(lower_young, nu, dimension) for nu in (*poisson, nearest)]
        stiffest = [PhaseModuli.of_young(upper_young, nu, dimension) for nu in (*poisson, nearest)]
        return cls(
            PhaseModuli(min(x.bulk for x in softest), min(x.shear for x in softest)),
            PhaseModuli(max(x.bulk for x in stiffest), max(x.shear for x in stiffest)),
        )


@dataclass(frozen=True)
class ModuliImages:
    """Lower and upper moduli of each cell of a grid, arrays of its shape, in Pa.

    Args:
        bulk: Lower and upper bulk modulus; of pixels that of plane strain, K + G/3.
        shear: Lower and upper shear modulus.
    """

    bulk: tuple[Array, Array]
    shear: tuple[Array, Array]

    @classmethod
    def crisp(cls, bulk: Array, shear: Array) -> ModuliImages:
        """Return images whose lower and upper moduli are the same."""
        return cls((bulk, bulk), (shear, shear))

    @property
    def geometric_mean(self) -> ModuliImages:
        """Image of the geometric means of the lower and the upper moduli."""
        with np.errstate(invalid="ignore"):  # 0 times infinity, which is taken as 0
            means = [
                np.where(lower > 0, np.sqrt(lower * upper), 0)
                for lower, upper in (self.bulk, self.shear)
            ]
        return ModuliImages.crisp(*means)

    def moduli_of_fields(self, end: int) -> tuple[Array, Array] | None:
        """Return the moduli that fields of one side of the bounds are computed with.

        Stiffer phases make a stiffer cell. So the lower bound holds with a rigid phase that is too
        soft, the upper one with a pore that is a little too stiff. Rigid phases take 1e4 times the
        largest finite modulus: a larger factor takes a multiple of the iterations. Pores take 1e-6
        of the smallest one: with a smaller factor iterations grow by its logarithm.

        Args:
            end: 0 for stresses with the lower moduli, where pores keep the modulus 0; 1 for
                displacements with the upper moduli.

        Returns:
            Bulk and shear moduli; None where a rigid phase leaves no displacements to bound from
            above.
        """
        moduli = self.bulk[end], self.shear[end]
        is_upper = end == 1
        if is_upper and any(np.isinf(x).any() for x in moduli):
            return None
        clipped = []
        for values in moduli:
            finite = values[(values > 0) & np.isfinite(values)]
            min_modulus = 1e-6 * finite.min() if is_upper else 0.0
            clipped.append(np.clip(values, min_modulus, 1e4 * finite.max()))
        return clipped[0], clipped[1]

    def equals(self, images: ModuliImages) -> bool:
        """Return whether both are the same moduli everywhere."""
        pairs = zip((*self.bulk, *self.shear), (*images.bulk, *images.shear), strict=True)
        return all(np.array_equal(a, b) for a, b in pairs)


def threshold_ranges(grey: Array, thresholds: Sequence[tuple[float, float]]) -> tuple[Ints, Ints]:
    """Return the lowest and highest number of the phase that each pixel may be of.

    A pixel is of phase k if k of the thresholds are at most its grey value.

    Args:
        grey: Grey values of pixels or voxels, of any shape.
        thresholds: Lower and upper end of each threshold, both rising.
    """
    lower, upper = np.array(thresholds).reshape(-1, 2).T
    first = np.searchsorted(upper, grey, side="right")
    last = np.searchsorted(lower, grey, side="right")
    return first, last


def moduli_images(first: Ints, last: Ints, phases: Sequence[ModuliInterval]) -> ModuliImages:
    """Return the lower and upper moduli of each pixel over all phases it may be of.

    Args:
        first: Lowest number of the phase of each pixel or voxel.
        last: Highest number of it, of the same shape; the phases between are possible as well.
        phases: Moduli of the phases.
    """
    lower = np.array([(phase.lower.bulk, phase.lower.shear) for phase in phases])
    upper = np.array([(phase.upper.bulk, phase.upper.shear) for phase in phases])
    lowest = np.zeros((2, len(phases), len(phases)))  # (bulk or shear modulus, first, last)
    highest = np.zeros_like(lowest)
    for a, b in combinations_with_replacement(range(len(phases)), 2):
        lowest[:, a, b] = lower[a : b + 1].min(axis=0)
        highest[:, a, b] = upper[a : b + 1].max(axis=0)
    min_bulk, min_shear = lowest[:, first, last]
    max_bulk, max_shear = highest[:, first, last]
    return ModuliImages(bulk=(min_bulk, max_bulk), shear=(min_shear, max_shear))


def require_phases(grey: Array, thresholds: Sequence[tuple[float, float]]) -> None:
    """Refuse thresholds that may leave a phase without a pixel.

    Args:
        grey: Grey values of pixels or voxels.
        thresholds: Lower and upper end of each threshold.

    Raises:
        RefusedError: A threshold lies outside the grey values, or no pixel surely lies between two.
    """
    low = float(grey.min())
    high = float(grey.max())
    for lower, upper in thresholds:
        if not (low < lower and upper <= high):
            span = f"{lower:g}" if lower == upper else f"[{lower:g}, {upper:g}]"
            raise RefusedError("threshold", span, f"grey values of the image, {low:g} to {high:g}")
    for (_, end), (start, _) in pairwise(thresholds):
        is_between = (grey >= end) & (grey < start)
        allowed = "rising values with pixels between them"
        require(bool(is_between.any()), "threshold", f"{end:g} and {start:g}", allowed)
