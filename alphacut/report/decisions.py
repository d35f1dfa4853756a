"""Sections of the report on what was learned from measurements, and on what is decided."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from markupsafe import Markup

from alphacut.io.files import Document
from alphacut.questions.table import QUESTIONS
from alphacut.report.figures import listed
from alphacut.report.tables import paragraphs, percent, section, sentence, table
from alphacut.stages.words import learned as lines


def learned(summary: Document, folder: Path) -> Markup:
    """What measured modes teach about the inputs."""
    found = summary["update"]
    title = "Learned from measured modes"
    if "refuted" in found:
        refuted = sentence(found["refuted"]) + " The envelopes rest on the priors."
        return section(title, paragraphs(refuted))
    words = [sentence(line) for line in [*lines(found)][len(found["inputs"]) :]]
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
    names = ["inputs", *found.get("envelope_width", {})]
    return section(
        title,
        paragraphs(*words),
        table(head, rows),
        *(listed(summary, folder, f"update-{name}") for name in names),
    )


def answered(summary: Document, folder: Path) -> Iterator[Markup]:
    """A section for each question."""
    for question in QUESTIONS:
        if question.key in summary:
            found = summary[question.key]
            drawn = listed(summary, folder, question.key)
            rows = table(question.head, question.rows(found))
            yield section(question.title, paragraphs(question.words(found)), rows, drawn)
