"""The figures of a run, by the names of their files; drawn anew where what they show is new.

A new figure is a function here with its caption and its section of the page. Those of answers stand
with their analyses, and those that the paper alone needs in cases/paper_figures.py.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeVar

from alphacut.case.analyses import ANALYSES
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.quantities import Output
from alphacut.frame.structures.storey import yields
from alphacut.io.provenance import NESTED, version_of
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, StageContext, StageResult, StageStore
from alphacut.stages.suite import scaled_suite
from alphacut.stages.summary import Parts, Results

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Functions import what draws: Matplotlib takes a second, and a page needs the captions alone.


class RunFigure(NamedTuple):
    """A figure of a run.

    Args:
        caption: Its caption on the page.
        draw: Function that draws it. It takes the results of the run; of a study also its task, and
            of an output the output's name too. It returns None where the results have no such
            figure. None where a stage draws the figure itself, since what it shows is not kept.
        section: Name of the section of the page, which shows its figures in the order of
            `FIGURES`; empty for the last section, of all other figures.
        of: What has one such figure: the run, each study, or each drawn output of a study.
    """

    caption: str
    draw: Callable[..., Figure | None] | None = None
    section: str = ""
    of: Literal["run", "study", "output"] = "run"


FIGURES: dict[str, RunFigure] = {
    "pbox": RunFigure(
        "Measured distribution of the reduced radius, and the p-box of its fuzzy map",
        section="microstructure",
    ),
    "radius_map": RunFigure("Fuzzy map from θ to the reduced radius"),
    "image_circles": RunFigure("Circles that stand for the particles, drawn over the image"),
}
"""Figures by the beginning of their names; "-STUDY" or "-STUDY-OUTPUT" follows it. Those of stages
stand here, and each function with `figure` adds its own."""


F = TypeVar("F", bound="Callable[..., Figure | None]")


def figure(caption: str, section: str) -> Callable[[F], F]:
    """Register a function that draws a figure, by its own name with hyphens.

    Args:
        caption: Caption of the figure.
        section: Its section of the page; empty for the last one.
    """

    def register(draw: F) -> F:
        of: tuple[Literal["run", "study", "output"], ...] = ("run", "study", "output")
        kind = of[draw.__code__.co_argcount - 1]
        FIGURES[draw.__name__.replace("_", "-")] = RunFigure(caption, draw, section, kind)
        return draw

    return register


@figure("Fuzzy effective modulus", "modulus")
def modulus(results: Results) -> Figure | None:
    """Draw the fuzzy modulus, with the one that the case states."""
    from alphacut.figures import material

    if results.modulus is None:
        return None
    stated = getattr(results.content.structure_section, "modulus", None)
    return material.fuzzy_modulus(results.modulus, stated)


@figure("The image as segmented, and the proved bounds of E", "image")
def image(results: Results) -> Figure | None:
    """Draw the phases of an image or volume, and the α-cuts of its modulus."""
    from alphacut.figures import material

    return None if results.image is None else material.image(results.image.arrays)


@figure("Inputs before and after the measurement, level by level", "update")
def update_inputs(results: Results) -> Figure | None:
    """Draw the inputs before and after a measurement that did not refute all of them."""
    from alphacut.figures.answers import identified_inputs

    learned = results.learned
    if learned is None or learned.is_refuted:
        return None
    return identified_inputs(learned)


@figure(
    "The model at its nominal values: weight of each floor, stiffness and height of each storey;"
    " orange storeys yield",
    "structure",
)
def structure(results: Results) -> Figure | None:
    """Draw the model of a storey frame."""
    from alphacut.figures.structure import sketch

    model = None if results.structure is None else results.structure.model
    return sketch(model) if isinstance(model, StoreyFrame) else None


@figure("Spectra of the scaled records, their mean and median, and the target spectrum", "records")
def spectra(results: Results) -> Figure | None:
    """Draw the spectra of records that were scaled to a target."""
    from alphacut.figures.answers import draw_spectra

    if results.suite is None or not results.content.records or not results.structure:
        return None
    scaled = scaled_suite(results.content.records, results.structure)
    return None if scaled is None else draw_spectra(scaled)


@figure("Envelope of", "")
def envelope(results: Results, task: EnvelopeTask, name: str) -> Figure | None:
    """Draw the envelope of an output in a study."""
    from alphacut.figures.envelope import envelope

    structure = results.structure
    assert structure is not None  # of which the envelope is
    parts = Parts.of(results)
    return envelope(
        results.envelopes[task.name].arrays,
        Output(name, structure.unit(name)),
        task,
        parts.shown_units[name],
        peak=parts.envelopes[task.name].peak.get(name),
    )


@figure(
    "Peaks over the height: bands by α, lines at the highest α, dots at the farthest attained peak",
    "envelopes",
)
def profile(results: Results, task: EnvelopeTask) -> Figure | None:
    """Draw the peaks of a study over the height."""
    from alphacut.figures.structure import profiles

    peaks = results.envelopes[task.name].numbers.peak
    return profiles(peaks, Parts.of(results).shown_units)


@figure("Shear over drift of the storeys that yield", "envelopes")
def loops(results: Results, task: EnvelopeTask) -> Figure | None:
    """Draw the loops of the storeys that yield, in a study."""
    from alphacut.figures.structure import loops

    model = None if results.structure is None else results.structure.model
    if not isinstance(model, StoreyFrame) or not yields(model):
        return None
    peaks = results.envelopes[task.name].numbers.peak
    return loops(model, peaks, duration=task.duration, step=task.section.step)


def caption(name: str) -> str:
    """Return the caption of a figure from its name.

    Args:
        name: Name of the file without its ending. "figNUMBER-" before it gives the number in the
            paper, with which the caption begins. A figure that is not registered has its name as
            its caption, with blanks for the hyphens.
    """
    number = ""
    rest = name
    if match := re.fullmatch(r"fig(\d+)-(.+)", name):
        number = f"Fig. {match[1]}: "
        rest = match[2]
    captions = {name: entry.caption for name, entry in FIGURES.items()}
    for analysis in ANALYSES.values():
        captions |= {name: picture.caption for name, picture in analysis.pictures.items()}
    if rest in captions:
        return number + captions[rest]
    kind, _, study = rest.partition("-")
    found = FIGURES.get(kind)
    if found is None or found.of == "run":
        return number + rest.replace("-", " ")
    text = found.caption
    if found.of == "output":
        study, _, output = study.rpartition("-")
        text += f" {output}"
    if study != "all":  # the name of the study that [envelope] alone makes
        text += f", study {study}"
    return number + text


def drawings(results: Results) -> Iterator[tuple[str, Figure]]:
    """Yield the name of each figure that the results allow, and the figure, drawn when it is taken.

    Names are those of `FIGURES` and of the pictures of each answer. "-STUDY" follows in figures of
    a study, "-STUDY-OUTPUT" in those of an output; figures of the paper have "figNUMBER-" before.

    Args:
        results: Results of a run; stages that are missing have no figures.
    """
    for key, answer in results.answers.items():
        for name, picture in ANALYSES[key].pictures.items():
            drawing = resolve_name(picture.draw)(answer)
            if drawing is not None:
                yield name, drawing
    for name, registered in FIGURES.items():
        if not registered.draw:
            continue
        drawn: dict[str, tuple[object, ...]] = {}  # arguments by the name of the figure
        if registered.of == "run":
            drawn[name] = ()
        for task in results.tasks:
            if registered.of == "study":
                drawn[f"{name}-{task.name}"] = (task,)
            if registered.of == "output":
                for output in drawn_outputs(results, task):
                    number = f"fig{task.figures[output]}-" if output in task.figures else ""
                    drawn[f"{number}{name}-{task.name}-{output}"] = (task, output)
        for full_name, arguments in drawn.items():
            drawing = registered.draw(results, *arguments)
            if drawing is not None:
                yield full_name, drawing


def drawn_outputs(results: Results, task: EnvelopeTask) -> list[str]:
    """Return the outputs of a study that the case wants drawn over time; all if it names none."""
    study = results.envelopes[task.name]
    if not study.numbers.is_over_time:
        return []
    outputs = study.arrays["output"].values
    return list(task.figures) or [str(name) for name in outputs]


def draw_figures(results: Results, store: StageStore) -> list[str]:
    """Draw all figures of a run, unless those in its folder show the same.

    Args:
        results: Results of the run.
        store: Store of its results, which has a folder.

    Returns:
        Paths of the figures relative to the folder. The first ones were drawn by stage
        microstructure itself, since they need the particles, which are not kept.
    """
    from alphacut.figures.style import figure_style, save

    def compute(context: StageContext) -> StageResult[list[str]]:
        """Write the figures into the folder of the context; return their paths in it, sorted."""
        assert context.folder is not None  # a run with figures keeps its results
        paths = []
        with figure_style():
            for name, drawing in drawings(results):
                paths += save(drawing, context.folder / "figures" / name)
        return StageResult(sorted(path.relative_to(context.folder).as_posix() for path in paths))

    # The fingerprints stand for the results: figures are drawn anew where one of them is new.
    inputs = [results.content, results.answers, sorted(results.fingerprints.values())]
    inputs.append(version_of("matplotlib"))
    stage = Stage("figures", inputs, (*NESTED, "alphacut"), list[str], compute)
    names: list[str] = []
    if results.microstructure is not None:
        names.extend(results.microstructure.files)
    names.extend(store.take(stage).files)
    return [name for name in names if name.startswith("figures/")]
