"""The report's first table: what came out, on one screen."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from markupsafe import Markup

from alphacut.figures.captions import core
from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document
from alphacut.io.units import engineering, largest_by_unit
from alphacut.report import envelopes
from alphacut.report.material import meaning
from alphacut.report.tables import paragraphs, section, sentence, table

Line = tuple[str, str, str, str, float]
"""Quantity, its most plausible values, its range, the nature of that, and the level it is of."""
HEAD = ("quantity", "most plausible", "widest range", "nature of the range")


def key_results(summary: Document) -> Markup:
    """Most plausible value, widest range and its worth of each result; empty without any."""
    found, judged = [*moduli(summary), *peaks(summary)], list[tuple[str, str, str, str]]()
    rows = [(of, likely, ends + at(level), nature) for of, likely, ends, nature, level in found]
    held: list[str] = []
    if not rows + judged:
        return Markup("")
    if not rows or any(likely != ends for _, likely, ends, *_ in found):
        return section("Key results", table(HEAD, rows + judged), paragraphs(*map(sentence, held)))
    one = [(of, ends, nature) for of, _, ends, nature in rows]
    one += [(of, f"{verdict}, {possible}", nature) for of, verdict, possible, nature in judged]
    return section("Key results", table(ONE, one), paragraphs(*map(sentence, (ALIKE, *held))))


ONE = ("quantity", "range", "nature of the range")
ALIKE = "all inputs are intervals, or one level alone is computed: no value in a range is likelier"


def moduli(summary: Document) -> Iterator[Line]:
    """Young's modulus: computed, from an image, or given."""
    if found := summary.get("modulus"):
        yield from of_cell(found)
    if found := summary.get("image"):
        cuts, name = found["cuts"], "Young's modulus E of the image"
        yield name, *both(cuts["E_GPa"]), cuts["nature"][0], cuts["alpha"][0]
    if found := summary.get("given_modulus"):
        told, level = "given by the case", found["alpha"][0]
        yield "Young's modulus E", *both(found["E_GPa"]), told, level


def of_cell(found: Document) -> Iterator[Line]:
    """E and ν of a computed cell with what they are of, and the bounds of E in space."""
    mean = MEANS[meaning(found)]
    ends, nature = between(found["lower_GPa"], found["upper_GPa"]), found["nature"]
    level = found["alpha"][0]
    yield f"Young's modulus E {mean}", core(found), ends, nature, level
    poisson = found.get("nu_cuts", {"lower": ()})
    if len(poisson["lower"]):
        inner, outer = both(poisson, partial(between, form=".4f", unit=""))
        yield f"Poisson's ratio ν {mean}", inner, outer, nature, level


MEANS = {
    "cylinders": "of the square array (eq. 16)",
    "isotropic": "of the square array, isotropic average",
    "spheres": "of spheres, isotropic average",
}
"""What E and ν are of, behind their names."""


def between(lower: float, upper: float, form: str = "#.4g", unit: str = " GPa") -> str:
    """Interval, or one value."""
    return " … ".join(dict.fromkeys((f"{lower:{form}}", f"{upper:{form}}"))) + unit


def both(cuts: Document, told: Callable[[float, float], str] = between) -> tuple[str, str]:
    """Cut on the highest level and on the lowest, in words."""
    return told(cuts["lower"][-1], cuts["upper"][-1]), told(cuts["lower"][0], cuts["upper"][0])


def at(level: float) -> str:
    """Words on the level of a range that is not the support."""
    return f" at α = {level:g}" if level else ""


def peaks(summary: Document) -> Iterator[Line]:
    """Largest magnitude of each output of the study with the most fuzzy inputs."""
    studies = summary.get("envelopes", {})
    if not studies:
        return
    study = max(studies.values(), key=lambda one: len(one["fuzzy"]))
    found = study.get("peak", {})
    largest = largest_by_unit((of["upper"][0], Output(name).unit) for name, of in found.items())
    for name, of in found.items():
        unit = Output(name).unit
        ends = both(of, partial(envelopes.between, unit=unit, largest=largest[unit]))
        kind = f"Peak of |{name}| at the nodes{every(study)}"
        yield kind, *ends, f"{study['nature']}{beyond(of, unit)}", study["alpha"][0]


def every(study: Document) -> str:
    """Words on how far apart the nodes of a study are."""
    return f", every {study['step']:g} s" if "step" in study else ""


def beyond(of: Document, unit: str) -> str:
    """Words on what bounds a peak that lies between two nodes; none where nothing does."""
    if "error" not in of:
        return ""
    most = engineering(of["upper"][0] + of["error"][0], unit)
    return f"; between nodes at most {most}"
