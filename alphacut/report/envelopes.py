"""The report's sections on envelopes (interactive plot, extremes, peaks) and on a spectrum."""

from __future__ import annotations

import math
from collections.abc import Iterator

from markupsafe import Markup

from alphacut.frame.structures.quantities import Output
from alphacut.io.files import Document
from alphacut.io.units import engineering, largest_by_unit
from alphacut.report.tables import fragment, items, paragraphs, section, table


def envelopes(summary: Document, exceedance: Markup) -> Markup:
    """The interactive plot and the extremes; the picture of the exceedance where there is one."""
    rows = extremes(summary["envelopes"])
    lowest = f"{min(study['alpha'][0] for study in summary['envelopes'].values()):g}"
    head = ("study", "output", f"least at α = {lowest}", f"greatest at α = {lowest}", "error up to")
    return section(
        "Envelopes",
        fragment("plot"),
        table(head[: len(rows[0])], rows, numbers=2),
        peaks(summary),
        exceedance,
    )


def extremes(studies: Document) -> list[tuple[str, ...]]:
    """Least and greatest value of each output, and the error where one was estimated."""
    each = [
        (name, study, output, Output(output).unit)
        for name, study in studies.items()
        for output in study["min"]
    ]
    largest = largest_by_unit(
        (study[side][output], unit) for _, study, output, unit in each for side in ("min", "max")
    )
    rows: list[tuple[str, ...]] = []
    for name, study, output, unit in each:
        ends = (
            engineering(study[side][output], unit, beside=largest[unit]) for side in ("min", "max")
        )
        error = study.get("error", {}).get(output)
        included = " (within the bounds)" if "gap" in study else ""
        told = "not estimated" if error is None else engineering(error, unit, digits=2) + included
        rows.append((name, output, *ends, told))
    some = any(study.get("error") for study in studies.values())
    return rows if some else [row[:-1] for row in rows]


def natural(summary: Document) -> Markup:
    """The first natural periods, where the structure is linear."""
    omega = summary.get("structure", {}).get("omega_rad_per_s")
    if not omega:
        return Markup("")
    periods = ", ".join(f"{2 * math.pi / w:.3g}" for w in omega[:4])
    return paragraphs(f"First natural periods at the modal values: {periods} s.")


def peaks(summary: Document) -> Markup:
    """Fuzzy peaks of every study, and the fuzzy probability of exceeding the case's limit."""
    each = [
        (name, output, Output(output).unit, of)
        for name, study in summary["envelopes"].items()
        for output, of in study.get("peak", {}).items()
    ]
    largest = largest_by_unit((of["upper"][0], unit) for _, _, unit, of in each)
    rows = [(name, output, *peak_row(of, unit, largest[unit])) for name, output, unit, of in each]
    words = paragraphs(
        "The peak is the largest magnitude of an output over the motion. On each level it lies"
        " between the least peak, a bound that no motion's falls below, and the greatest. Motions"
        " may all peak higher than that bound; the least among some motions tried tells how far it"
        f" may be from attained. All are peaks at the nodes{each_step(summary)}: at these no"
        " motion peaks higher than the greatest where the bounds are guaranteed; others are"
        " worth what their nature says. What a peak between two nodes may add is the column of"
        " errors, which falls with the square of the step."
    )
    limit = Markup("")

    study = next(iter(summary["envelopes"].values()))
    low, high = (f"at α = {study['alpha'][level]:g}" for level in (0, -1))
    head = ("study", "output", f"least peak {low} (bound)", "least of motions tried")
    last = (f"greatest {low}", "between nodes and by error, up to", f"peak {high} (bounds)")
    told = claims(summary["envelopes"])
    shown = Markup("<h3>Peaks</h3>") + words + table((*head, *last), rows, numbers=2) + told
    return shown + limit if rows else limit


def each_step(summary: Document) -> str:
    """How far apart the nodes are, where all studies have the same."""
    steps = {study.get("step") for study in summary["envelopes"].values()}
    step = steps.pop() if len(steps) == 1 else None
    return "" if step is None else f", {step:g} s apart"


def claims(studies: Document) -> Markup:
    """What the cuts claim of how often they hold, and which inputs are opinions, study by study."""
    each = {name: study["claim"] for name, study in studies.items() if "claim" in study}
    rows = [f"{name}: {claim}" for name, claim in each.items()]
    return Markup("<h3>How often the cuts hold</h3>") + items(rows) if rows else Markup("")


def peak_row(of: Document, unit: str, largest: float) -> Iterator[str]:
    """Peak: its least, that of motions tried, its greatest, the error, and the highest level's."""
    yield engineering(of["lower"][0], unit, beside=largest)
    yield engineering(of["tried"][0], unit, beside=largest) if "tried" in of else "none tried"
    yield engineering(of["upper"][0], unit, beside=largest)
    yield engineering(of["error"][0], unit, digits=2) if "error" in of else "not estimated"
    yield between(of["lower"][-1], of["upper"][-1], unit, largest)


def between(lower: float, upper: float, unit: str, largest: float) -> str:
    """Interval, or one value where both ends look alike, with the table's prefix."""
    ends = (engineering(end, unit, beside=largest) for end in (lower, upper))
    return " … ".join(dict.fromkeys(ends))


COLUMNS = ("damping", "period [s]", "displacement [m]", "pseudo-acceleration [m/s^2]")
ROWS = 8
"""Periods in the table, at most."""
