"""The sections of the report, each from its part of the summary, as pieces for the template."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator
from pathlib import Path

from alphacut.case.content import QUESTIONS
from alphacut.figures.captions import caption, in_words
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document
from alphacut.report.results import (
    ANSWERS,
    Row,
    Table,
    answers,
    drivers,
    figures,
    material,
    motion,
    nature_of,
    natures,
    width_text,
)
from alphacut.report.tables import tables

TERMS = {
    "α-cut": "All values whose membership is at least α.",
    "Support": "The α-cut at 0: all values that are possible.",
    "Most plausible": "The α-cut at 1, or that of the highest level computed.",
    "Envelope": "Least and greatest value of an output at each time, over one α-cut of the inputs.",
    "Peak": "Largest magnitude of an output over the motion.",
    "Possibility": "Degree of the highest α-cut in which something happens. 0: it cannot.",
    "Necessity": "One less the possibility of the contrary. 1: it must happen.",
    **{str(nature).capitalize(): nature.sentence for nature in Nature},
}
"""Terms of the page with their meaning."""
PARTS = {
    "microstructure": ("Microstructure", "radius_map", ("pbox", "p-box")),
    "modulus": ("How stiff is the material?", "modulus", ("modulus",)),
    "image": ("How stiff is the image?", "image", ("image",)),
    "update": ("What do the measured modes teach?", "update", ("update-inputs",)),
    "envelopes": ("How does the structure move?", "peaks", ()),
    **{one.key: (one.title, one.key, (one.key,)) for one in QUESTIONS},
    "shares": ("What drives the width?", "shares", ()),
}
"""Title, table and figures of each part of the summary."""
Piece = tuple[object, ...]
"""Name of a macro of ``report.html``, and what it shows."""


class Page:
    """The sections of one run.

    Args:
        summary: Its summary.
        folder: Where its figures are.
    """

    def __init__(self, summary: Document, folder: Path) -> None:
        self.summary, self.tables = summary, tables(summary)
        self.paper = any("fig" in name for name in summary.get("figures", ()))
        self.left = dict(figures(summary, folder))  # of those that no section has shown yet

    def sections(self) -> Iterator[tuple[str, list[Piece]]]:
        """Title and pieces of all sections that the results allow, in reading order."""
        summary = self.summary
        first = (material(summary), motion(summary), (ANSWERS, answers(summary)))
        remarks = [*natures(summary), *drivers(summary)]
        yield "Key results", [*(("table", *one) for one in first), *_texts(remarks)]
        for name, (title, table, drawn) in PARTS.items():
            if part := summary.get(name):
                yield title, [*self._drawn(drawn), *self._part(name, part, table)]
        yield "Terms", [("glossary", TERMS.items())]
        others = [*self._drawn(tuple(self.left))]
        yield "More", [("folded", "All other figures", others), *self._origin()]

    def _part(self, name: str, part: Document, table: str) -> Iterator[Piece]:
        """Words and table of a part."""
        if name == "envelopes":
            yield ("plot",)
        yield from _texts(self._words(name, part))
        if table in self.tables:
            shown: Piece = ("table", *self.tables[table])
            answer = name in ("update", "shares", *(one.key for one in QUESTIONS))
            yield shown if answer else ("folded", "As a table", [shown])
        if name == "modulus":
            yield "folded", "Errors, checks and references", [("table", *_errors(part))]

    def _words(self, name: str, part: Document) -> Iterator[str]:
        """Sentences on a part."""
        for question in QUESTIONS:
            if question.key == name:
                yield question.words(part)
        if name == "microstructure":
            count, kind = part.get("discs", part.get("spheres")), part["particles"]
            yield f"{count:,} {kind} in {part['packings']} sections or cubes."
        elif name == "image":
            yield "The bounds are those of the image as it was segmented, in plane strain."
            shares = (f"{x} {share:.1%}" for x, share in part["fractions"].items())
            yield f"Of the area: {', '.join(shares)}. {width_text(part)}."
        elif name == "update" and "refuted" in part:
            yield str(part["refuted"])
        elif name == "envelopes":
            omega = self.summary.get("structure", {}).get("omega_rad_per_s", ())
            if periods := ", ".join(f"{2 * math.pi / one:.3g}" for one in omega[:4]):
                yield f"Linear elastic, with natural periods of {periods} s."
            for study, one in part.items():
                yield f"{study}: {one['method']}, fuzzy {', '.join(one['fuzzy'])}"
            for nature in dict.fromkeys(nature_of(study["nature"]) for study in part.values()):
                yield f"{str(nature).capitalize()}: {nature.sentence}"
        elif name == "shares":
            yield "Share of the width that is lost when an input is fixed at its modal value."

    def _drawn(self, names: tuple[str, ...]) -> Iterator[Piece]:
        """Figures by their names without the paper's number, where this run has drawn them.

        No SVG is taken from the folder: it could hold a script of somebody else.
        """
        for name in names:
            stems = [stem for stem in self.left if stem == name or stem.endswith(f"-{name}")]
            for stem in stems[:1]:
                data = self.left.pop(stem).read_bytes()
                if data.startswith(b"\x89PNG\r\n\x1a\n"):
                    words = caption(stem, paper=self.paper)
                    yield "figure", words, base64.b64encode(data).decode()

    def _origin(self) -> Iterator[Piece]:
        """The case file, what the command line changed, versions."""
        summary = self.summary
        yield "folded", f"Case {summary['case']}", [("code", summary["case_text"])]
        changes = [("code", change) for change in summary.get("changes", ())]
        yield "folded", "Changed on the command line", changes
        made = f"Made by {summary['command']} in {summary['seconds']:.0f} s."
        versions = ("table", ("program", "version"), [*summary["versions"].items()])
        yield "folded", "Versions", [("text", made), versions]


def _texts(texts: Iterator[str] | list[str]) -> Iterator[Piece]:
    return (("text", text) for text in texts)


def _errors(part: Document) -> Table:
    """Errors of E by source, largest violations of properties, and references."""
    rows: list[Row] = [(f"error: {in_words(x)}", f"{y:.2g} of E") for x, y in part["error"].items()]
    rows += [(f"check: {in_words(x)}", f"{y:.2g}") for x, y in part["checks"].items()]
    known = {
        "hashin_shtrikman_E_GPa": "Hashin–Shtrikman bounds, isotropic composites",
        "mori_tanaka_E_GPa": "Mori–Tanaka, isotropic composites",
    }
    for key, value in part["references"].items():
        if key in known:
            ends = value if isinstance(value, list) else [value]
            rows.append((known[key], " … ".join(f"{end:.5g} GPa" for end in ends)))
    return ("source, property or reference at the modal values", "value"), rows
