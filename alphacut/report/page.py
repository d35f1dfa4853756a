"""The report of a run as one HTML page that needs nothing else: no network, no other file.

What stands on the page, and in which order, is said by the template report.html.
"""

from __future__ import annotations

import base64
import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path, PurePosixPath
from typing import NamedTuple

import xarray

from alphacut.base.errors import RefusedError
from alphacut.base.number_text import ShownUnit, Table
from alphacut.case.analyses import ANALYSES
from alphacut.figures.all import FIGURES, caption
from alphacut.frame import Sensitivity
from alphacut.frame.analyses.answer import table_of
from alphacut.fuzzy.result import Nature, of_enclosing_box
from alphacut.io.files import Document, say
from alphacut.io.results import ResultsFolder
from alphacut.report import results
from alphacut.report.tables import tables
from alphacut.stages.cell import isotropic_label
from alphacut.stages.envelope import EnvelopeResult
from alphacut.stages.summary import Summary


class Picture(NamedTuple):
    """Caption of a figure, and its PNG file in base64."""

    caption: str
    content: str


def render_page(folder: ResultsFolder) -> str:
    """Return the HTML page of the results in a folder, which needs no other file and no network.

    The template report.html says what stands on the page; it takes the names given here.

    Args:
        folder: Folder of the results of a run.

    Raises:
        RefusedError: Files are missing, damaged, or of different runs.
    """
    summary = Summary.read(folder)
    summary.require_run_of(folder)
    terms = tomllib.loads(Path(__file__).with_name("terms.toml").read_text(encoding="utf-8"))
    periods = ""
    storeys = None
    if (frame := summary.structure) is not None:
        # The first four periods show whether the structure is what its author meant.
        periods = ", ".join(f"{2 * math.pi / x:.3g}" for x in frame.omega_rad_per_s[:4])
        if frame.storeys:
            storeys = table_of(frame.storeys)
    envelopes: list[Document] = []
    for name, study in summary.envelopes.items():
        dataset = folder.dataset(f"envelope_{name}.nc")
        if study.is_over_time:
            envelopes.append(plot(name, study, dataset, summary.shown_units))
    return render_template(
        "report.html",
        title=summary.title,
        name=summary.case,
        about=" ".join(summary.about.split()),
        run=summary,
        meaning=results.MEANING,
        key_tables=results.key_tables(summary),
        key_sentences=results.key_sentences(summary),
        tables=tables(summary),
        figures=Figures(summary, folder),
        periods=periods,
        storeys=storeys,
        sensitivity=Sensitivity(summary.shares),
        terms=terms | {str(x).capitalize(): x.sentence for x in Nature},
        versions=Table(("program", "version"), list(summary.versions.items())),
        image_sentences=results.image_sentences,
        isotropic_label=isotropic_label,
        box_words=results.box_words,
        envelopes=envelopes,
        analyses=ANALYSES,
    )


def comparison_page(runs: Sequence[Summary], comparison: Table) -> str:
    """Return the page of several runs with the table of all side by side."""
    title = " and ".join(run.title for run in runs)
    name = " and ".join(run.case for run in runs)
    return render_template(
        "comparison.html", title=title, name=name, about="", comparison=comparison
    )


def render_template(template: str, **content: object) -> str:
    """Return a template of this folder filled with content.

    Args:
        template: Name of the file.
        content: Values by the names in the template. Special characters of HTML in texts are
            escaped, since names and titles come from a case that somebody else may have written.

    Raises:
        jinja2.UndefinedError: The template uses a name that `content` does not have.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # only reports need it

    loader = FileSystemLoader(Path(__file__).parent)
    # StrictUndefined raises for a name that is misspelt in the template, which would else be "".
    templates = Environment(
        autoescape=True,
        loader=loader,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    page = templates.get_template(template).render(content)
    # Titles and names may have characters that a terminal would execute when the page is printed
    # there, and that HTML does not allow: all of the control characters but tab and line feed.
    return re.sub(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", " ", page)


def plot(
    name: str, study: EnvelopeResult, dataset: xarray.Dataset, units: Mapping[str, ShownUnit]
) -> Document:
    """Return the data of a study for the interactive plot of report.js.

    Args:
        name: Name of the study.
        study: Its numbers.
        dataset: Its envelope, variables lower, upper and error over alpha, output and time, in SI
            units.
        units: Unit in which each output is shown.

    Returns:
        Document whose "factors" turn SI into the units shown and whose "step" is in s. "lower",
        "upper" and "error" are lists over levels of lists over outputs; an entry has all values
        over time in SI units, as 32-bit floats, low byte first, in base64. The error is zero if the
        envelope is guaranteed, since it then contains the error.
    """
    time = dataset["time"].values
    outputs = [str(output) for output in dataset["output"].values]
    # Inputs learned from a measurement are a set without a simple shape: bounds are computed for
    # the box that encloses it, as the title says. It is the same for all peaks of a study.
    encloses = next((peak.encloses for peak in study.peak.values()), "")
    box = ""
    if encloses:
        box = f", {of_enclosing_box(encloses)}"
    document: Document = {
        "name": name,
        "title": f"{name}: fuzzy {', '.join(study.fuzzy)}{box}",
        "fuzzy": len(study.fuzzy),
        "nature": str(study.nature),
        "alpha": dataset["alpha"].values.tolist(),
        "outputs": outputs,
        "units": [units[output].label for output in outputs],
        "factors": [units[output].factor for output in outputs],
        "step": float(time[1] - time[0]),
    }
    for side in ("lower", "upper", "error"):
        # Six digits are more than a screen shows, and half the size of double precision.
        values = dataset[side].transpose("alpha", "output", "time").values.astype("<f4")
        if side == "error" and study.nature is Nature.GUARANTEED:
            values = 0 * values
        document[side] = [
            [base64.b64encode(series.tobytes()).decode() for series in level] for level in values
        ]
    return document


class Figures:
    """Figures of a run that no section of its page has shown yet.

    Only PNG files are taken: an SVG file in the folder could hold a script of somebody else.

    Args:
        summary: The run, whose figures these are.
        folder: Folder of its results.
    """

    def __init__(self, summary: Summary, folder: ResultsFolder) -> None:
        pictures = [name for name in summary.figures if name.endswith(".png")]
        self.paths = {PurePosixPath(path).stem: path for path in pictures}
        self.folder = folder

    def take(self, name: str) -> Picture | None:
        """Return a figure by its name, and forget it, so that `others` leaves it out.

        The name is removed from `paths`, which has the files of all figures that are left.

        Returns:
            Caption and content; None if the run has no such figure, it was taken before, or its
            file is missing or damaged, of which a warning is printed.
        """
        # Sections of the page take the figures that they know; the rest follows at its end.
        path = self.paths.pop(name, None)
        if path is None:
            return None
        try:
            content = self.folder.content(path)
        except RefusedError as error:
            say(f"warning: a figure is left out: {error}")
            return None
        return Picture(caption(name), base64.b64encode(content).decode())

    def of(self, section: str, study: str = "") -> Iterator[Picture | None]:
        """Yield the figures of a section of the page; those of a study, if one is named."""
        for name, registered in FIGURES.items():
            if registered.section == section:
                yield self.take(f"{name}-{study}" if study else name)

    def others(self) -> Iterator[Picture | None]:
        """Yield the figures that are left."""
        for name in list(self.paths):
            yield self.take(name)
