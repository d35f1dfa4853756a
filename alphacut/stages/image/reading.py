"""From the section [cell] of a case to a picture with its phases."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.case.case import Case
from alphacut.case.sections.picture import Picture
from alphacut.fuzzy import Crisp
from alphacut.fuzzy.arrays import Array, Rows
from alphacut.io.problem import BadInput, Problem
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageModel
from alphacut.rve.image.phase_images import threshold_ranges
from alphacut.stages.image.phases import phase_names
from alphacut.stages.image.study import ImageStudy, Level, Ranges, cut_at
from alphacut.stochastic.segmentation import segmented

ACCURACY = 1e-5  # relative energy that the solver may leave; a width asked for takes less


def study_of(case: Case) -> ImageStudy:
    """The study that a case describes.

    Raises:
        BadInput: Its picture cannot be used.
    """
    given = case.picture
    first, second = given.pairs
    try:
        parted = _image(case, str(given.image))
        return ImageStudy(
            parted.ranges,
            tuple(zip(first, second, strict=True)),
            given.modulus is not None,
            case.modulus.alpha,
            _model(given, parted.aspect, case.modulus.average),
            parted.fuzzy,
            phase_names(given, len(first)),
        )
    except ValueError as error:
        raise BadInput(case.located(Problem("cell.image", str(error)))) from None


@dataclass(frozen=True)
class Parted:
    """Pixels parted into phases.

    Args:
        ranges: Phases that each pixel may be of, at a level.
        aspect: Height of a pixel over its width.
        fuzzy: Whether they depend on the level.
    """

    ranges: Ranges
    aspect: float
    fuzzy: bool = False


def _model(given: Picture, aspect: float, average: str) -> ImageModel:
    accuracy = ACCURACY if given.width is None else min(ACCURACY, given.width / 100)
    return ImageModel(
        aspect,
        division=given.division,
        solver=ConjugateGradient(accuracy),
        width=given.width,
        average=average,
    )


def _image(case: Case, file: str) -> Parted:
    """Phases of an image file."""
    from alphacut.rve.image.read import read_grey, require_phases

    given, pixel = case.picture, case.picture.pixel
    assert pixel is not None  # an image has pixels, or the case is refused
    grey = read_grey(case.beside(file), division=given.division or 1, square=len(pixel) == 1)
    aspect = pixel[-1] / pixel[0]
    if given.labels is not None:
        phase = _labelled(grey, given.labels)
        return Parted(lambda level: (phase, phase), aspect)
    thresholds = given.threshold or ()
    uncertain = [number for number in thresholds if not isinstance(number, Crisp)]
    require_phases(grey, tuple(number.cut(0.0) for number in thresholds))
    judged = segmented(grey, [t.modal for t in thresholds], smooth=given.smooth, level=given.level)
    judged.require()
    moved = [new - t.modal for new, t in zip(judged.thresholds, thresholds, strict=True)]

    def ranges(level: Level) -> tuple[Rows, Rows]:
        """What noise and light leave open, unless the thresholds are stated as fuzzy."""
        if level is not None and not uncertain:
            return judged.ranges()
        cuts = (cut_at(number, level) for number in thresholds)
        pairs = [(low + by, high + by) for (low, high), by in zip(cuts, moved, strict=True)]
        return threshold_ranges(judged.grey, pairs)

    return Parted(ranges, aspect, bool(uncertain) or judged.open > 0)


def _labelled(grey: Array, labels: tuple[float, ...]) -> Array:
    """Number of each pixel's phase."""
    phase = np.full(grey.shape, -1)
    for number, label in enumerate(labels):
        phase[grey == label] = number
    if (phase < 0).any():
        stranger = grey[phase < 0].flat[0]
        raise ValueError(f"a pixel holds {stranger:g}, which is none of cell.labels")
    if missing := set(range(len(labels))) - set(np.unique(phase)):
        raise ValueError(f"no pixel holds the label {labels[min(missing)]:g}")
    return phase
