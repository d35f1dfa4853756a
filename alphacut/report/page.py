"""The report of a run as one HTML page that needs nothing else: no network, no other file."""

from __future__ import annotations

import base64
import math
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from alphacut.base.errors import RefusedError
from alphacut.base.number_text import ShownUnit, Table
from alphacut.frame import Sensitivity
from alphacut.frame.analyses.answer import enclosing_box_words
from alphacut.fuzzy.result import Nature, of_enclosing_box
from alphacut.io.files import Document, say
from alphacut.io.results import ResultsFolder
from alphacut.report.results import (
    ANSWER_HEAD,
    MEANING,
    answers,
    drivers,
    guaranteed_of,
    material,
    natures,
    peak_table,
    smaller_steps,
    width_text,
)
from alphacut.report.tables import tables
from alphacut.stages.cell import isotropic_label
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.summary import Summary

Piece = tuple[object, ...]
"""Name of a macro of ``report.html``, and what it shows."""
_TABLES = tomllib.loads(Path(__file__).with_name("captions.toml").read_text(encoding="utf-8"))
FIGURES: dict[str, str] = _TABLES["figures"]
TERMS = _TABLES["terms"] | {str(nature).capitalize(): nature.sentence for nature in Nature}
"""Terms of the page with their meaning."""


def render_page(folder: ResultsFolder) -> str:
    """The page for the results in a folder, or RefusedError where they are not of one run."""
    summary = Summary.read(folder)
    summary.require_run_of(folder)
    return render_template(
        title=summary.title,
        name=summary.case,
        about=" ".join(summary.about.split()),
        sections=Page(summary, folder).sections(),
        envelopes=[
            plot(name, study, folder, summary.shown_units)
            for name, study in summary.envelopes.items()
        ],
    )


def comparison_page(first: Summary, second: Summary, table: Table) -> str:
    """The page for two summaries with the table of both side by side."""
    title, name = f"{first.title} and {second.title}", f"{first.case} and {second.case}"
    sections = [("Side by side", [("table", *table)])]
    return render_template(title=title, name=name, about="", sections=sections, envelopes=[])


def render_template(**parts: object) -> str:
    """The template of the page with its parts; all texts of it are escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader(Path(__file__).parent)
    templates = Environment(autoescape=True, loader=loader, undefined=StrictUndefined)
    return templates.get_template("report.html").render(parts)


def plot(
    name: str, study: EnvelopeResult, folder: ResultsFolder, units: Mapping[str, ShownUnit]
) -> Document:
    """Data of a study for the interactive plot: values over time as base64 of 32-bit floats."""
    dataset = folder.dataset(f"envelope_{name}.nc")
    time = dataset["time"].values
    outputs = [str(output) for output in dataset["output"].values]
    bands = {side: dataset[side] for side in ("lower", "upper", "error")}
    if study.nature is Nature.GUARANTEED:  # which contains it
        bands["error"] = 0.0 * bands["error"]
    encloses = next((peak.encloses for peak in study.peak.values()), "")
    box = f", {of_enclosing_box(encloses)}" if encloses else ""
    axes = ("alpha", "output", "time")
    arrays = {x: band.transpose(*axes).values.astype("<f4") for x, band in bands.items()}
    return {
        "name": name,
        "title": f"{name}: fuzzy {', '.join(study.fuzzy)}{box}",
        "fuzzy": len(study.fuzzy),
        "nature": str(study.nature),
        "alpha": dataset["alpha"].values.tolist(),
        "outputs": outputs,
        "units": [units[output].label for output in outputs],
        "factors": [units[output].factor for output in outputs],
        "step": float(time[1] - time[0]),
        **{
            side: [[base64.b64encode(row.tobytes()).decode() for row in level] for level in array]
            for side, array in arrays.items()
        },
    }


class Page:
    """The sections of one run, from its summary and its results."""

    def __init__(self, summary: Summary, folder: ResultsFolder) -> None:
        self.summary, self.folder, self.tables = summary, folder, tables(summary)
        self.paper = any("fig" in name for name in summary.figures)
        pictures = [name for name in summary.figures if name.endswith(".png")]
        self.unshown = {PurePosixPath(x).stem: x for x in pictures}  # that no section has shown yet

    def sections(self) -> Iterator[tuple[str, list[Piece]]]:
        """Yields title and pieces of each section that the results allow, in reading order.

        A piece is the name of a macro of the template, and what the macro shows.
        """
        summary, show = self.summary, self._pieces
        refuted = [summary.update.refuted] if summary.update and summary.update.refuted else []
        shares = [Sensitivity(summary.shares).words()] if summary.shares else []
        box = [enclosing_box_words(summary.encloses)] if summary.encloses else []
        answers = [(x, (x.key, f"{x.key}-curves")) for x in summary.answers]
        plots: list[Piece] = [("plot",)] if summary.envelopes else []
        for title, pieces in (
            ("Key results", self._key_pieces()),
            ("Microstructure", show(["pbox", "p-box"], self._particles(), folded="radius_map")),
            ("How stiff is the material?", show(["modulus"], self._references(), folded="modulus")),
            ("How stiff is the image?", show(["image"], self._image(), folded="image")),
            ("What do the measured modes teach?", show(["update-inputs"], refuted, "update")),
            ("How does the structure move?", [*plots, *show([], self._motion(), folded="peaks")]),
            ("How far does it move under each record?", show([], folded="records")),
            *(
                (x.title, show(names, [x.all_words()], x.key, f"{x.key}_sets"))
                for x, names in answers
            ),
            ("What drives the width?", show([], [*shares, *box] if shares else [], "shares")),
            ("Terms", [("glossary", TERMS.items())]),
            ("More", self._more()),
        ):
            if shown := [*pieces]:
                yield title, shown

    def _pieces(
        self, figures: Iterable[str], texts: Iterable[str] = (), table: str = "", folded: str = ""
    ) -> Iterator[Piece]:
        """Yields figures, texts, a table and a folded one, by their names; none that is missing."""
        yield from self._figures(*figures)
        yield from (("text", text) for text in texts)
        if table in self.tables:
            yield ("table", *self.tables[table])
        if folded in self.tables:
            yield "folded", "As a table", [("table", *self.tables[folded])]

    def _key_pieces(self) -> Iterator[Piece]:
        summary = self.summary
        yield "text", f"{MEANING}."
        for table in (material(summary), peak_table(summary), (ANSWER_HEAD, answers(summary))):
            yield ("table", *table)
        lines = (*natures(summary), *smaller_steps(summary), *drivers(summary))
        yield from self._pieces([], lines)

    def _particles(self) -> Iterator[str]:
        if (part := self.summary.microstructure) is None:
            return
        count, kind = part.get("discs", part.get("spheres")), part["particles"]
        cells = "volume" if kind == "spheres" else "area"
        stated, mapped = part["fraction_of_case"], part[f"mean_{cells}_fraction_of_map"]
        measured = part[f"{cells}_fraction"]
        beside = "" if stated is None else f"; the case says {stated:.4g}"
        yield f"{count:,} {kind} in {part['packings']} sections or cubes."
        beside += f"; the {kind} themselves {measured:.4f}"
        yield f"Of the {cells} of the cells the map's particles take {mapped:.4f}{beside}."

    def _image(self) -> Iterator[str]:
        if (part := self.summary.image) is not None:
            shares = ", ".join(f"{x} {share:.1%}" for x, share in part.fractions.items())
            yield f"{guaranteed_of(part)}."
            measured = "area" if len(part.lower_GPa) == 3 else "volume"
            yield f"Of the {measured}: {shares}. {width_text(part)}."

    def _references(self) -> Iterator[str]:
        part = self.summary.modulus
        if part is not None and (bounds := part.references.get("hashin_shtrikman_E_GPa")):
            yield f"{isotropic_label(part.average)}: {bounds[0]:.5g} … {bounds[1]:.5g} GPa."

    def _motion(self) -> Iterator[str]:
        studies, frame = self.summary.envelopes, self.summary.structure
        if studies and frame is not None:
            periods = ", ".join(f"{2 * math.pi / omega:.3g}" for omega in frame.omega_rad_per_s[:4])
            yield f"Natural periods of linear elastic motion: {periods} s."
        for name, study in studies.items():
            yield f"{name}: {study.method}, fuzzy {', '.join(study.fuzzy)}"
        for nature in dict.fromkeys(study.nature for study in studies.values()):
            yield f"{str(nature).capitalize()}: {nature.sentence}"
        if studies and self.summary.encloses:
            yield enclosing_box_words(self.summary.encloses)

    def _figures(self, *names: str) -> Iterator[Piece]:
        """Yields the figures of these names, without the paper's number, that the run has drawn.

        No SVG is taken from the folder: it could hold a script of somebody else.
        """
        for name in names:
            stem = next((x for x in self.unshown if x == name or x.endswith(f"-{name}")), None)
            if stem is None:
                continue
            try:
                content = self.folder.content(self.unshown.pop(stem))
            except RefusedError as error:
                say(f"warning: a figure is left out: {error}")
                continue
            yield "figure", caption(stem, paper=self.paper), base64.b64encode(content).decode()

    def _more(self) -> Iterator[Piece]:
        summary = self.summary
        yield "folded", "All other figures", [*self._figures(*self.unshown)]
        yield "folded", f"Case {summary.case}", [("code", summary.case_text)]
        changes = [("code", change) for change in summary.changes]
        yield "folded", "Changed on the command line", changes
        origin = f"Made by {summary.command} in {summary.seconds:.0f} s."
        versions = ("table", ("program", "version"), [*summary.versions.items()])
        yield "folded", "Versions", [("text", origin), versions]


def caption(stem: str, *, paper: bool) -> str:
    """Caption of a figure such as "fig16-stress-curves"; with the paper's number if `paper`."""
    parts = re.fullmatch(r"(?:fig)?(\d+(?:-\d+)?)[-_](.+)", stem)
    number, name = (parts[1], parts[2]) if parts else ("", stem)
    if match := re.fullmatch(r"envelope-(.+)-([^-]+)", name):
        study, output = match.groups()
        text = f"Envelope of {output}" + ("" if study == "all" else f", study {study}")
    else:
        text = FIGURES.get(name.replace("_", "-"), name.replace("-", " "))
    numbers = [str(int(figure)) for figure in number.split("-") if paper and number]
    prefix = f"{'Figs.' if len(numbers) > 1 else 'Fig.'} {' to '.join(numbers)}: "
    return prefix + text if numbers else text
