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
from typing import Protocol

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError, require

RIGID = 1e18
"""Young's modulus in Pa, or conductivity, from which on a phase is rigid or conducts perfectly."""


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
        """RefusedError unless each modulus is 0, infinite or inside (1e-60, 1e60) Pa."""
        for name, value in (("bulk", self.bulk), ("shear", self.shear)):
            is_allowed = value in (0.0, math.inf) or 1e-60 < value < 1e60
            allowed = "values in (1e-60, 1e+60) Pa"
            require(is_allowed, f"{name} modulus of a phase", f"{value:g} Pa", allowed)

    @classmethod
    def of_young(cls, modulus: float, poisson: float, dimension: int = 2) -> PhaseModuli:
        """Return the bulk and shear modulus of an isotropic material.

        Args:
            modulus: Young's modulus E in Pa; 0 is a pore, 1e18 and more is rigid, with infinite
                moduli.
            poisson: Poisson's ratio ν, inside (−1, 0.5).
            dimension: 2 for plane strain, whose bulk modulus is K + G/3; 3 for space.

        Raises:
            RefusedError: ν lies outside, or E is negative or so small or large that a modulus is
                outside (1e-60, 1e60) Pa.
        """
        is_stable = -1 < poisson < 0.5
        require(is_stable, "Poisson's ratio of a phase", poisson, "values in (-1, 0.5)")
        if modulus >= RIGID:
            modulus = math.inf
        shear = modulus / (2 * (1 + poisson))
        bulk = modulus / (3 * (1 - 2 * poisson))
        if dimension == 2:
            bulk += shear / 3
        return cls(bulk, shear)


@dataclass(frozen=True)
class ModuliInterval:
    """All materials whose bulk and shear moduli lie between those of two materials."""

    lower: PhaseModuli
    upper: PhaseModuli

    @property
    def moduli(self) -> Array:
        """Lower and upper bulk and shear modulus, shape (2, 2)."""
        return np.array([(end.bulk, end.shear) for end in (self.lower, self.upper)])

    @classmethod
    def of_young(
        cls, modulus: tuple[float, float], poisson: tuple[float, float], dimension: int = 2
    ) -> ModuliInterval:
        """Return the smallest and largest bulk and shear moduli over intervals of E and of ν.

        Args:
            modulus: Lower and upper end of Young's modulus E in Pa; 0 is a pore, 1e18 and more is
                rigid.
            poisson: Lower and upper end of Poisson's ratio ν, inside (−1, 0.5).
            dimension: 2 for plane strain, whose bulk modulus is K + G/3; 3 for space.

        Returns:
            The moduli `lower` and `upper`; the bulk and the shear modulus of each need not belong
            to the same ν.

        Raises:
            RefusedError: ν lies outside, or a modulus is negative or outside (1e-60, 1e60) Pa.
        """
        # At a fixed E the modulus G falls and K rises with ν. K + G/3 = E/(2 (1 + ν) (1 − 2 ν)) is
        # convex in ν and smallest at ν = −1/4; so this ν, moved into the interval, counts as well.
        lowest, highest = poisson
        ratios = lowest, highest, min(max(lowest, -0.25), highest)
        softest, stiffest = (
            [PhaseModuli.of_young(young, nu, dimension) for nu in ratios] for young in modulus
        )
        return cls(
            PhaseModuli(min(x.bulk for x in softest), min(x.shear for x in softest)),
            PhaseModuli(max(x.bulk for x in stiffest), max(x.shear for x in stiffest)),
        )


@dataclass(frozen=True)
class ConductivityInterval:
    """All materials whose conductivity lies between two numbers of one unit.

    Args:
        lower: The lower one; 0 of an insulator, 1e18 and more of a perfect conductor.
        upper: The upper one, not below it.

    Raises:
        RefusedError: A number is neither 0 nor inside (1e-60, 1e60) nor infinite.
    """

    lower: float
    upper: float

    def __post_init__(self) -> None:
        """RefusedError unless each number is 0, inside (1e-60, 1e60) or infinite."""
        for value in (self.lower, self.upper):
            is_allowed = value in (0.0, math.inf) or 1e-60 < value < 1e60
            what = "conductivity of a phase"
            require(is_allowed, what, f"{value:g}", "0, or values in (1e-60, 1e+60)")

    @property
    def moduli(self) -> Array:
        """Both numbers, infinite from 1e18 on, shape (2, 1)."""
        ends = np.array([[self.lower], [self.upper]], float)
        return np.where(ends >= RIGID, math.inf, ends)


class PhaseInterval(Protocol):
    """All materials that a phase may be of."""

    @property
    def moduli(self) -> Array:
        """Lower and upper ends of its moduli, shape (2, moduli)."""


@dataclass(frozen=True, eq=False)
class ModuliImages:
    """Lower and upper moduli of each cell of a grid.

    Args:
        lower: Lower bulk and shear modulus in Pa, shape (2, *grid); the bulk modulus of pixels is
            that of plane strain, K + G/3. Or the lower conductivity, shape (1, *grid).
        upper: The upper ones, of the same shape.
    """

    lower: Array
    upper: Array

    @classmethod
    def crisp(cls, bulk: Array, shear: Array) -> ModuliImages:
        """Return images whose lower and upper moduli are the same."""
        moduli = np.stack([bulk, shear])
        return cls(moduli, moduli)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid."""
        return self.lower.shape[1:]

    @property
    def geometric_mean(self) -> ModuliImages:
        """Image of the geometric means of the lower and the upper moduli."""
        with np.errstate(invalid="ignore"):  # 0 times infinity, which is taken as 0
            means = np.where(self.lower > 0, np.sqrt(self.lower * self.upper), 0)
        return ModuliImages(means, means)

    def moduli_of_fields(self, *, dual: bool) -> Array | None:
        """Return the moduli that fields of one side of the bounds are computed with.

        Stiffer phases make a stiffer cell. So the lower bound holds with a rigid phase that is too
        soft, and the upper one with a modulus that is a little too large. For stresses rigid phases
        take 1e4 times the largest finite modulus; more would multiply the iterations. Pores keep
        the modulus 0; of displacements a phase with one modulus of 0 alone takes 1e-6 of the
        smallest one of the others.

        The same holds for fluxes, temperatures, and phases of infinite conductivity.

        Args:
            dual: True for stresses and fluxes, which take the lower moduli and prove the lower
                bound. False for displacements and temperatures, which
                take the upper moduli and prove the upper bound.

        Returns:
            Moduli of the shape of `lower`. None for displacements beside a rigid phase, or
            temperatures beside a perfect conductor: there is no upper bound.

        Raises:
            RefusedError: No modulus is positive and finite.
        """
        moduli = self.lower if dual else self.upper
        if not dual and np.isinf(moduli).any():
            return None
        clipped = np.empty_like(moduli)
        for k in range(len(moduli)):
            values = moduli[k]
            finite = values[(values > 0) & np.isfinite(values)]
            allowed = "some phase that cannot be a pore or rigid"
            require(finite.size > 0, "modulus of the phases", "0 or infinite throughout", allowed)
            clipped[k] = np.minimum(values, 1e4 * finite.max())
            if not dual:
                clipped[k] = np.maximum(clipped[k], 1e-6 * finite.min())
        if not dual:
            clipped[:, ~moduli.any(axis=0)] = 0.0
        return clipped

    def equals(self, images: ModuliImages) -> bool:
        """Return whether both are the same moduli everywhere."""
        is_lower_same = np.array_equal(self.lower, images.lower)
        return is_lower_same and np.array_equal(self.upper, images.upper)


def threshold_ranges(grey: Array, thresholds: Sequence[tuple[float, float]]) -> tuple[Ints, Ints]:
    """Return the lowest and the highest number of the phase that each pixel may be of.

    A pixel is of phase k if k of the thresholds are at most its grey value. Each threshold is known
    within an interval.

    Args:
        grey: Grey values of pixels or voxels, of any shape.
        thresholds: Lower and upper end of each threshold; the lower ends ascend from threshold to
            threshold, and so do the upper ones. Without thresholds all pixels are of phase 0.

    Returns:
        Lowest and highest number, two arrays of the shape of `grey`.
    """
    # A threshold is surely at most the grey value if its upper end is, and possibly if its lower
    # end is.
    lower, upper = np.array(thresholds).reshape(-1, 2).T
    first = np.searchsorted(upper, grey, side="right")
    last = np.searchsorted(lower, grey, side="right")
    return first, last


def moduli_images(first: Ints, last: Ints, phases: Sequence[PhaseInterval]) -> ModuliImages:
    """Return the lower and upper moduli of each pixel or voxel over all phases that it may be of.

    Args:
        first: Lowest number, from 0, of the phase of each pixel or voxel, shape (y, x) or (z, y,
            x).
        last: Highest number of it, of the same shape and not below `first`. All phases between both
            are possible as well.
        phases: Smallest and largest moduli of each phase, in the order of the numbers.

    Returns:
        Moduli: `lower`, the smallest of the possible phases, and `upper`, the largest of them, each
        of shape (moduli, y, x) or (moduli, z, y, x). Bulk and shear modulus of a pixel need not be
        those of the same phase.
    """
    lower = np.array([phase.moduli[0] for phase in phases])
    upper = np.array([phase.moduli[1] for phase in phases])
    # Few pairs of a first and a last phase exist: their extremes are looked up by pixel. Phases
    # need not be ordered by their moduli.
    lowest = np.zeros((lower.shape[1], len(phases), len(phases)))  # (modulus, first, last)
    highest = np.zeros_like(lowest)
    for a, b in combinations_with_replacement(range(len(phases)), 2):
        lowest[:, a, b] = lower[a : b + 1].min(axis=0)
        highest[:, a, b] = upper[a : b + 1].max(axis=0)
    return ModuliImages(lowest[:, first, last], highest[:, first, last])


def require_phases(grey: Array, thresholds: Sequence[tuple[float, float]]) -> None:
    """Refuse thresholds that may leave a phase without a pixel.

    Every pixel whose grey value is at least a threshold is of the next phase.

    Args:
        grey: Grey values of pixels or voxels, of any shape but empty.
        thresholds: Lower and upper end of each threshold, in the order of the phases. Without any
            the function does nothing.

    Raises:
        RefusedError: Some threshold may be at most the smallest grey value or above the largest
            one, or there is no pixel that lies surely between two thresholds that follow one
            another.
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
