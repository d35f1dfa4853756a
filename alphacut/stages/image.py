"""Stage modulus of an image: proved bounds of its stiffness, level by level."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.fuzzy.refused import RefusedError
from alphacut.io.files import Document, as_json
from alphacut.io.provenance import file_digest
from alphacut.rve.image.bounds import Ends
from alphacut.rve.image.model import ImageCut, ImageModel, usual_division
from alphacut.stages.cell import GPA
from alphacut.stages.image_study import ImageStudy, Level, study_of
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray

    from alphacut.case.material import ImageCell


NATURE = "guaranteed"
"""Nature of all bounds: proved of the image as segmented, if it repeats itself."""


@dataclass(frozen=True)
class FuzzyImage:
    """Bounds of an image at every level.

    Args:
        study: The image and its phases.
        model: Its model, with the division taken.
        cuts: One for each level of the study, rising.
        widths: Width of E by source, in Pa, the widest first.
        seconds: Wall time.
    """

    study: ImageStudy
    model: ImageModel
    cuts: tuple[ImageCut, ...]
    widths: dict[str, float]
    seconds: float


def stage(cell: ImageCell, alpha: tuple[float, ...], average: str) -> Stage:
    """The stage of an image, on some levels; E and ν are of an average of its stiffness."""

    def compute(work: Work) -> xarray.Dataset:
        return dataset(solved(study_of(cell, alpha, average), work))

    inputs = [cell, alpha, average, file_digest(cell.image)]
    return Stage("image", inputs, ("stochastic", "rve", "fuzzy"), compute)


def solved(study: ImageStudy, work: Work) -> FuzzyImage:
    """Bounds at every level, and what widens them.

    Raises:
        RefusedError: The image cannot give what the case asks for.
    """
    start, tick = perf_counter(), work.tick or (lambda share: None)
    try:
        modal = study.images(None, None)
        model = replace(study.model, division=usual_division(modal))
        crisp = model.solve(modal)
        tick(0.2)
        levels = [study.images(level, level) for level in study.alpha]
        cuts = tuple(model.cuts(levels, (modal, crisp)))
        tick(0.8)

        def width(threshold: Level, phases: Level) -> float:
            (cut,) = model.cuts([study.images(threshold, phases)], (modal, crisp))
            return float(cut.modulus[1] - cut.modulus[0])

        widths = _widths(study, width)
    except RefusedError:
        raise
    except ValueError as error:
        value = study.cell.image.name
        raise RefusedError("cell.image", value, "an image that can be solved", str(error)) from None
    return FuzzyImage(study, model, cuts, widths, perf_counter() - start)


def _widths(study: ImageStudy, width: Any) -> dict[str, float]:
    """Widths of E in Pa that the pixels, the threshold and the phases cause, the widest first."""
    base, lowest = width(None, None), study.alpha[0]
    widths = {"discretisation": base}
    if study.fuzzy_threshold:
        widths["threshold"] = max(0.0, width(lowest, None) - base)
    if study.fuzzy_phases:
        widths["phases"] = max(0.0, width(None, lowest) - base)
    return dict(sorted(widths.items(), key=lambda pair: -pair[1]))


def document(image: FuzzyImage) -> Document:
    """The result for ``--json``; moduli in GPa."""
    top, average = image.cuts[-1], image.model.average
    ends = [[cut.modulus[end] / GPA for cut in image.cuts] for end in (0, 1)]
    return {
        "lower_GPa": top.bounds.lower / GPA,
        "upper_GPa": top.bounds.upper / GPA,
        "E_GPa": _pair(top.modulus),
        "nu": {"lower": top.poisson[0], "upper": top.poisson[1]},
        "G_T_GPa": _pair(top.bounds.shear(average)),
        "average": average,
        "nature": NATURE,
        "seconds": image.seconds,
        "cuts": {
            "alpha": image.study.alpha,
            "E_GPa": {"lower": ends[0], "upper": ends[1]},
            "nature": [NATURE] * len(image.cuts),
        },
        "widths_GPa": {name: value / GPA for name, value in image.widths.items()},
        "fractions": dict(zip(image.study.names, map(float, image.study.fractions), strict=True)),
        "division": image.model.division,
    }


def _pair(ends: Ends) -> dict[str, float]:
    return {"lower": ends[0] / GPA, "upper": ends[1] / GPA}


def dataset(image: FuzzyImage) -> xarray.Dataset:
    """α-cuts of E and of the stiffness, the picture of the phases and of the error."""
    import xarray

    words = {"units": "Pa", "long_name": "bounds of the plane-strain stiffness"}
    stiffness = np.array([[cut.bounds.lower, cut.bounds.upper] for cut in image.cuts])
    variables: dict[str, Any] = {
        "E": (("alpha", "bound"), np.array([cut.modulus for cut in image.cuts]), {"units": "Pa"}),
        "stiffness": (("alpha", "bound", "row", "column"), stiffness, words),
        "phase": (("y", "x"), image.study.ranges(None)[0].astype(np.float32)),
    }
    axes = ["11", "22", "12"]
    coordinates = {
        "alpha": list(image.study.alpha),
        "bound": ["lower", "upper"],
        "row": axes,
        "column": axes,
    }
    facts = {"nature": NATURE, "document": as_json(document(image))}
    return xarray.Dataset(variables, coordinates, facts)
