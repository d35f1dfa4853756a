"""Every figure of a run, by the name of its file; drawn anew where what it shows is new.

Figures that the paper alone needs are drawn by cases/paper_figures.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from pkgutil import resolve_name

from matplotlib.figure import Figure

from alphacut.case.analyses import ANALYSES
from alphacut.figures import answers, material, structure
from alphacut.figures.register import FIGURES
from alphacut.figures.style import figure_style, save
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.storey import yields
from alphacut.io.provenance import NESTED, version_of
from alphacut.stages.envelope import EnvelopeTask
from alphacut.stages.store import Stage, StageContext, StageResult, StageStore
from alphacut.stages.suite import scaled_suite
from alphacut.stages.summary import Parts, Results


def drawings(results: Results) -> Iterator[tuple[str, Figure]]:
    """Yield the name of each figure that the results allow, and the figure, drawn when it is taken.

    Names are those of `FIGURES` and of the pictures of each answer. "-STUDY" follows in figures of
    a study, "-STUDY-OUTPUT" in those of an output; figures of the paper have "figNUMBER-" before.

    Args:
        results: Results of a run; stages that are missing have no figures.
    """
    for key, answer in results.answers.items():
        for name, picture in ANALYSES[key].pictures.items():
            figure = resolve_name(picture.draw)(answer)
            if figure is not None:
                yield name, figure
    for name, registered in FIGURES.items():
        if not registered.draw:
            continue
        draw = resolve_name(registered.draw)
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
            figure = draw(results, *arguments)
            if figure is not None:
                yield full_name, figure


def drawn_outputs(results: Results, task: EnvelopeTask) -> list[str]:
    """Return the outputs of a study that the case wants drawn over time; all if it names none."""
    study = results.envelopes[task.name]
    if not study.numbers.is_over_time:
        return []
    outputs = study.arrays["output"].values
    return list(task.figures) or [str(name) for name in outputs]


def modulus(results: Results) -> Figure | None:
    """Draw the fuzzy modulus, with the one that the case states."""
    if results.modulus is None:
        return None
    stated = getattr(results.content.structure_section, "modulus", None)
    return material.fuzzy_modulus(results.modulus, stated)


def image(results: Results) -> Figure | None:
    """Draw the phases of an image or volume, and the α-cuts of its modulus."""
    return None if results.image is None else material.image(results.image.arrays)


def inputs_learned(results: Results) -> Figure | None:
    """Draw the inputs before and after a measurement that did not refute all of them."""
    learned = results.learned
    if learned is None or learned.is_refuted:
        return None
    return answers.identified_inputs(learned)


def sketch(results: Results) -> Figure | None:
    """Draw the model of a storey frame."""
    model = None if results.structure is None else results.structure.model
    return structure.sketch(model) if isinstance(model, StoreyFrame) else None


def spectra(results: Results) -> Figure | None:
    """Draw the spectra of records that were scaled to a target."""
    if results.suite is None or not results.content.records or not results.structure:
        return None
    scaled = scaled_suite(results.content.records, results.structure)
    return None if scaled is None else answers.draw_spectra(scaled)


def profiles(results: Results, task: EnvelopeTask) -> Figure | None:
    """Draw the peaks of a study over the height."""
    peaks = results.envelopes[task.name].numbers.peak
    return structure.profiles(peaks, Parts.of(results).shown_units)


def loops(results: Results, task: EnvelopeTask) -> Figure | None:
    """Draw the loops of the storeys that yield, in a study."""
    model = None if results.structure is None else results.structure.model
    if not isinstance(model, StoreyFrame) or not yields(model):
        return None
    peaks = results.envelopes[task.name].numbers.peak
    return structure.loops(model, peaks, duration=task.duration, step=task.section.step)


def draw_figures(results: Results, store: StageStore) -> list[str]:
    """Draw all figures of a run, unless those in its folder show the same.

    Args:
        results: Results of the run.
        store: Store of its results, which has a folder.

    Returns:
        Paths of the figures relative to the folder. The first ones were drawn by stage
        microstructure itself, since they need the particles, which are not kept.
    """

    def compute(context: StageContext) -> StageResult[list[str]]:
        """Write the figures into the folder of the context; return their paths in it, sorted."""
        assert context.folder is not None  # a run with figures keeps its results
        paths = []
        with figure_style():
            for name, figure in drawings(results):
                paths += save(figure, context.folder / "figures" / name)
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
