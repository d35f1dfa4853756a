"""Results of a run as rows of the first table: quantity, plausible value, range, nature, error."""

from __future__ import annotations

from collections.abc import Iterator

from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.units import engineering, largest_by_unit
from alphacut.questions.table import QUESTIONS

HEAD = ("quantity", "most plausible", "widest range", "nature", "error up to")
Row = tuple[str, str, str, str, str]

AVERAGES = {
    "cylinders": "of the square array's axes (eq. 16)",
    "axes": "of the square array's axes (eq. 16)",
    "isotropic": "isotropic average",
    "spheres": "of spheres, isotropic average",
}
"""Averages of the stiffness that E and ν are of."""
NATURES = {
    Nature.GUARANTEED: "No value in the α-cut lies outside these bounds; this is proved.",
    Nature.ESTIMATED: "The true bounds lie within the error, as an independent pass tells.",
    Nature.ATTAINED: "The bounds are reached; the true range may be wider.",
}
"""Meaning of each nature, for the page."""


def results(summary: Document) -> list[Row]:
    """Rows of every result of the summary, in the order of the stages."""
    answers = (
        (row[0], "", row[1], row[2], "")
        for question in QUESTIONS
        if question.key in summary
        for row in question.rows(summary[question.key])
    )
    return [*moduli(summary), *peaks(summary), *answers]


def moduli(summary: Document) -> Iterator[Row]:
    """Rows of Young's modulus and Poisson's ratio."""
    if cell := summary.get("modulus"):
        mean = AVERAGES.get(str(cell.get("average")), "")
        error = sum(cell.get("error", {}).values())
        young, poisson = cell["E_GPa"], cell.get("nu_cuts")
        nature = str(nature_of(cell["nature"]))
        most = error * max(young["upper"])
        cuts = (_cut(young, -1, " GPa"), _cut(young, 0, " GPa"))
        yield (f"Young's modulus E, {mean}", *cuts, nature, f"{most:.1g} GPa")
        if poisson:
            cuts = (_cut(poisson, -1, places=4), _cut(poisson, 0, places=4))
            yield (f"Poisson's ratio ν, {mean}", *cuts, nature, "–")
    if image := summary.get("image"):
        ends, nature = image["cuts"]["E_GPa"], image["cuts"]["nature"]
        worth = str(nature_of(nature if isinstance(nature, str) else nature[0]))
        cuts = (_cut(ends, -1, " GPa"), _cut(ends, 0, " GPa"))
        yield ("Young's modulus E of the image as segmented", *cuts, worth, "none outside")


def peaks(summary: Document) -> Iterator[Row]:
    """Rows of the largest magnitude of each output, of the study with most fuzzy inputs."""
    studies = summary.get("envelopes", {})
    if not studies:
        return
    study = max(studies.values(), key=lambda one: (len(one["fuzzy"]), one["max"].__len__()))
    yield from peak_rows(study)


def peak_rows(study: Document) -> Iterator[Row]:
    """Rows of the peak of each output of a study."""
    nature, of = nature_of(study["nature"]), study.get("peak", {})
    largest = largest_by_unit((one["upper"][0], Output(name).unit) for name, one in of.items())
    for name, one in of.items():
        unit = Output(name).unit
        error = max(one["error"]) if "error" in one else 0.0
        cuts = tuple(
            _peak(one, level, unit, largest[unit], attained=nature is Nature.ATTAINED)
            for level in (-1, 0)
        )
        yield (f"peak of |{name}|", *cuts, str(nature), engineering(error, unit, digits=2))


def _peak(one: Document, level: int, unit: str, beside: float, *, attained: bool) -> str:
    """Range of a peak with its error; of attained bounds what is reached at least."""
    error = one["error"][level] if "error" in one else 0.0
    if attained:
        return f"≥ {engineering(max(one['upper'][level] - error, 0), unit, beside=beside)}"
    ends = max(one["lower"][level] - error, 0.0), one["upper"][level] + error
    return " … ".join(dict.fromkeys(engineering(end, unit, beside=beside) for end in ends))


def nature_of(text: object) -> Nature:
    """The nature that a summary states; the weakest where its word is not known."""
    first = str(text).replace(",", " ").split()[:1]
    return next((nature for nature in Nature if [str(nature)] == first), Nature.ATTAINED)


def _cut(ends: Document, level: int, unit: str = "", *, places: int = 3) -> str:
    """One cut of a quantity, rounded outwards by no more than the last place."""
    both = (f"{ends[side][level]:.{places}f}" for side in ("lower", "upper"))
    return " … ".join(dict.fromkeys(both)) + unit


def extremes(study: Document) -> list[tuple[str, ...]]:
    """Least and greatest value of each output at the lowest level, with the error beside them."""
    units = {name: Output(name).unit for name in study["min"]}
    values = ((study[side][x], units[x]) for side in ("min", "max") for x in units)
    largest, errors = largest_by_unit(values), study.get("error", {})
    return [
        (
            name,
            *(engineering(study[x][name], unit, beside=largest[unit]) for x in ("min", "max")),
            engineering(errors[name], unit, digits=2) if name in errors else "not estimated",
            str(nature_of(study["nature"])),
        )
        for name, unit in units.items()
    ]
