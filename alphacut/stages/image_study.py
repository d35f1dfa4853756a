"""From an image of a cell to its phases, level by level."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from alphacut.case.material import ImageCell
from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import require
from alphacut.rve.image.moduli import ModuliInterval
from alphacut.rve.image.phase_images import ModuliImages, moduli_images, threshold_ranges
from alphacut.rve.image.read import read_grey, require_phases
from alphacut.stochastic.segmentation import segmented

Level = float | None
"""α-level, or None for the modal values alone."""
Ranges = Callable[[Level], tuple[Rows, Rows]]
"""Least and greatest phase of each pixel at a level."""


def cut_at(number: FuzzyNumber, level: Level) -> tuple[float, float]:
    """The cut of a number at a level, or its modal value twice."""
    return (number.modal, number.modal) if level is None else number.cut(level)


@dataclass(frozen=True)
class ImageStudy:
    """An image with its phases, ready to be solved.

    Args:
        cell: The section of the case.
        ranges: Phases that each pixel may be of, at a level.
        fuzzy_threshold: Whether the phases of the pixels depend on the level.
    """

    cell: ImageCell
    ranges: Ranges
    fuzzy_threshold: bool

    @property
    def fuzzy_phases(self) -> bool:
        """True if the moduli depend on the level."""
        return any(number.support.width > 0 for pair in self.cell.pairs for number in pair)

    def images(self, threshold: Level, phases: Level) -> ModuliImages:
        """Least and greatest moduli of each pixel, at levels of threshold and phases."""
        moduli = [
            ModuliInterval.of_young(cut_at(young, phases), cut_at(poisson, phases))
            for young, poisson in self.cell.pairs
        ]
        return moduli_images(*self.ranges(threshold), moduli)

    @property
    def fractions(self) -> dict[str, float]:
        """Area share of each phase at the modal values, dark first."""
        phase = self.ranges(None)[0]
        shares = np.bincount(phase.ravel(), minlength=len(self.cell.pairs)) / phase.size
        if self.cell.labels is not None:
            names = [f"label {label:g}" for label in self.cell.labels]
        else:
            ends = [f"{number.modal:g}" for number in self.cell.threshold or ()]
            between = (f"grey {a} … {b}" for a, b in pairwise(ends))
            names = [f"grey below {ends[0]}", *between, f"grey above {ends[-1]}"]
        return dict(zip(names, map(float, shares), strict=True))


def study_of(cell: ImageCell) -> ImageStudy:
    """The study of an image cell, whose segmentation is judged first.

    Raises:
        RefusedError: Its image cannot be used.
    """
    grey = read_grey(cell.image, square=len(cell.pixel) == 1)
    return _labelled(grey, cell, cell.labels) if cell.labels else _thresholds(grey, cell)


def _thresholds(grey: Array, cell: ImageCell) -> ImageStudy:
    """Phases by thresholds; what noise and light leave open is fuzzy, unless thresholds are."""
    numbers = cell.threshold or ()
    require_phases(grey, tuple(number.cut(0.0) for number in numbers))
    modal = [number.modal for number in numbers]
    judged = segmented(grey, modal)
    judged.require()
    fuzzy = any(number.support.width > 0 for number in numbers)

    def ranges(level: Level) -> tuple[Rows, Rows]:
        if level is not None and not fuzzy:
            return judged.ranges()
        return threshold_ranges(grey, [cut_at(number, level) for number in numbers])

    return ImageStudy(cell, ranges, fuzzy or judged.open > 0)


def _labelled(grey: Array, cell: ImageCell, labels: tuple[float, ...]) -> ImageStudy:
    """Phases of an image whose pixels hold labels."""
    phase = np.full(grey.shape, -1)
    for number, label in enumerate(labels):
        phase[grey == label] = number
    values = {float(x) for x in np.unique(grey)}
    wrong = ", ".join(f"{x:g}" for x in sorted(values ^ set(labels))[:5])
    require(not wrong, "cell.labels", wrong, "every value of the image, and no other")
    return ImageStudy(cell, lambda level: (phase, phase), False)
