"""Results of a run as rows of the first table: quantity, plausible value, range, nature, error."""

from __future__ import annotations

import math
from collections.abc import Iterator

from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.io.units import engineering, largest_by_unit
from alphacut.questions.table import QUESTIONS

HEAD = ("quantity", "most plausible", "widest range", "nature", "error up to")
Row = tuple[str, str, str, str, str]

AVERAGES = {
    "cylinders": "average of the axes (eq. 16)",
    "axes": "average of the axes (eq. 16)",
    "isotropic": "isotropic average",
    "spheres": "isotropic average of spheres",
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
            cuts = (_cut(poisson, -1), _cut(poisson, 0))
            yield (f"Poisson's ratio ν, {mean}", *cuts, nature, "–")
    if image := summary.get("image"):
        ends, nature = image["cuts"]["E_GPa"], image["cuts"]["nature"]
        worth = str(nature_of(nature if isinstance(nature, str) else nature[0]))
        cuts = (_cut(ends, -1, " GPa"), _cut(ends, 0, " GPa"))
        name = f"Young's modulus E of the image, {AVERAGES.get(str(image.get('average')), '')}"
        yield (name.rstrip(", "), *cuts, worth, "inside the bounds")


def peaks(summary: Document) -> Iterator[Row]:
    """Rows of the largest magnitude of each output, of the study with most fuzzy inputs."""
    studies = summary.get("envelopes", {})
    if not studies:
        return
    study = max(studies.values(), key=lambda one: (len(one["fuzzy"]), len(one["max"])))
    yield from peak_rows(study)


def peak_rows(study: Document) -> Iterator[Row]:
    """Rows of the peak of each output of a study."""
    nature, of = nature_of(study["nature"]), study.get("peak", {})
    largest = largest_by_unit((one["upper"][0], Output(name).unit) for name, one in of.items())
    for name, one in of.items():
        unit = Output(name).unit
        error = max(one["error"]) if "error" in one else 0.0
        top, whole = (
            _peak(one, level, unit, largest[unit], attained=nature is Nature.ATTAINED)
            for level in (-1, 0)
        )
        yield f"peak of |{name}|", top, whole, str(nature), engineering(error, unit, digits=2)


def _peak(one: Document, level: int, unit: str, beside: float, *, attained: bool) -> str:
    """Range of a peak with its error; of attained bounds what is reached at least."""
    error = one["error"][level] if "error" in one else 0.0
    if attained:
        reached = outward(max(one["upper"][level] - error, 0.0), up=False)
        return f"≥ {engineering(reached, unit, beside=beside)}"
    ends = (
        outward(max(one["lower"][level] - error, 0.0), up=False),
        outward(one["upper"][level] + error, up=True),
    )
    return " … ".join(dict.fromkeys(engineering(end, unit, beside=beside) for end in ends))


def nature_of(text: object) -> Nature:
    """The nature that a summary states; the weakest where its word is not known."""
    first = str(text).replace(",", " ").split()[:1]
    return next((nature for nature in Nature if [str(nature)] == first), Nature.ATTAINED)


def outward(value: float, *, up: bool, digits: int = 4) -> float:
    """A bound at so many digits that is not narrower, but for rounding in the tenth."""
    if value == 0 or not math.isfinite(value):
        return value
    scale = 10.0 ** (digits - 1 - math.floor(math.log10(abs(value))))
    slack = 1e-10 * abs(value) * scale
    whole = math.ceil(value * scale - slack) if up else math.floor(value * scale + slack)
    return whole / scale


def _cut(ends: Document, level: int, unit: str = "") -> str:
    """One cut of a quantity, rounded outwards; one value where both ends are the same."""
    low, high = float(ends["lower"][level]), float(ends["upper"][level])
    if high - low <= 1e-9 * abs(high):
        return f"{low:.5g}{unit}"
    return f"{outward(low, up=False, digits=5):.5g} … {outward(high, up=True, digits=5):.5g}{unit}"


def extremes(study: Document) -> list[tuple[str, ...]]:
    """Least and greatest value of each output at the lowest level, with the error beside them."""
    units = {name: Output(name).unit for name in study["min"]}
    values = ((study[side][x], units[x]) for side in ("min", "max") for x in units)
    largest, errors = largest_by_unit(values), study.get("error", {})
    return [
        (
            name,
            *(
                engineering(outward(study[x][name], up=x == "max"), unit, beside=largest[unit])
                for x in ("min", "max")
            ),
            engineering(errors[name], unit, digits=2) if name in errors else "not estimated",
            str(nature_of(study["nature"])),
        )
        for name, unit in units.items()
    ]
