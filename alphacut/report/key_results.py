"""The report's first table: what came out, on one screen."""

from __future__ import annotations

from collections.abc import Iterator

from markupsafe import Markup

from alphacut.figures.captions import core
from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document
from alphacut.io.units import engineering, largest_by_unit
from alphacut.report import envelopes
from alphacut.report.material import meaning
from alphacut.report.tables import paragraphs, section, sentence, table
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.decision import degree, verdict_of, worth
from alphacut.stages.vibration.studies import fixed_line

Line = tuple[str, str, str, str]
HEAD = ("quantity", "most plausible", "whole range", "nature of the range")


def key_results(summary: Document) -> Markup:
    """Most plausible value, whole range and its worth of each result; empty without any."""
    rows, judged = [*moduli(summary), *peaks(summary), *exceeded(summary)], [*decisions(summary)]
    words = summary.get("structure", {}).get("words", {})
    held = [*fixed_line(words.get("fixed", ())), *words.get("cut", ())]
    if not rows + judged:
        return Markup("")
    if not rows or any(likely != whole for _, likely, whole, _ in rows):
        return section("Key results", table(HEAD, rows + judged), paragraphs(*map(sentence, held)))
    one = [(of, ends, nature) for of, ends, _, nature in rows]
    one += [(of, f"{verdict}, {possible}", nature) for of, verdict, possible, nature in judged]
    return section("Key results", table(ONE, one), paragraphs(*map(sentence, (ALIKE, *held))))


ONE = ("quantity", "range", "nature of the range")
ALIKE = "all inputs are intervals, or one level alone is computed: no value in a range is likelier"


def moduli(summary: Document) -> Iterator[Line]:
    """Young's modulus: computed, from an image, or given."""
    if found := summary.get("modulus"):
        yield from of_cell(found)
    if found := summary.get("image"):
        cuts = found["cuts"]
        inner, outer = (
            between(cuts["E_GPa"]["lower"][k], cuts["E_GPa"]["upper"][k]) for k in (-1, 0)
        )
        yield "Young's modulus E of the image", inner, outer, cuts["nature"][0]
    if found := summary.get("given_modulus"):
        inner, outer = (
            between(found["E_GPa"]["lower"][k], found["E_GPa"]["upper"][k]) for k in (-1, 0)
        )
        yield "Young's modulus E", inner, outer, "given by the case"


def of_cell(found: Document) -> Iterator[Line]:
    """E and ν of a computed cell with what they are of, and the bounds of E in space."""
    mean = MEANS[meaning(found)]
    flag = ": outside the bounds of spheres, see below" if found.get("outside") else ""
    ends, nature = between(found["lower_GPa"], found["upper_GPa"]), f"{found['nature']}{flag}"
    yield f"Young's modulus E {mean}", core(found), ends, nature
    poisson = found.get("nu_cuts", {"lower": ()})
    if len(poisson["lower"]):
        inner, outer = (
            " … ".join(dict.fromkeys(f"{poisson[side][k]:.4f}" for side in ("lower", "upper")))
            for k in (-1, 0)
        )
        yield f"Poisson's ratio ν {mean}", inner, outer, nature
    if cuts := found.get("beside", {}).get("cuts"):
        kind = "spheres" if found.get("outside") or found["particles"] == "spheres" else "fibres"
        inner, outer = (between(cuts[kind]["lower"][k], cuts[kind]["upper"][k]) for k in (-1, 0))
        name = {"spheres": "spheres", "fibres": "long fibres"}[kind]
        yield f"Hashin–Shtrikman bounds of E, {name}", inner, outer, "bounds at the inputs' corners"


MEANS = {
    "cylinders": "of the square array (eq. 16)",
    "isotropic": "of the square array, isotropic average",
    "spheres": "of spheres, isotropic average",
}
"""What E and ν are of, behind their names."""


def between(lower: float, upper: float) -> str:
    """Interval in GPa, or one value."""
    ends = dict.fromkeys((f"{lower:#.4g}", f"{upper:#.4g}"))
    return " … ".join(ends) + " GPa"


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
        likely, whole = (
            envelopes.between(of["lower"][k], of["upper"][k], unit, largest[unit]) for k in (-1, 0)
        )
        kind = f"Peak of |{name}| at the nodes{every(study)}"
        yield kind, likely, whole, f"{study['nature']}{beyond(of, unit)}"


def every(study: Document) -> str:
    """Words on how far apart the nodes of a study are."""
    return f", every {study['step']:g} s" if "step" in study else ""


def beyond(of: Document, unit: str) -> str:
    """Words on what bounds a peak that lies between two nodes; none where nothing does."""
    if "error" not in of:
        return ""
    most = engineering(of["upper"][0] + of["error"][0], unit)
    return f"; between nodes at most {most}"


def exceeded(summary: Document) -> Iterator[Line]:
    """Probability that an output exceeds its limit."""
    for found in outcomes.each_event(summary["exceedance"]) if "exceedance" in summary else ():
        likely, whole = (
            "undecided"
            if (found["lower"][k], found["upper"][k]) == (0, 1)
            else " … ".join(dict.fromkeys(f"{found[side][k]:.2g}" for side in ("lower", "upper")))
            for k in (-1, 0)
        )
        limit = f" exceeds {engineering(found['limit'], found['unit'])}"
        name = f"Probability of {outcomes.event_words(found['output'], limit)}"
        nature = f"{found['nature'].split(':')[0]}{outcomes.nodes(found)}"
        yield name, likely, whole, nature


def decisions(summary: Document) -> Iterator[Line]:
    """Whether limits are exceeded, and how possible that is."""
    found = summary.get("decision", {})
    for name, one in found.get("limits", {}).items():
        possible, of = f"possibility {degree(*one['possibility'])}", name
        if (margin := found["margins"].get(name)) is not None:
            limit = engineering(margin["limit"], margin["unit"])
            of = f"|{margin.get('output', name)}| beyond {limit}"
        yield of, verdict_of(found, name), possible, worth(found, name)
