"""Sections of the report on what was learned from measurements, and on what is decided."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup

from alphacut.io.files import Document
from alphacut.report.figures import listed
from alphacut.report.tables import paragraphs, section, sentence, table
from alphacut.stages.vibration.update import sentences


def learned(summary: Document, folder: Path) -> Markup:
    """What measured modes teach about the inputs, and what they do not."""
    found, title = summary["update"], "Learned from measured modes"
    if "refuted" in found:
        refuted = sentence(found["refuted"]) + " The envelopes rest on the priors."
        return section(title, paragraphs(refuted))
    words = [sentence(line) for line in sentences(found)[1 + len(found["inputs"]) :]]
    rows = [
        (
            name,
            *(f"{low:.5g} … {high:.5g}" for low, high in (found["prior"][name], after)),
            f"{found['narrowed'][name]:.1%}",
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
