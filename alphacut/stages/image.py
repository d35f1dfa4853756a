"""Stage modulus of an image: proved bounds of its stiffness, level by level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.material import ImageCell
from alphacut.io.files import Document, as_json
from alphacut.io.provenance import file_digest
from alphacut.rve.image.bounds import Ends
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.model import ImageCut, ImageModel, usual_division
from alphacut.stages.cell import GPA
from alphacut.stages.image_study import ImageStudy, Level, study_of
from alphacut.stages.store import Stage, Work

if TYPE_CHECKING:
    import xarray

ACCURACY = 1e-5
"""Relative energy that the solver may leave."""
NATURE = "guaranteed"
"""Nature of all bounds: proved of the image as segmented, if it repeats itself."""
AXES = ["11", "22", "12"]


def stage(cell: ImageCell, alpha: tuple[float, ...], average: str) -> Stage:
    """The stage of an image, on some levels; E and ν are of an average of its stiffness."""
    inputs = [cell, alpha, average, file_digest(cell.image)]
    compute = partial(dataset, cell, alpha, average)
    return Stage("image", inputs, ("stochastic", "rve", "fuzzy"), compute)


def dataset(cell: ImageCell, alpha: tuple[float, ...], average: str, work: Work) -> xarray.Dataset:
    """α-cuts of E and of the stiffness, the picture of the phases, and what widens E.

    Raises:
        RefusedError: The image cannot give what the case asks for.
    """
    import xarray

    start, tick = perf_counter(), work.tick or (lambda share: None)
    study, aspect = study_of(cell), cell.pixel[-1] / cell.pixel[0]
    modal = study.images(None, None)
    division, solver = usual_division(modal), ConjugateGradient(ACCURACY)
    model = ImageModel(aspect, division=division, solver=solver, average=average)
    crisp = model.solve(modal)
    tick(0.2)
    cuts = model.cuts([study.images(level, level) for level in alpha], (modal, crisp))
    tick(0.8)

    def width(threshold: Level, phases: Level) -> float:
        (cut,) = model.cuts([study.images(threshold, phases)], (modal, crisp))
        return float(cut.modulus[1] - cut.modulus[0])

    widths = _widths(study, alpha[0], width)
    facts = {
        **_document(alpha, cuts, average),
        "seconds": perf_counter() - start,
        "widths_GPa": {name: value / GPA for name, value in widths.items()},
        "fractions": study.fractions,
        "division": model.division,
    }
    stiffness = np.array([[cut.bounds.lower, cut.bounds.upper] for cut in cuts])
    variables = {
        "E": (("alpha", "bound"), np.array([cut.modulus for cut in cuts]), {"units": "Pa"}),
        "stiffness": (("alpha", "bound", "row", "column"), stiffness, {"units": "Pa"}),
        "phase": (("y", "x"), study.ranges(None)[0].astype(np.float32)),
    }
    axes = {"alpha": list(alpha), "bound": ["lower", "upper"], "row": AXES, "column": AXES}
    return xarray.Dataset(variables, axes, {"nature": NATURE, "document": as_json(facts)})


def _widths(
    study: ImageStudy, lowest: float, width: Callable[[Level, Level], float]
) -> dict[str, float]:
    """Widths of E in Pa that the pixels, the threshold and the phases cause, the widest first."""
    base = width(None, None)
    widths = {"discretisation": base}
    if study.fuzzy_threshold:
        widths["threshold"] = max(0.0, width(lowest, None) - base)
    if study.fuzzy_phases:
        widths["phases"] = max(0.0, width(None, lowest) - base)
    return dict(sorted(widths.items(), key=lambda pair: -pair[1]))


def _document(alpha: tuple[float, ...], cuts: Sequence[ImageCut], average: str) -> Document:
    """The bounds; moduli in GPa."""
    top, ends = cuts[-1], [[cut.modulus[end] / GPA for cut in cuts] for end in (0, 1)]
    return {
        "lower_GPa": top.bounds.lower / GPA,
        "upper_GPa": top.bounds.upper / GPA,
        "E_GPa": _pair(top.modulus),
        "nu": {"lower": top.poisson[0], "upper": top.poisson[1]},
        "G_T_GPa": _pair(top.bounds.shear(average)),
        "average": average,
        "nature": NATURE,
        "cuts": {
            "alpha": alpha,
            "E_GPa": {"lower": ends[0], "upper": ends[1]},
            "nature": [NATURE] * len(cuts),
        },
    }


def _pair(ends: Ends) -> dict[str, float]:
    return {"lower": ends[0] / GPA, "upper": ends[1] / GPA}
