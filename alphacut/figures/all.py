"""Every figure of a run, by the name of its file; drawn anew where what it shows is new.

Figures that the paper alone needs are drawn by cases/paper_figures.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from pkgutil import resolve_name

from matplotlib.figure import Figure

from alphacut.case.analyses import ANALYSES
from alphacut.figures import answers, envelope, material, structure
from alphacut.figures.style import figure_style, save
from alphacut.frame import StoreyFrame
from alphacut.frame.structures.storey import yields
from alphacut.io.provenance import NESTED, version_of
from alphacut.stages.store import Stage, StageContext, StageResult, StageStore
from alphacut.stages.suite import scaled_suite
from alphacut.stages.summary import Parts, Results


def drawings(results: Results) -> Iterator[tuple[str, Figure]]:
    """Yield the name of each figure that the results allow, and the figure, drawn when it is taken.

    Names are "modulus", "image", "update-inputs", "structure", "spectra", those of the pictures of
    each answer, and of a study "envelope-STUDY-OUTPUT" for each drawn output, "profile-STUDY" and
    "loops-STUDY". Figures of the paper have "figNUMBER-" before the name.

    Args:
        results: Results of a run; stages that are missing have no figures.
    """
    if results.modulus is not None:
        stated = getattr(results.content.structure_section, "modulus", None)
        yield "modulus", material.fuzzy_modulus(results.modulus, stated)
    if results.image is not None:
        yield "image", material.image(results.image.arrays)
    if results.learned is not None and not results.learned.is_refuted:
        yield "update-inputs", answers.identified_inputs(results.learned)
    model = None if results.structure is None else results.structure.model
    if isinstance(model, StoreyFrame):
        yield "structure", structure.sketch(model)
    if results.suite is not None and results.content.records and results.structure:
        scaled = scaled_suite(results.content.records, results.structure)
        if scaled is not None:
            yield "spectra", answers.draw_spectra(scaled)
    for key, answer in results.answers.items():
        for name, picture in ANALYSES[key].pictures.items():
            figure = resolve_name(picture.draw)(answer)
            if figure is not None:
                yield name, figure
    units = Parts.of(results).shown_units
    for task in results.tasks:
        yield from envelope.drawings(task, results)
        peaks = results.envelopes[task.name].numbers.peak
        profile = structure.profiles(peaks, units)
        if profile is not None:
            yield f"profile-{task.name}", profile
        if yields(model):
            times = {"duration": task.duration, "step": task.section.step}
            yield f"loops-{task.name}", structure.loops(model, peaks, **times)


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
