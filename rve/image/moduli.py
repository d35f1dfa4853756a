"""Elastic moduli of the phases of an image, as values and as intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

LEAST, GREATEST = 1e-60, 1e60  # Pa; products of four moduli must be numbers
SOFTEST = -0.25  # Poisson's ratio of the least plane-strain bulk modulus at a given E


@dataclass(frozen=True)
class PlaneModuli:
    """Moduli of an isotropic material in plane strain.

    Args:
        bulk: Plane-strain bulk modulus K + G/3, in Pa, from `LEAST` to `GREATEST`; K is that of
            three dimensions.
        shear: Shear modulus G, in Pa, of the same range.

    Raises:
        ValueError: A modulus lies outside its range.
    """

    bulk: float
    shear: float

    def __post_init__(self) -> None:
        for name, value in (("plane-strain bulk", self.bulk), ("shear", self.shear)):
            if not LEAST < value < GREATEST:
                raise ValueError(
                    f"the {name} modulus of a phase is {value:g} Pa; it must lie inside"
                    f" ({LEAST:g}, {GREATEST:g}) Pa"
                )

    @classmethod
    def of_young(cls, modulus: float, poisson: float) -> PlaneModuli:
        """From Young's modulus in Pa and Poisson's ratio, inside (−1, 0.5)."""
        if not -1 < poisson < 0.5:
            raise ValueError(
                f"Poisson's ratio of a phase is {poisson:g}; it must lie inside (-1, 0.5)"
            )
        return cls.of_bulk(modulus / (3 * (1 - 2 * poisson)), modulus / (2 * (1 + poisson)))

    @classmethod
    def of_bulk(cls, bulk: float, shear: float) -> PlaneModuli:
        """From the bulk modulus K of three dimensions and the shear modulus, in Pa."""
        if not bulk > 0:
            raise ValueError(f"the bulk modulus of a phase is {bulk:g} Pa; it must be positive")
        return cls(bulk + shear / 3, shear)

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
        upper: Greatest moduli.
        attained: Both ends are materials that can occur; else the interval only encloses them (a
            fuzzy Poisson's ratio).

    Raises:
        ValueError: The ends are the wrong way round.
    """

    lower: PlaneModuli
    upper: PlaneModuli
    attained: bool = True

    def __post_init__(self) -> None:
        if not (self.lower.bulk <= self.upper.bulk and self.lower.shear <= self.upper.shear):
            raise ValueError("the interval of a phase's moduli runs backwards")

    @classmethod
    def crisp(cls, moduli: PlaneModuli) -> ModuliInterval:
        """The interval of one material."""
        return cls(moduli, moduli)

    @classmethod
    def of_young(cls, modulus: tuple[float, float], poisson: tuple[float, float]) -> ModuliInterval:
        """Enclosure of all E and ν in intervals; with ν the shear modulus falls."""
        (soft, stiff), (low, high) = modulus, poisson
        least = min(max(low, SOFTEST), high)  # where E / (2 (1 + ν) (1 − 2 ν)) is least in ν
        bulks = [PlaneModuli.of_young(stiff, nu).bulk for nu in poisson]
        lower = PlaneModuli(
            PlaneModuli.of_young(soft, least).bulk, PlaneModuli.of_young(soft, high).shear
        )
        upper = PlaneModuli(max(bulks), PlaneModuli.of_young(stiff, low).shear)
        return cls(lower, upper, attained=low == high)


def grain_modulus(
    fractions: Sequence[float], softest: Sequence[PlaneModuli], stiffest: Sequence[PlaneModuli]
) -> tuple[float, float]:
    """Bounds of Young's modulus of an isotropic solid of grains, in Pa.

    An image read as plane strain is the section of a prismatic material: fibres. If its particles
    are grains, this interval bounds what the solid can be (Hashin and Shtrikman 1963; Walpole 1966
    where the phases have no order).

    Args:
        fractions: Share of each phase, sum 1.
        softest: Least moduli of each phase.
        stiffest: Greatest moduli of each phase.
    """
    ends = []
    for phases, pick in ((softest, min), (stiffest, max)):
        pairs = [(p.bulk - p.shear / 3, p.shear) for p in phases]
        bulk, shear = pick(k for k, _ in pairs), pick(g for _, g in pairs)
        about_bulk = 4 / 3 * shear
        about_shear = shear * (9 * bulk + 8 * shear) / (6 * (bulk + 2 * shear))
        k, g = (
            1 / sum(f / (value + around) for f, value in zip(fractions, values, strict=True))
            - around
            for values, around in (
                ([k for k, _ in pairs], about_bulk),
                ([g for _, g in pairs], about_shear),
            )
        )
        ends.append(9 * k * g / (3 * k + g))
    return ends[0], ends[1]
