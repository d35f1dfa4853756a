"""Every figure of a run, by the name of its file; drawn anew where what it shows is new."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from alphacut.figures import envelope, material, overview, structure
from alphacut.figures.style import figure_style, save
from alphacut.frame import Fragility
from alphacut.fuzzy import FuzzyNumber, PiecewiseLinear
from alphacut.fuzzy.campaign.workers import submit
from alphacut.io.provenance import NESTED, version_of
from alphacut.stages.cell import GPA, CellProblem
from alphacut.stages.store import Stage, StageContext, StageResult, StageStore
from alphacut.stages.summary import Results

PARTS = 6  # tasks that the figures are divided into, so that no process waits long for another
Drawing = tuple[str, Callable[[], Figure]]


def drawings(results: Results) -> Iterator[Drawing]:
    """Yields the name of each figure that the results allow, and the function that draws it."""
    yield from _material_figures(results)
    yield from _structure_figures(results)
    if results.learned is not None and not results.learned.is_refuted:
        yield "update-inputs", partial(envelope.identified_inputs, results.learned)
    for key, answer in results.answers.items():
        yield key, partial(envelope.DRAWINGS[key], answer)
        if isinstance(answer, Fragility) and answer.increments:
            yield "fragility-curves", partial(envelope.draw_incremental, answer)
    for task in results.tasks:
        yield from envelope.drawings(task, results)


def _material_figures(results: Results) -> Iterator[Drawing]:
    content, mesh, modulus = results.content, results.content.mesh, results.modulus
    is_round = modulus is not None and content.particle_cell is not None
    if is_round and content.modulus.method == "prism":
        cell = CellProblem.of(content).nominal
        yield "fig15-prism-mesh", partial(overview.draw_mesh, cell, mesh.size, mesh.layers)
        if results.is_paper:
            yield "fig01-domains", partial(overview.domains, cell, mesh.size, mesh.layers)
    if (radius_map := content.radius_map) is not None:
        if results.microstructure is None:  # which draws its own p-box
            yield "fig13-p-box", partial(material.p_box, radius_map)
        yield "fig14-cone", partial(material.cone, radius_map)
    if modulus is not None:
        yield "fig16-stress-curves", partial(material.stress_curves, modulus.arrays)
        yield "fig17-mean-stress", partial(material.mean_stress, modulus.arrays)
        stated = getattr(content.structure_section, "modulus", None)
        yield "fig18-modulus", partial(material.fuzzy_modulus, modulus, stated)
    if modulus is not None and results.is_paper:
        yield "fig19-membership", partial(material.membership, modulus.arrays)
        inclusion = getattr(content.cell, "inclusion_modulus", None)
        if isinstance(inclusion, FuzzyNumber):
            cuts = modulus.numbers.E_GPa
            ends = (tuple(GPA * cuts.lower), tuple(GPA * cuts.upper))
            effective = PiecewiseLinear(tuple(modulus.numbers.alpha), *ends)
            yield "fig36-fuzzy-numbers", partial(overview.kinds_of_numbers, inclusion, effective)
            yield "fig37-alpha-cuts", partial(overview.alpha_cuts, inclusion)
    if results.image is not None:
        yield "image", partial(material.image, results.image.arrays)


def _structure_figures(results: Results) -> Iterator[Drawing]:
    if not results.envelopes or results.structure is None:
        return
    if results.is_paper:
        yield "fig02-stages", partial(overview.stages, results)
    yield "fig20-mapping", partial(envelope.mapping, results)
    if results.structure.model.floors:
        yield "fig26-frame", partial(structure.draw_frame, results.structure)
        yield "fig27-chain", partial(structure.draw_chain, results.structure)
    task = max(results.tasks, key=lambda task: len(task.fuzzy))
    if task.section.method == "graph-follower":
        steps = partial(structure.graph_follower_steps, results, task)
        yield "fig21-25-graph-follower", steps


def draw_figures(results: Results, store: StageStore, executor: Executor | None) -> list[str]:
    """Draws all figures, by `PARTS` tasks, anew where what they show is new; returns their paths.

    The paths are those in the results' folder.
    """

    def compute(context: StageContext) -> StageResult[list[str]]:
        assert context.folder is not None
        tasks = [submit(executor, draw_part, results, context.folder, k) for k in range(PARTS)]
        names = list[str]()
        for count, task in enumerate(tasks, start=1):
            names += task.result()
            context.tick(count / len(tasks))
        return StageResult(sorted(names))

    inputs = [results.content, results.answers, sorted(results.fingerprints.values())]
    inputs.append(version_of("matplotlib"))
    figures = store.take(Stage("figures", inputs, (*NESTED, "alphacut"), list[str], compute))
    before = () if results.microstructure is None else results.microstructure.files
    return [name for name in (*before, *figures.files) if name.startswith("figures/")]


def draw_part(results: Results, folder: Path, part: int) -> list[str]:
    """Draws the figures whose index modulo `PARTS` is `part`; returns their paths in `folder`.

    Only in the case of the paper names of files have the paper's numbers.
    """
    paths = list[Path]()
    with figure_style():
        for name, draw in list(drawings(results))[part::PARTS]:
            stem = name if results.is_paper else re.sub(r"^fig[\d-]+-", "", name)
            paths += save(draw(), folder / "figures" / stem)
    return [str(path.relative_to(folder)) for path in paths]
