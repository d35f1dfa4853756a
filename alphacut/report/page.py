"""The report of a run as one HTML page that needs nothing else: no network, no other file."""

from __future__ import annotations

import base64
import math
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature
from alphacut.io.files import Document, say
from alphacut.io.manifest import ResultsFolder
from alphacut.io.netcdf import damaged, dataset_of, read_summary, require_same_run
from alphacut.io.problem import InputProblem
from alphacut.questions.all import QUESTIONS
from alphacut.questions.question import Row
from alphacut.report.results import (
    ANSWERS,
    MEANING,
    Table,
    answers,
    drivers,
    material,
    natures,
    peak_table,
    unit_of,
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
    "records": ("How far does it move under each record?", "records", ()),
    **{question.key: (question.title, question.key, (question.key,)) for question in QUESTIONS},
    "shares": ("What drives the width?", "shares", ()),
}
"""Title, table and figures of each part of the summary."""
Piece = tuple[object, ...]
"""Name of a macro of ``report.html``, and what it shows."""
_TABLES = tomllib.loads(Path(__file__).with_name("captions.toml").read_text(encoding="utf-8"))
FIGURES: dict[str, str] = _TABLES["figures"] | {
    question.key: question.caption for question in QUESTIONS
}
WORDS: dict[str, str] = _TABLES["words"]


def render_page(folder: ResultsFolder) -> str:
    """The page for the results in a folder.

    Raises:
        RefusedError: The folder holds no results of a run, or of two, or of another program.
    """
    summary = read_summary(folder)
    try:
        require_same_run(summary, folder)
        return page(summary, folder)
    except (KeyError, TypeError, AttributeError, IndexError, ValueError) as error:
        raise damaged(folder, f"damaged ({type(error).__name__})") from error


def page(summary: Document, folder: ResultsFolder) -> str:
    """The HTML page for a summary and the results in a folder."""
    return render_template(
        title=summary["title"],
        name=summary["case"],
        about=" ".join(summary.get("about", "").split()),
        sections=Page(summary, folder).sections(),
        envelopes=[
            plot(name, envelope, folder) for name, envelope in summary.get("envelopes", {}).items()
        ],
    )


def comparison_page(first: Document, second: Document, table: Table) -> str:
    """The page for two summaries with the table of both side by side."""
    title, name = (f"{first[key]} and {second[key]}" for key in ("title", "case"))
    sections = [("Side by side", [("table", *table)])]
    return render_template(title=title, name=name, about="", sections=sections, envelopes=[])


def render_template(**parts: object) -> str:
    """The template of the page with its parts; all texts of it are escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    loader = FileSystemLoader(Path(__file__).parent)
    templates = Environment(autoescape=True, loader=loader, undefined=StrictUndefined)
    return templates.get_template("report.html").render(parts)


def plot(name: str, study: Document, folder: ResultsFolder) -> Document:
    """Data of a study for the interactive plot: by level and output, base64 of values over time."""
    dataset = dataset_of(folder.content(f"envelope_{name}.nc"))
    time = dataset["time"].values
    outputs = [str(output) for output in dataset["output"].values]
    bands = {side: dataset[side] for side in ("lower", "upper")}
    nature = Nature(study["nature"])
    contains_error = nature is Nature.GUARANTEED
    bands["error"] = dataset["lower"] * 0.0 if contains_error else dataset["error"]
    arrays = {side: band.transpose("alpha", "output", "time") for side, band in bands.items()}
    return {
        "name": name,
        "title": f"{name}: fuzzy {', '.join(study['fuzzy'])}",
        "fuzzy": len(study["fuzzy"]),
        "nature": str(nature),
        "alpha": dataset["alpha"].values.tolist(),
        "outputs": outputs,
        "units": [unit_of(study, output) for output in outputs],
        "step": float(time[1] - time[0]),
        **{
            side: [[packed_numbers(row) for row in level] for level in array.values]
            for side, array in arrays.items()
        },
    }


def packed_numbers(row: Array) -> str:
    """Numbers as little-endian 32-bit floats in base64."""
    return base64.b64encode(np.ascontiguousarray(row, "<f4").tobytes()).decode()


class Page:
    """The sections of one run.

    Args:
        summary: Its summary.
        folder: Its results.
    """

    def __init__(self, summary: Document, folder: ResultsFolder) -> None:
        self.summary, self.folder, self.tables = summary, folder, tables(summary)
        self.paper = any("fig" in name for name in summary.get("figures", ()))
        pictures = [name for name in summary["figures"] if name.endswith(".png")]
        self.unshown = {PurePosixPath(x).stem: x for x in pictures}  # that no section has shown yet

    def sections(self) -> Iterator[tuple[str, list[Piece]]]:
        """Yields title and pieces of each section that the results allow, in reading order.

        A piece is the name of a macro of the template, and what the macro shows.
        """
        summary = self.summary
        key_tables = (material(summary), peak_table(summary), (ANSWERS, answers(summary)))
        remarks = [*natures(summary), *drivers(summary)]
        key_pieces: list[Piece] = [("text", f"{MEANING}.")]
        key_pieces += [("table", *table) for table in key_tables]
        yield "Key results", [*key_pieces, *_texts(remarks)]
        for name, (title, table, drawn) in PARTS.items():
            if part := summary.get(name):
                yield title, [*self._figure_pieces(drawn), *self._part_pieces(name, part, table)]
        yield "Terms", [("glossary", TERMS.items())]
        figures = [*self._figure_pieces(tuple(self.unshown))]
        yield "More", [("folded", "All other figures", figures), *self._origin_pieces()]

    def _part_pieces(self, name: str, part: Document, table: str) -> Iterator[Piece]:
        """Yields the sentences and the table of a part of the summary, named `table`."""
        if name == "envelopes":
            yield ("plot",)
        yield from _texts(self._sentences(name, part))
        if table in self.tables:
            piece: Piece = ("table", *self.tables[table])
            is_answer = name in ("update", "shares", *(question.key for question in QUESTIONS))
            yield piece if is_answer else ("folded", "As a table", [piece])
        if name == "modulus":
            yield "folded", "Errors, checks and references", [("table", *_errors(part))]

    def _sentences(self, name: str, part: Document) -> Iterator[str]:
        """Yields the sentences that stand above the table of a part of the summary."""
        for question in QUESTIONS:
            if question.key == name:
                yield question.words(part)
        if name == "microstructure":
            count, kind = part.get("discs", part.get("spheres")), part["particles"]
            yield f"{count:,} {kind} in {part['packings']} sections or cubes."
            cells = "volume" if kind == "spheres" else "area"
            stated, mapped = part["fraction_of_case"], part[f"mean_{cells}_fraction_of_map"]
            beside = "" if stated is None else f"; the case says {stated:.4g}"
            yield f"Of the {cells} of the cells the map's particles take {mapped:.4f}{beside}."
        elif name == "image":
            yield "The bounds are those of the image as it was segmented, in plane strain."
            shares = (f"{x} {share:.1%}" for x, share in part["fractions"].items())
            yield f"Of the area: {', '.join(shares)}. {width_text(part)}."
        elif name == "update" and "refuted" in part:
            yield str(part["refuted"])
        elif name == "envelopes":
            omega = self.summary.get("structure", {}).get("omega_rad_per_s", ())
            if periods := ", ".join(f"{2 * math.pi / item:.3g}" for item in omega[:4]):
                yield f"Linear elastic, with natural periods of {periods} s."
            for study, item in part.items():
                yield f"{study}: {item['method']}, fuzzy {', '.join(item['fuzzy'])}"
            for nature in dict.fromkeys(Nature(study["nature"]) for study in part.values()):
                yield f"{str(nature).capitalize()}: {nature.sentence}"
        elif name == "shares":
            yield "Share of the width that is lost when an input is fixed at its modal value."

    def _figure_pieces(self, names: tuple[str, ...]) -> Iterator[Piece]:
        """Yields the figures of these names, without the paper's number, that the run has drawn.

        No SVG is taken from the folder: it could hold a script of somebody else.
        """
        for name in names:
            matches = (stem for stem in self.unshown if stem == name or stem.endswith(f"-{name}"))
            if (stem := next(matches, None)) is None:
                continue
            try:
                content = self.folder.content(self.unshown.pop(stem))
            except RefusedError as error:
                say(f"warning: a figure is left out: {InputProblem.from_error(error)}")
                continue
            yield "figure", caption(stem, paper=self.paper), base64.b64encode(content).decode()

    def _origin_pieces(self) -> Iterator[Piece]:
        """Yields the case file, the changes of the command line, and versions, all folded."""
        summary = self.summary
        yield "folded", f"Case {summary['case']}", [("code", summary["case_text"])]
        changes = [("code", change) for change in summary.get("changes", ())]
        yield "folded", "Changed on the command line", changes
        origin = f"Made by {summary['command']} in {summary['seconds']:.0f} s."
        versions = ("table", ("program", "version"), [*summary["versions"].items()])
        yield "folded", "Versions", [("text", origin), versions]


def _texts(texts: Iterator[str] | list[str]) -> Iterator[Piece]:
    return (("text", text) for text in texts)


def _errors(part: Document) -> Table:
    """Table of the errors of E by source, the largest violations of properties, and references."""
    errors, checks = part["error"].items(), part["checks"].items()
    rows: list[Row] = [(f"error: {in_words(x)}", f"{error:.2g} of E") for x, error in errors]
    rows += [(f"check: {in_words(x)}", f"{violation:.2g}") for x, violation in checks]
    references = {
        "hashin_shtrikman_E_GPa": "Hashin–Shtrikman bounds, isotropic composites",
        "mori_tanaka_E_GPa": "Mori–Tanaka, isotropic composites",
    }
    for key, value in part["references"].items():
        if key in references:
            ends = value if isinstance(value, list) else [value]
            rows.append((references[key], " … ".join(f"{end:.5g} GPa" for end in ends)))
    return ("source, property or reference at the modal values", "value"), rows


def in_words(name: str) -> str:
    """Name in words; an underscore becomes a space where there are none."""
    return WORDS.get(name, name.replace("_", " "))


def caption(stem: str, *, paper: bool) -> str:
    """Caption of a figure such as "fig16-stress-curves"; with the paper's number if `paper`."""
    parts = re.fullmatch(r"(?:fig)?(\d+(?:-\d+)?)[-_](.+)", stem)
    number, name = (parts[1], parts[2]) if parts else ("", stem)
    if match := re.fullmatch(r"envelope-(.+)-([^-]+)", name):
        study, output = match.groups()
        text = f"Envelope of {output}" + ("" if study == "all" else f", study {study}")
    else:
        text = FIGURES.get(name.replace("_", "-"), name.replace("-", " "))
    if not (paper and number):
        return text
    numbers = [str(int(figure)) for figure in number.split("-")]
    return f"{'Figs.' if len(numbers) > 1 else 'Fig.'} {' to '.join(numbers)}: {text}"
