"""A picture with its phases, ready to be solved."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import product

import numpy as np

from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.rve.image.model import ImageModel
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.rve.image.phase_images import ModuliImages, moduli_images
from alphacut.stochastic.theta.truncated_normal import Array

Level = float | None  # None: the modal values alone
Ranges = Callable[[Level], tuple[Array, Array]]  # → least and greatest phase of each pixel


def cut_at(number: FuzzyNumber, level: Level) -> tuple[float, float]:
    """The cut of a number at a level, or its modal value twice."""
    return (number.modal, number.modal) if level is None else number.cut(level)


@dataclass(frozen=True)
class ImageStudy:
    """An image case ready to be solved.

    Args:
        ranges: Phases that each pixel may be of, at a level.
        pairs: E and ν, or K and G, of each phase.
        young: Whether the pairs are E and ν.
        alpha: Levels, rising.
        model: How it is solved.
        fuzzy_threshold: Whether the phases of the pixels depend on the level.
        names: Name of each phase for people.
    """

    ranges: Ranges
    pairs: tuple[tuple[FuzzyNumber, FuzzyNumber], ...]
    young: bool
    alpha: tuple[float, ...]
    model: ImageModel
    fuzzy_threshold: bool
    names: tuple[str, ...] = ()

    def phases(self, level: Level) -> list[ModuliInterval]:
        """Moduli of each phase at a level."""
        moduli = []
        for pair in self.pairs:
            first, second = (cut_at(number, level) for number in pair)
            if self.young:
                moduli.append(ModuliInterval.of_young(first, second))
            else:
                low, high = (PlaneModuli.of_bulk(first[end], second[end]) for end in (0, 1))
                moduli.append(ModuliInterval(low, high))
        return moduli

    def corners(self, level: float, end: int) -> Iterable[tuple[PlaneModuli, ...]]:
        """Phases with moduli at one end, Poisson's ratios at both ends and half-way."""
        choices = []
        for pair in self.pairs:
            first, second = (cut_at(number, level) for number in pair)
            ratios = sorted({second[0], (second[0] + second[1]) / 2, second[1]})
            young = [PlaneModuli.of_young(first[end], nu) for nu in ratios] if self.young else []
            choices.append(young or [PlaneModuli.of_bulk(first[end], second[end])])
        return product(*choices)

    def images(self, threshold: Level, phases: Level) -> ModuliImages:
        """Least and greatest moduli of each pixel, at levels of threshold and phases."""
        return moduli_images(*self.ranges(threshold), self.phases(phases))

    @property
    def fractions(self) -> Array:
        """Area share of each phase at the modal values; a cut pixel counts half for its ends."""
        ends = self.ranges(None)
        sums = [np.bincount(which.ravel(), minlength=len(self.pairs)) for which in ends]
        return np.asarray((sums[0] + sums[1]) / 2 / ends[0].size)

    @property
    def fuzzy_phases(self) -> bool:
        """Whether the moduli depend on the level."""
        return any(not isinstance(number, Crisp) for pair in self.pairs for number in pair)
