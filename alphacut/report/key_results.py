"""The report's first table: what came out, on one screen."""

from __future__ import annotations

from collections.abc import Iterator

from markupsafe import Markup

from alphacut.figures.captions import core
from alphacut.io.files import Document
from alphacut.io.units import engineering, largest_by_unit
from alphacut.report.tables import section, table
from alphacut.stages.vibration import exceedance as outcomes
from alphacut.stages.vibration.decision import degree

Line = tuple[str, str, str, str]
HEAD = ("quantity", "most plausible", "whole range", "nature of the range")


def key_results(summary: Document) -> Markup:
    """Most plausible value, whole range and its worth of each result; empty without any."""
    rows = [*moduli(summary), *peaks(summary), *exceeded(summary), *decisions(summary)]
    return section("Key results", table(HEAD, rows)) if rows else Markup("")


def moduli(summary: Document) -> Iterator[Line]:
    """Young's modulus: computed, from an image, or given."""
    if found := summary.get("modulus"):
        ends = between(found["lower_GPa"], found["upper_GPa"])
        yield "Young's modulus E", core(found), ends, found["nature"]
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


def between(lower: float, upper: float) -> str:
    """Interval in GPa, or one value."""
    ends = dict.fromkeys((f"{lower:#.4g}", f"{upper:#.4g}"))
    return " … ".join(ends) + " GPa"


def peaks(summary: Document) -> Iterator[Line]:
    """Largest magnitude of each output of the study with the most fuzzy inputs."""
    from alphacut.frame.outputs import output_unit

    studies = summary.get("envelopes", {})
    if not studies:
        return
    study = max(studies.values(), key=lambda one: len(one["fuzzy"]))
    found = study.get("peak", {})
    largest = largest_by_unit((of["upper"][0], output_unit(name)) for name, of in found.items())
    for name, of in found.items():
        unit = output_unit(name)
        likely, whole = (
            dict.fromkeys(
                engineering(of[side][level], unit, beside=largest[unit])
                for side in ("lower", "upper")
            )
            for level in (-1, 0)
        )
        yield f"Peak of |{name}|", " … ".join(likely), " … ".join(whole), study["nature"]


def exceeded(summary: Document) -> Iterator[Line]:
    """Probability that an output exceeds its limit."""
    for found in outcomes.each_event(summary["exceedance"]) if "exceedance" in summary else ():
        ends = [
            "undecided"
            if (found["lower"][k], found["upper"][k]) == (0, 1)
            else " … ".join(dict.fromkeys(f"{found[side][k]:.2g}" for side in ("lower", "upper")))
            for k in (-1, 0)
        ]
        limit = f" exceeds {engineering(found['limit'], found['unit'])}"
        name = f"Probability of {outcomes.event_words(found['output'], limit)}"
        yield name, *ends, found["nature"].split(":")[0]


def decisions(summary: Document) -> Iterator[Line]:
    """Whether limits are exceeded, and how possible that is."""
    for name, one in summary.get("decision", {}).get("limits", {}).items():
        possible = f"possibility {degree(*one['possibility'])}"
        yield f"|{name}| beyond its limit", one["verdict"], possible, one["nature"]
