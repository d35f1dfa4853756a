"""Proved bounds of the stiffness of an image, level by level."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.case.case import Case
from alphacut.case.checks import beside
from alphacut.fuzzy import Crisp, FuzzyNumber
from alphacut.io.problem import BadInput, Problem
from alphacut.io.progress import Tick
from alphacut.io.provenance import versions
from alphacut.rve.image.directions import directions
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.gap import constitutive_gap
from alphacut.rve.image.grains import grain_modulus
from alphacut.rve.image.model import ImageCut, ImageModel, reduced_to_pixels
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.rve.image.phase_images import ModuliImages, moduli_images, threshold_ranges
from alphacut.rve.image.windows import tiles_of
from alphacut.stages.cell import GPA
from alphacut.stochastic.theta.truncated_normal import Array

if TYPE_CHECKING:
    import xarray

Ranges = Callable[[float], tuple[Array, Array]]  # α → least and greatest phase of each pixel
CURES = {
    "discretisation": "divide the pixels by image.division",
    "threshold": "state image.threshold more closely",
    "phases": "state the moduli of the phases more closely",
    "finite window": "take a larger window, or more tiles",
}


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
    """

    ranges: Ranges
    pairs: tuple[tuple[FuzzyNumber, FuzzyNumber], ...]
    young: bool
    alpha: tuple[float, ...]
    model: ImageModel
    fuzzy_threshold: bool

    def phases(self, alpha: float) -> list[ModuliInterval]:
        """Moduli of each phase at a level."""
        found = []
        for first, second in self.pairs:
            cuts = first.cut(alpha), second.cut(alpha)
            if self.young:
                found.append(ModuliInterval.of_young(*cuts))
            else:
                low, high = (PlaneModuli.of_bulk(cuts[0][end], cuts[1][end]) for end in (0, 1))
                found.append(ModuliInterval(low, high))
        return found

    def images(self, alpha: float, *, phases: float | None = None) -> ModuliImages:
        """Least and greatest moduli of each pixel at a level, the phases at another if given."""
        return moduli_images(*self.ranges(alpha), self.phases(alpha if phases is None else phases))

    @property
    def fuzzy_phases(self) -> bool:
        """Whether the moduli depend on the level."""
        return any(not isinstance(number, Crisp) for pair in self.pairs for number in pair)


@dataclass(frozen=True)
class FuzzyImage:
    """Bounds of an image at every level.

    Args:
        study: What was solved.
        cuts: One for each level of the study, rising.
        contributions: Width of E that each source causes by itself, in Pa.
        apparent: Proved bounds of E of a window as it is, in Pa; None for a periodic image.
        seconds: Wall time.
    """

    study: ImageStudy
    cuts: tuple[ImageCut, ...]
    contributions: dict[str, float]
    apparent: tuple[float, float] | None
    seconds: float

    @property
    def modal(self) -> ImageCut:
        """The cut at the highest level."""
        return self.cuts[-1]

    @property
    def fractions(self) -> Array:
        """Area share of each phase at the highest level; an open pixel counts half for its ends."""
        first, last = self.study.ranges(self.study.alpha[-1])
        count = len(self.study.pairs)
        sums = [np.bincount(which.ravel(), minlength=count) for which in (first, last)]
        return np.asarray((sums[0] + sums[1]) / 2 / first.size)

    @property
    def grains(self) -> tuple[float, float]:
        """Hashin–Shtrikman interval of E of grains, at the highest level, in Pa."""
        phases = self.study.phases(self.study.alpha[-1])
        return grain_modulus(
            list(self.fractions), [p.lower for p in phases], [p.upper for p in phases]
        )

    @property
    def advice(self) -> str:
        """The source that widens E most, and its cure."""
        worst = max(self.contributions, key=self.contributions.__getitem__)
        return f"widening E most: {worst}; to narrow it, {CURES[worst]}"

    def gap(self) -> Array | None:
        """Constitutive error of each pixel under strain (1, 1, 1), shape (rows, columns), Pa."""
        solution = self.modal.solution
        if solution is None or solution.upper.energy.pixels is None:
            return None
        pixels = constitutive_gap(solution, np.array([1.0, 1.0, 1.0]))
        return reduced_to_pixels(pixels, len(pixels) // len(self.study.ranges(1.0)[0]))


def study_of(case: Case) -> ImageStudy:
    """The study that a case describes.

    Raises:
        BadInput: Its picture cannot be used.
    """
    case.need("image.alpha")
    source = next(
        (key for key in ("image.file", "image.polygons", "image.inequality") if case.has(key)),
        "image.file",
    )
    try:
        ranges, aspect = _picture(case) if source == "image.file" else _outline(case, source)
        if case.text("image.boundary") == "window":
            source = "image.tiles"
            tiles_of(ranges(1.0)[0], case.integer(source))
        young = case.has("image.modulus")
        keys = ("image.modulus", "image.poisson") if young else ("image.bulk", "image.shear")
        first, second = (case.fuzzies(key) for key in keys)
        second = second * len(first) if len(second) == 1 else second
        thresholds = case.fuzzies("image.threshold") if case.has("image.threshold") else ()
        return ImageStudy(
            ranges,
            tuple(zip(first, second, strict=True)),
            young,
            case.numbers("image.alpha"),
            _model(case, aspect),
            any(not isinstance(number, Crisp) for number in thresholds),
        )
    except ValueError as error:
        line = case.lines.get(source, 0)
        raise BadInput(Problem(source, str(error), file=str(case.path), line=line)) from None


def compute(study: ImageStudy, *, progress: Tick | None = None) -> FuzzyImage:
    """Bounds at every level, and what widens them.

    Args:
        study: What is solved.
        progress: Told the share done.
    """
    began = perf_counter()
    cuts = study.model.run([study.images(alpha) for alpha in study.alpha])
    if progress:
        progress(0.8)
    contributions = _contributions(study, cuts)
    apparent = None
    if study.model.boundary == "window":
        tiling, _ = study.model.tiling(study.images(study.alpha[-1]), 1)
        apparent = tiling.bracket.modulus
    if progress:
        progress(1.0)
    return FuzzyImage(study, tuple(cuts), contributions, apparent, perf_counter() - began)


def _contributions(study: ImageStudy, cuts: list[ImageCut]) -> dict[str, float]:
    """Width of E from each source alone, above that of the modal image."""
    low, high = cuts[-1].modulus
    name = "finite window" if study.model.boundary == "window" else "discretisation"
    found = {name: high - low}
    bottom, top = study.alpha[0], study.alpha[-1]
    wanted = {"threshold": (bottom, top), "phases": (top, bottom)}
    for source, there in (("threshold", study.fuzzy_threshold), ("phases", study.fuzzy_phases)):
        if there:
            alpha, phases = wanted[source]
            alone = study.model.cut(study.images(alpha, phases=phases), cuts[-1].solution)
            found[source] = max(0.0, alone.modulus[1] - alone.modulus[0] - found[name])
    return found


def _model(case: Case, aspect: float) -> ImageModel:
    return ImageModel(
        aspect,
        case.text("image.boundary"),
        case.integer("image.tiles"),
        case.integer("image.division"),
        ConjugateGradient(case.number("image.accuracy")),
        case.number("image.width") if case.has("image.width") else None,
    )


def _picture(case: Case) -> tuple[Ranges, float]:
    """Phases of an image file at a level, and the aspect of its pixels."""
    from alphacut.rve.image.read import read_grey, require_phases

    path = beside(case, case.text("image.file"))
    said = case.has("image.pixel_height")
    grey = read_grey(path, division=case.integer("image.division"), square=not said)
    width = case.number("image.pixel")
    height = case.number("image.pixel_height") if said else width
    if case.has("image.window"):
        _require_window(grey, (width, height), case.numbers("image.window"))
    if case.has("image.labels"):
        phase = _labelled(grey, case.numbers("image.labels"))
        return (lambda alpha: (phase, phase)), height / width
    thresholds = case.fuzzies("image.threshold")
    require_phases(grey, tuple(number.cut(0.0) for number in thresholds))
    return (
        lambda alpha: threshold_ranges(grey, [number.cut(alpha) for number in thresholds])
    ), height / width


def _labelled(grey: Array, labels: tuple[float, ...]) -> Array:
    """Number of each pixel's phase."""
    phase = np.full(grey.shape, -1)
    for number, label in enumerate(labels):
        phase[grey == label] = number
    if (phase < 0).any():
        stranger = grey[phase < 0].flat[0]
        raise ValueError(f"a pixel holds {stranger:g}, which is none of image.labels")
    if missing := set(range(len(labels))) - set(np.unique(phase)):
        raise ValueError(f"no pixel holds the label {labels[min(missing)]:g}")
    return phase


def _require_window(grey: Array, pixel: tuple[float, float], window: tuple[float, ...]) -> None:
    """The stated size of the image is that of its pixels, to half a pixel."""
    for count, size, length, name in zip(
        grey.shape[::-1], pixel, window, ("wide", "high"), strict=True
    ):
        if abs(count * size - length) > size / 2:
            raise ValueError(
                f"{count} pixels of {size:g} m are {count * size:g} m {name}, "
                f"image.window says {length:g} m"
            )


def _outline(case: Case, source: str) -> tuple[Ranges, float]:
    """Phases of an outline's pixels, and their aspect."""
    from alphacut.rve.image.outlines.equation import Equation
    from alphacut.rve.image.outlines.outline import Grid, Outline, phase_ranges
    from alphacut.rve.image.outlines.polygon_file import read_polygons

    width, height = case.numbers("image.size")
    columns = case.integer("image.pixels")
    grid = Grid(max(2, round(columns * height / width)), columns, width, height)
    outline: Outline = (
        Equation(case.text(source))
        if source == "image.inequality"
        else read_polygons(beside(case, case.text(source)))
    )
    found = phase_ranges(outline.classify(grid))
    if not found[1].any() or found[0].all():
        raise ValueError("the outline leaves one phase only; are its lengths those of image.size?")
    return (lambda alpha: found), grid.aspect


def expected_modulus(case: Case) -> tuple[float, float, float]:
    """Least, some middle and greatest E of the phases, in Pa, before the image is solved."""
    if case.has("image.modulus"):
        ends = [end for number in case.fuzzies("image.modulus") for end in number.support]
        return min(ends), case.fuzzies("image.modulus")[0].modal, max(ends)
    pairs = [
        (k.modal, g.modal)
        for k, g in zip(case.fuzzies("image.bulk"), case.fuzzies("image.shear"), strict=True)
    ]
    moduli = [9 * k * g / (3 * k + g) for k, g in pairs]
    return min(moduli), moduli[0], max(moduli)


def document(found: FuzzyImage) -> dict[str, Any]:
    """The result as it is printed with ``--json``; moduli in GPa."""
    cut, alpha = found.modal, found.study.alpha
    bounds = cut.bounds
    low, high = bounds.bulk
    turned = directions(bounds)
    return {
        "lower_GPa": bounds.lower / GPA,
        "upper_GPa": bounds.upper / GPA,
        "width": bounds.width,
        "E_GPa": _pair(cut.modulus),
        "nu": poisson(cut),
        "plane_strain_bulk_GPa": _pair((low / 2, high / 2)),
        "nature": cut.nature,
        "cuts": {
            "alpha": alpha,
            "E_GPa": {
                "lower": [c.modulus[0] / GPA for c in found.cuts],
                "upper": [c.modulus[1] / GPA for c in found.cuts],
            },
            "nature": [c.nature for c in found.cuts],
        },
        "fractions": found.fractions,
        "grains_E_GPa": _pair(found.grains),
        "apparent_E_GPa": None if found.apparent is None else _pair(found.apparent),
        "directions_E_GPa": {"least": _pair(turned.least), "greatest": _pair(turned.greatest)},
        "isotropic": {
            "plane_strain_bulk_GPa": turned.isotropic[0] / GPA,
            "shear_GPa": turned.isotropic[1] / GPA,
            "distance": turned.distance,
        },
        "contributions_GPa": {name: w / GPA for name, w in found.contributions.items()},
        "advice": found.advice,
        "iterations": max(c.iterations for c in found.cuts),
        "seconds": found.seconds,
        "versions": versions(),
    }


def poisson(cut: ImageCut) -> dict[str, float]:
    """Bounds of ν of eq. 16, (1 − A/B)/2, by those of A and B."""
    shear, bulk = cut.bounds.shear, cut.bounds.bulk
    return {"lower": (1 - shear[1] / bulk[0]) / 2, "upper": (1 - shear[0] / bulk[1]) / 2}


def _pair(ends: tuple[float, float]) -> dict[str, float]:
    return {"lower": ends[0] / GPA, "upper": ends[1] / GPA}


def dataset(found: FuzzyImage) -> xarray.Dataset:
    """α-cuts of E and of the stiffness, the picture of the phases and of the error."""
    import xarray

    phase = np.add(*found.study.ranges(found.study.alpha[-1])) / 2
    tensors = {"lower": "lower", "upper": "upper"}
    variables: dict[str, Any] = {
        "E": (
            ("alpha", "bound"),
            np.array([cut.modulus for cut in found.cuts]),
            {"units": "Pa", "long_name": "effective Young's modulus, eq. 16"},
        ),
        "stiffness": (
            ("alpha", "bound", "row", "column"),
            np.array([[getattr(c.bounds, side) for side in tensors] for c in found.cuts]),
            {"units": "Pa", "long_name": "bounds of the plane-strain stiffness, 11, 22, 12"},
        ),
        "phase": (("y", "x"), phase.astype(np.float32), {"long_name": "number of the phase"}),
    }
    gap = found.gap()
    if gap is not None:
        about = {"units": "Pa", "long_name": "constitutive error of the two fields"}
        variables["gap"] = (("y", "x"), gap.astype(np.float32), about)
    coordinates = {
        "alpha": list(found.study.alpha),
        "bound": ["lower", "upper"],
        "row": ["11", "22", "12"],
        "column": ["11", "22", "12"],
    }
    return xarray.Dataset(
        variables, coordinates, {"nature": found.modal.nature, "seconds": found.seconds}
    )


def write(found: FuzzyImage, path: Path, attributes: dict[str, str | int]) -> None:
    """Write ``image.nc``, whole or not at all."""
    from alphacut.io.files import as_json, whole_file

    numbers = as_json(document(found))
    with whole_file(path) as partial:
        dataset(found).assign_attrs(attributes | {"document": numbers}).to_netcdf(partial)
