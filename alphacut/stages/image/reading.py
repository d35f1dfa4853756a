"""From the section [cell] of a case to a picture with its phases."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.case.case import Case
from alphacut.case.sections.picture import Picture
from alphacut.fuzzy import Crisp
from alphacut.io.problem import BadInput, Problem
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.solver import Solver
from alphacut.rve.image.model import ImageModel
from alphacut.rve.image.phase_images import threshold_ranges
from alphacut.rve.image.random_threshold import ordered
from alphacut.rve.image.windows import tiles_of
from alphacut.stages.image.phases import phase_names
from alphacut.stages.image.study import ImageStudy, RandomThreshold, Ranges, cut_at
from alphacut.stochastic.theta.truncated_normal import Array

ACCURACY = 1e-5  # relative energy that the solver may leave; a width asked for takes less


def study_of(case: Case, *, petsc: Mapping[str, str] | None = None) -> ImageStudy:
    """The study that a case describes, solved with PETSc where there are options of it.

    Raises:
        BadInput: Its picture cannot be used.
    """
    given = case.picture
    source = f"cell.{given.sources[0]}"
    first, second = given.pairs
    try:
        parted = _outline(case) if given.image is None else _image(case, given.image)
        source = "cell.size" if given.pixel is None else "cell.pixel"
        study = ImageStudy(
            parted.ranges,
            tuple(zip(first, second, strict=True)),
            given.modulus is not None,
            case.modulus.alpha,
            _model(given, parted.aspect, petsc or {}),
            parted.fuzzy,
            parted.random,
            phase_names(given, len(first)),
        )
        if study.model.boundary == "window":
            source = "cell.tiles"
            tiles_of(study.ranges(None)[0], study.model.tiles)
        source = "cell.bulk" if given.modulus is None else "cell.modulus"
        phases = study.phases(study.alpha[0])
        if study.random is not None:
            source = "cell.threshold_deviation"
            ordered(phases)
    except ValueError as error:
        raise BadInput(case.located(Problem(source, str(error)))) from None
    return study


@dataclass(frozen=True)
class Parted:
    """Pixels parted into phases.

    Args:
        ranges: Phases that each pixel may be of, at a level.
        aspect: Height of a pixel over its width.
        fuzzy: Whether they, or the law of a random threshold, depend on the level.
        random: Threshold that is random.
    """

    ranges: Ranges
    aspect: float
    fuzzy: bool = False
    random: RandomThreshold | None = None


def _model(given: Picture, aspect: float, petsc: Mapping[str, str]) -> ImageModel:
    accuracy = ACCURACY if given.width is None else min(ACCURACY, given.width / 100)
    return ImageModel(
        aspect, given.boundary, given.tiles, given.division, _solver(accuracy, petsc), given.width
    )


def _solver(accuracy: float, petsc: Mapping[str, str]) -> Solver:
    """The own conjugate gradients, or PETSc where options of it are given.

    Raises:
        BadInput: PETSc is not installed.
    """
    if not petsc:
        return ConjugateGradient(accuracy)
    try:
        from alphacut.rve.image.petsc_solver import PetscSolver
    except ImportError:
        what = "PETSc is not installed"
        allowed = "no option of PETSc, or python3-petsc4py-real"
        raise BadInput.of(f"-rve_{min(petsc)}", what, allowed=allowed) from None
    return PetscSolver(accuracy, petsc)


def _image(case: Case, file: str) -> Parted:
    """Phases of an image file."""
    from alphacut.rve.image.read import read_grey, require_phases

    given, pixel = case.picture, case.picture.pixel
    assert pixel is not None  # an image has pixels, or the case is refused
    grey = read_grey(case.beside(file), division=given.division or 1, square=len(pixel) == 1)
    aspect = pixel[-1] / pixel[0]
    if given.size is not None:
        _require_size(grey, (pixel[0], pixel[-1]), given.size)
    if given.labels is not None:
        phase = _labelled(grey, given.labels)
        return Parted(lambda level: (phase, phase), aspect)
    thresholds, random = given.threshold or (), None
    uncertain = [number for number in thresholds if not isinstance(number, Crisp)]
    deviation = given.threshold_deviation
    if deviation is not None:
        random = RandomThreshold(grey, thresholds[0], deviation, given.quantiles)
        uncertain += [] if isinstance(deviation, Crisp) else [deviation]
        thresholds = (Crisp(thresholds[0].modal),)
    require_phases(grey, tuple(number.cut(0.0) for number in thresholds))
    return Parted(
        lambda level: threshold_ranges(grey, [cut_at(number, level) for number in thresholds]),
        aspect,
        bool(uncertain),
        random,
    )


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


def _require_size(grey: Array, pixel: tuple[float, float], size: tuple[float, ...]) -> None:
    """The stated size of the image is that of its pixels, to half a pixel."""
    for count, side, length, name in zip(
        grey.shape[::-1], pixel, size, ("wide", "high"), strict=True
    ):
        if abs(count * side - length) > side / 2:
            raise ValueError(
                f"{count} pixels of {side:g} m are {count * side:g} m {name}, "
                f"cell.size says {length:g} m"
            )


def _outline(case: Case) -> Parted:
    """Phases of an outline's pixels."""
    from alphacut.rve.image.outlines.equation import Equation
    from alphacut.rve.image.outlines.outline import Grid, Outline, phase_ranges
    from alphacut.rve.image.outlines.polygon import read_polygons

    given = case.picture
    width, height = given.size or ()
    columns = given.pixels
    grid = Grid(max(2, round(columns * height / width)), columns, width, height)
    outline: Outline = (
        Equation(given.inequality or "")
        if given.polygons is None
        else read_polygons(case.beside(given.polygons))
    )
    ends = phase_ranges(outline.classify(grid))
    if not ends[1].any() or ends[0].all():
        raise ValueError("the outline leaves one phase only; are its lengths those of cell.size?")
    return Parted(lambda level: ends, grid.aspect)


def expected_modulus(case: Case) -> tuple[float, float, float]:
    """Least, some middle and greatest E of the phases, in Pa, before the image is solved."""
    first, second = case.picture.pairs
    if case.picture.modulus is not None:
        ends = [end for number in first for end in number.support]
        return min(ends), first[0].modal, max(ends)
    pairs = [(k.modal, g.modal) for k, g in zip(first, second, strict=True)]
    moduli = [9 * k * g / (3 * k + g) for k, g in pairs]
    return min(moduli), moduli[0], max(moduli)
