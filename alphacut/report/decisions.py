"""Sections of the report on what was learned from measurements, and on what is decided."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup

from alphacut.io.files import Document
from alphacut.io.units import engineering
from alphacut.report.envelopes import between
from alphacut.report.figures import listed
from alphacut.report.tables import paragraphs, percent, section, sentence, table
from alphacut.stages.vibration import decision, update


def learned(summary: Document, folder: Path) -> Markup:
    """What measured modes or a recorded motion teach about the inputs, and what they do not."""
    found = summary["update"]
    title = "Learned from measured modes"
    if "refuted" in found:
        refuted = sentence(found["refuted"]) + " The envelopes rest on the priors."
        return section(title, paragraphs(refuted))
    words = [sentence(line) for line in update.sentences(found)[len(found["inputs"]) :]]
    rows = [
        (
            name,
            *(f"{low:.5g} … {high:.5g}" for low, high in (found["prior"][name], after)),
            percent(found["narrowed"][name]),
        )
        for name, ends in found["inputs"].items()
        for after in [(ends["lower"][0], ends["upper"][0])]
    ]
    head = ("input, SI", "before", f"after, at α = {found['alpha'][0]:g}", "width left")
    names = ["inputs", *found["envelope_width"]]
    return section(
        title,
        paragraphs(*words),
        table(head, rows),
        *(listed(summary, folder, f"update-{name}") for name in names),
    )


def decided(summary: Document, folder: Path) -> Markup:
    """How possible and how necessary it is that limits are exceeded, and the safety margins."""
    found = summary["decision"]
    words = [sentence(line) for line in decision.sentences(found)][len(found["limits"]) :]
    rows = []
    for name, one in found["limits"].items():
        allowed, margins, of = "", ["", ""], name
        if (margin := found["margins"].get(name)) is not None:
            unit, largest = margin["unit"], float(margin["limit"])
            allowed, of = engineering(largest, unit), margin.get("output", name)
            ends = (decision.margin_ends(found, name, level) for level in (0, -1))
            margins = [between(low, high, unit, largest) for low, high in ends]
        degrees = (decision.degree(*one[kind]) for kind in ("possibility", "necessity"))
        verdict = f"{decision.verdict_of(found, name)} ({decision.worth(found, name)})"
        rows.append((of, allowed, *degrees, verdict, *margins))
    levels = (f"margin at α = {found['alpha'][level]:g}" for level in (0, -1))
    head = ("magnitude of", "limit", "possibly exceeded", "necessarily", "verdict", *levels)
    meaning = (
        "Exceeding a limit at any node is possible to the degree of the highest α-cut that holds"
        " such a motion, and necessary to one less the degree to which keeping it is possible."
    )
    drawn = listed(summary, folder, "decision")
    return section("Decision", paragraphs(meaning), table(head, rows), drawn, paragraphs(*words))
