"""From an image of a cell to its phases, level by level."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from alphacut.fuzzy import FuzzyNumber
from alphacut.fuzzy.arrays import Array, Rows
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageModel
from alphacut.rve.image.moduli import ModuliInterval
from alphacut.rve.image.phase_images import ModuliImages, moduli_images, threshold_ranges
from alphacut.rve.image.read import read_grey, require_phases
from alphacut.stochastic.segmentation import segmented

if TYPE_CHECKING:
    from alphacut.case.material import ImageCell

ACCURACY = 1e-5
"""Relative energy that the solver may leave."""
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
        alpha: Levels, rising.
        model: Solution of the fields.
        fuzzy_threshold: Whether the phases of the pixels depend on the level.
    """

    cell: ImageCell
    ranges: Ranges
    alpha: tuple[float, ...]
    model: ImageModel
    fuzzy_threshold: bool

    @property
    def fuzzy_phases(self) -> bool:
        """True if the moduli depend on the level."""
        return any(number.support.width > 0 for pair in self.cell.pairs for number in pair)

    def phases(self, level: Level) -> list[ModuliInterval]:
        """Moduli of each phase at a level."""
        return [
            ModuliInterval.of_young(cut_at(young, level), cut_at(poisson, level))
            for young, poisson in self.cell.pairs
        ]

    def images(self, threshold: Level, phases: Level) -> ModuliImages:
        """Least and greatest moduli of each pixel, at levels of threshold and phases."""
        return moduli_images(*self.ranges(threshold), self.phases(phases))

    @property
    def fractions(self) -> Array:
        """Area share of each phase at the modal values."""
        phase = self.ranges(None)[0]
        return np.bincount(phase.ravel(), minlength=len(self.cell.pairs)) / phase.size

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each phase, dark first."""
        if self.cell.labels is not None:
            return tuple(f"label {label:g}" for label in self.cell.labels)
        ends = [f"{number.modal:g}" for number in self.cell.threshold or ()]
        between = (f"grey {a} … {b}" for a, b in pairwise(ends))
        return f"grey below {ends[0]}", *between, f"grey above {ends[-1]}"


def study_of(cell: ImageCell, alpha: tuple[float, ...], average: str) -> ImageStudy:
    """The study of an image cell, whose segmentation is judged first.

    Args:
        cell: The section of the case.
        alpha: Levels, rising.
        average: What E and ν are of.

    Raises:
        RefusedError: Its image cannot be used.
    """
    try:
        grey = read_grey(cell.image, square=len(cell.pixel) == 1)
        ranges, fuzzy = _labelled(grey, cell.labels) if cell.labels else _thresholds(grey, cell)
        aspect, solver = cell.pixel[-1] / cell.pixel[0], ConjugateGradient(ACCURACY)
        model = ImageModel(aspect, solver=solver, average=average)
        return ImageStudy(cell, ranges, alpha, model, fuzzy)
    except RefusedError:
        raise
    except ValueError as error:
        raise RefusedError("cell.image", cell.image.name, "an image", str(error)) from None


def _thresholds(grey: Array, cell: ImageCell) -> tuple[Ranges, bool]:
    """Phases by thresholds; what noise and light leave open is fuzzy, unless thresholds are."""
    numbers = cell.threshold or ()
    require_phases(grey, tuple(number.cut(0.0) for number in numbers))
    modal = [number.modal for number in numbers]
    judged = segmented(grey, modal, smooth=cell.smooth, level=cell.level)
    judged.require()
    moved = [new - old for new, old in zip(judged.thresholds, modal, strict=True)]
    fuzzy = any(number.support.width > 0 for number in numbers)

    def ranges(level: Level) -> tuple[Rows, Rows]:
        if level is not None and not fuzzy:
            return judged.ranges()
        cuts = (cut_at(number, level) for number in numbers)
        pairs = [(low + by, high + by) for (low, high), by in zip(cuts, moved, strict=True)]
        return threshold_ranges(judged.grey, pairs)

    return ranges, fuzzy or judged.open > 0


def _labelled(grey: Array, labels: tuple[float, ...]) -> tuple[Ranges, bool]:
    """Phases of an image whose pixels hold labels.

    Raises:
        RefusedError: A pixel holds another value, or a label is nowhere.
    """
    phase = np.full(grey.shape, -1)
    for number, label in enumerate(labels):
        phase[grey == label] = number
    values = {float(x) for x in np.unique(grey)}
    if values != set(labels):
        wrong = ", ".join(f"{x:g}" for x in sorted(values ^ set(labels))[:5])
        raise RefusedError("cell.labels", wrong, "every value of the image, and no other")
    return (lambda level: (phase, phase)), False
