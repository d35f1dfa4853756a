"""Proved bounds of the stiffness of an image, level by level, and what widens them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from alphacut.io.files import say
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.rve.image.model import ImageCut, ImageModel
from alphacut.rve.image.solve import ImageSolution
from alphacut.stages.image.study import ImageStudy, Level
from alphacut.stages.material.cell import GPA, POSITIVE
from alphacut.stochastic.theta.truncated_normal import Array

CURES = {
    "discretisation": "divide the pixels: cell.division or cell.width",
    "threshold": "state cell.threshold more closely",
    "phases": "state the moduli of the phases more closely",
}


@dataclass(frozen=True)
class Contribution:
    """Width of E from one source.

    Args:
        source: A key of `CURES`.
        width: Width of E that it adds to that of crisp inputs, in Pa; of the discretisation, or of
            the pixels that an outline cuts, that width itself.
    """

    source: str
    width: float


def contributions(
    study: ImageStudy, discretisation: float, width: Callable[[Level, Level], float]
) -> tuple[Contribution, ...]:
    """The sources there are, the widest first, by widths of E in Pa: of pixels, and at levels."""
    base, lowest = width(None, None), study.alpha[0]
    widths = {"discretisation": discretisation}
    if study.fuzzy_threshold:
        widths["threshold"] = width(lowest, None) - base
    if study.fuzzy_phases:
        widths["phases"] = width(None, lowest) - base
    rows = (Contribution(source, max(0.0, value)) for source, value in widths.items())
    return tuple(sorted(rows, key=lambda row: -row.width))


MANY = 500_000  # pixels times pairs of solutions, from which on an image may take minutes


@dataclass(frozen=True)
class FuzzyImage:
    """Bounds of an image at every level.

    Args:
        study: What was solved.
        model: Its model, with the division taken.
        crisp: Periodic bounds at the modal values.
        cuts: One for each level of the study, rising.
        contributions: Widths of E by source, the widest first.
        seconds: Wall time.
    """

    study: ImageStudy
    model: ImageModel
    crisp: ImageSolution
    cuts: tuple[ImageCut, ...]
    contributions: tuple[Contribution, ...]
    seconds: float

    @property
    def top(self) -> ImageCut:
        """The cut at the highest level."""
        return self.cuts[-1]

    @property
    def phase(self) -> Array:
        """Number of each pixel's phase at the modal values, shape (rows, columns)."""
        return np.asarray(np.add(*self.study.ranges(None)) / 2)


def solutions(study: ImageStudy) -> tuple[int, float]:
    """Pairs of solutions for bounds, and their time over that of the first, which is periodic.

    They are at the modal values, on levels, and for each fuzzy source.
    """
    sources = study.fuzzy_threshold + study.fuzzy_phases
    cuts = len(study.alpha) + sources if sources else 0
    return 1 + cuts, 1.0 + cuts


class Told:
    """Progress of some pairs of solutions: by what is done, and within one by the time spent."""

    def __init__(self, tick: Tick, work: float) -> None:
        self.tick, self.work = tick, work
        self.began, self.first, self.share = perf_counter(), math.inf, 0.0

    @property
    def seconds(self) -> float:
        """Time since the start."""
        return perf_counter() - self.began

    def done(self, share: float) -> None:
        """Tell a share that is reached."""
        self.share = share
        self.tick(share)

    def still(self) -> None:
        """Tell that a solution goes on; the time of the first one tells how far the others are."""
        self.tick(max(self.share, min(self.seconds / self.first / self.work, 0.99)))


def compute(study: ImageStudy, *, progress: Tick | None = None) -> FuzzyImage:
    """Bounds at every level, and what widens them.

    Raises:
        BadInput: The image cannot give what the case asks for.
    """
    try:
        return _computed(study, progress)
    except ValueError as error:
        raise BadInput.of("cell", str(error)) from None


def _computed(study: ImageStudy, progress: Tick | None) -> FuzzyImage:
    modal, (count, work) = study.images(None, None), solutions(study)
    told = Told(progress or (lambda share: None), work)
    pixels = f"image of {modal.bulk[0].size} pixels: {count} pairs of solutions"
    several = progress is not None and count > 1
    if several and modal.bulk[0].size * work > MANY:
        say(f"{pixels}, or more where pixels are divided: this may take minutes")
    watched = replace(study.model.solver, watch=told.still)
    start = replace(study.model, solver=watched)
    model, crisp = start.refined(modal)
    told.done(1 / work)
    told.first = first = told.seconds
    if several:
        say(f"{pixels}, the first took {first:.0f} s, all about {work * first:.0f} s or more")
    levels = [study.images(level, level) for level in study.alpha]
    cuts = tuple(model.cuts(levels, (modal, crisp)))
    told.done(max(0.7, told.share))

    def width(threshold: Level, phases: Level) -> float:
        (cut,) = model.cuts([study.images(threshold, phases)], (modal, crisp))
        return cut.modulus[1] - cut.modulus[0]

    low, high = crisp.bounds.young(model.average)
    rows = contributions(study, high - low, width)
    if not (least := cuts[0].modulus[0] / GPA) > 0:
        what = f"E has no bound above {least:.3g} GPa, and no structure takes that"
        say(f"warning: cell: {what}: {POSITIVE}")
    told.done(1.0)
    return FuzzyImage(study, model, crisp, cuts, rows, told.seconds)
