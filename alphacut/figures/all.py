"""Every figure of a run, by the name of its file; drawn anew where what it shows is new."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.export.mesh import draw_mesh
from alphacut.figures import envelope, material, overview, structure
from alphacut.fuzzy import FuzzyNumber, PiecewiseLinear
from alphacut.fuzzy.campaign.workers import submit
from alphacut.io.provenance import NESTED, version_of
from alphacut.questions.summary import Results
from alphacut.stages.cell import GPA, CellProblem
from alphacut.stages.identify import IdentifiedResult
from alphacut.stages.store import Stage, StageContext, StageResult, StageStore
from alphacut.stochastic.figures.style import figure_style, save

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PARTS = 6  # tasks that the figures are divided into, so that no process waits long for another
Drawing = tuple[str, Callable[[], "Figure"]]


def drawings(results: Results) -> Iterator[Drawing]:
    """Yields the name of each figure that the results allow, and the function that draws it."""
    yield from _material_figures(results)
    yield from _structure_figures(results)
    if isinstance(results.learned, IdentifiedResult):
        yield "update-inputs", partial(envelope.identified_inputs, results.learned)
    if results.suite is not None:
        yield "spectra", partial(envelope.spectra, results.suite)
    for key, answer in results.answers.items():
        yield key, partial(envelope.DRAWINGS[key], answer)
    for task in results.tasks:
        yield from envelope.drawings(task, results)


def _material_figures(results: Results) -> Iterator[Drawing]:
    """Figures of the radius map, the modulus, the stresses and the image, by name."""
    content, radius_map = results.content, results.content.radius_map
    if results.is_paper and content.modulus.method == "prism":
        cell, mesh = CellProblem.of(content).nominal, content.mesh
        yield "fig01-domains", partial(overview.domains, cell, mesh.size, mesh.layers)
    if radius_map is not None and results.microstructure is None:  # which draws its own p-box
        yield "fig13-p-box", partial(material.p_box, radius_map)
    if radius_map is not None:
        yield "fig14-cone", partial(material.cone, radius_map)
    if (data := results.modulus) is not None and results.is_paper:
        inclusion = getattr(content.cell, "inclusion_modulus", None)
        if isinstance(inclusion, FuzzyNumber):
            cuts = data.numbers.E_GPa
            bounds = (GPA * cuts.lower, GPA * cuts.upper)
            effective = PiecewiseLinear(tuple(data.numbers.alpha), *map(tuple, bounds))
            yield ("fig36-fuzzy-numbers", partial(overview.kinds_of_numbers, inclusion, effective))
            yield "fig37-alpha-cuts", partial(overview.alpha_cuts, inclusion)
    if (data := results.modulus) is not None:
        yield "fig16-stress-curves", partial(material.stress_curves, data.arrays)
        yield "fig17-mean-stress", partial(material.mean_stress, data.arrays)
        yield "fig18-modulus", partial(material.fuzzy_modulus, data, results.content.frame)
        if results.is_paper:
            yield "fig19-membership", partial(material.membership, data.arrays)
    if results.image is not None:
        yield "image", partial(material.image, results.image.arrays)


def _structure_figures(results: Results) -> Iterator[Drawing]:
    """Figures of the structure, its fuzzy mapping and a run of the Graph Follower, by name."""
    if not results.envelopes or results.structure is None:
        return
    if results.is_paper:
        yield "fig02-stages", partial(overview.stages, results)
    yield "fig20-mapping", partial(envelope.mapping, results)
    if (section := results.content.frame) is not None:
        yield "fig26-frame", partial(structure.draw_frame, section)
        yield "fig27-chain", partial(structure.draw_chain, section)
    widest_task = max(results.tasks, key=lambda task: len(task.fuzzy))
    if widest_task.section.method == "graph-follower":
        yield (
            "fig21-25-graph-follower",
            partial(structure.graph_follower_steps, results, widest_task),
        )


def draw_figures(results: Results, store: StageStore, executor: Executor | None) -> list[str]:
    """Draws all figures as SVG and PNG into figures/, unless stored ones have the same inputs.

    Returns the paths of the files, relative to the folder of the results.
    """
    inputs = [results.content, results.answers]
    inputs += [sorted(results.fingerprints.values())]
    inputs += [version_of(name) for name in ("matplotlib", "pyvista")]
    compute = partial(draw_all, results, executor)
    figures = store.take(Stage("figures", inputs, (*NESTED, "alphacut"), list[str], compute))
    before = () if results.microstructure is None else results.microstructure.files
    return [name for name in (*before, *figures.files) if name.startswith("figures/")]


def draw_all(
    results: Results, executor: Executor | None, context: StageContext
) -> StageResult[list[str]]:
    """Draws all figures by `PARTS` tasks; returns the names of the files."""
    assert context.folder is not None
    folder = context.folder
    mesh_futures = _submit_mesh(results, folder, executor)
    parts = [submit(executor, draw_part, results, folder, part) for part in range(PARTS)]
    names = []
    for count, part in enumerate(parts, start=1):
        names += part.result()
        context.tick(count / PARTS)
    drawn_meshes = [name for name, future in mesh_futures.items() if future.result()]
    return StageResult([*sorted(names), *drawn_meshes])


def draw_part(results: Results, folder: Path, part: int) -> list[str]:
    """Draws the figures whose index modulo `PARTS` is `part`; returns their paths in `folder`."""
    with figure_style():
        return [
            str(path.relative_to(folder))
            for name, draw in list(drawings(results))[part::PARTS]
            for path in save(draw(), folder / "figures" / file_stem(name, results))
        ]


def file_stem(name: str, results: Results) -> str:
    """Name of a figure's files: with the paper's number only in the case of the paper."""
    return name if results.is_paper else re.sub(r"^fig[\d-]+-", "", name)


def _submit_mesh(
    results: Results, folder: Path, executor: Executor | None
) -> dict[str, Future[bool]]:
    """Future of drawing the mesh (Fig. 15) by its file: true if drawn; empty without prisms."""
    prisms = results.content.particle_cell is not None and results.content.modulus.method == "prism"
    if results.modulus is None or not prisms:
        return {}
    name = f"figures/{file_stem('fig15-prism-mesh', results)}.png"
    cell = CellProblem.of(results.content).nominal
    return {name: submit(executor, draw_mesh, cell, results.content.mesh, folder / name)}
