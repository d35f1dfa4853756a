"""Every figure of a run, by the name of its file."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.figures import envelope as figure_envelope
from alphacut.figures import follower as figure_follower
from alphacut.figures import frame as figure_frame
from alphacut.figures import image as figure_image
from alphacut.figures import modulus as figure_modulus
from alphacut.figures import questions as figure_questions
from alphacut.figures import radius as figure_radius
from alphacut.figures import shares as figure_shares
from alphacut.figures.captions import is_figure
from alphacut.figures.mesh import draw_mesh
from alphacut.figures.style import save, style
from alphacut.fuzzy.campaign.workers import submitted
from alphacut.io.files import as_json, write_text
from alphacut.io.progress import Tick, progress
from alphacut.questions.table import QUESTIONS
from alphacut.stages import microstructure
from alphacut.stages.cell import modal_parts
from alphacut.stages.results import Results

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

KEPT = "figures/.kept.json"
PARTS = 6  # into which the figures are dealt out, so that no process waits long for the other
Drawing = tuple[str, Callable[[], "Figure"]]


def drawings(results: Results) -> Iterator[Drawing]:
    """Name and function of each figure that the results allow."""
    if results.content.radius:
        yield from radius_drawings(results)
    yield from material_drawings(results)
    if results.envelopes:
        yield "fig20-mapping", lambda: figure_modulus.mapping(results)
    yield from structure_drawings(results)
    if results.envelopes:
        yield from follower_drawings(results)
    yield from update_drawings(results)
    yield from question_drawings(results)
    for study in results.tasks:
        yield from figure_envelope.drawings(study, results.envelopes[study.name])


def radius_drawings(results: Results) -> Iterator[Drawing]:
    """The map of radii; the stage microstructure draws the first two from its particles."""
    radius = results.content.radius
    assert radius is not None
    if results.microstructure is None:
        if results.is_paper:
            yield "fig11-radii", lambda: figure_radius.radii(radius)
        yield "fig13-p-box", lambda: figure_radius.p_box(radius)
    yield "fig14-cone", lambda: figure_radius.cone(radius)


def material_drawings(results: Results) -> Iterator[Drawing]:
    """Fuzzy modulus, image, response of the stress."""
    frame = results.content.frame
    if (modulus := results.modulus) is not None:
        yield "fig16-stress-curves", lambda: figure_modulus.stress_curves(modulus)
        yield "fig17-mean-stress", lambda: figure_modulus.mean_stress(modulus)
        yield "fig18-modulus", lambda: figure_modulus.fuzzy_modulus(modulus, frame)
        if results.is_paper:
            yield "fig19-membership", lambda: figure_modulus.membership(modulus)
    if (picture := results.image) is not None:
        yield "image", lambda: figure_image.image(picture)
    if (stress := results.response) is not None:
        yield "response", lambda: figure_modulus.response(stress)


def structure_drawings(results: Results) -> Iterator[Drawing]:
    """The structure whose envelopes were computed, and its record."""
    structure, frame = results.structure, results.content.frame
    if results.envelopes and frame is not None:
        yield "fig26-frame", lambda: figure_frame.frame(frame)
        yield "fig27-chain", lambda: figure_frame.chain(frame)
    model = None if structure is None else structure.linear
    if model is not None and (shaken := model.ground) is not None:
        yield "record", lambda: figure_envelope.record(shaken)


def follower_drawings(results: Results) -> Iterator[Drawing]:
    """How the Graph Follower walks, for the study of most fuzzy inputs."""
    richest = max(results.tasks, key=lambda study: len(study.fuzzy))
    if richest.section.method == "graph-follower":
        yield "fig21-25-graph-follower", lambda: figure_follower.follower(results, richest)


def question_drawings(results: Results) -> Iterator[Drawing]:
    """Answers to the questions of the case."""
    for question in QUESTIONS:
        if question.key in results.answers:
            yield question.key, partial(question.figure, results.answers[question.key])


def update_drawings(results: Results) -> Iterator[Drawing]:
    """Inputs and envelopes before and after measured modes, unless they refute the frame."""
    bands, learned = results.update, results.learned
    if learned is None or bands is None or learned.posterior is None:
        return
    yield "update-inputs", partial(figure_questions.boxes, learned)
    for output in map(str, bands["output"].values):
        yield f"update-{output}", partial(figure_questions.bands, bands, output)


def draw_shares(driving: xarray.Dataset, results: Results) -> list[str]:
    """Draw what drives the widths; names of the files."""
    every = {"modulus_share": "shares-modulus", "share": "shares-over-time"}
    make = {"modulus_share": figure_shares.of_modulus, "share": figure_shares.over_time}
    todo = [(name, partial(make[of], driving)) for of, name in every.items() if of in driving]
    return drawn_now(todo, results)


def file_stem(name: str, results: Results) -> str:
    """The figure's name; the paper's number leads it in the paper's case alone."""
    return name if results.is_paper else re.sub(r"^fig[\d-]+-", "", name)


def draw(
    results: Results,
    driving: xarray.Dataset,
    meshes: Mapping[str, Future[bool]],
    *,
    executor: Executor | None = None,
    quiet: bool = False,
) -> list[str]:
    """Draw every figure as SVG and PNG into figures/; returns the names of the files.

    Args:
        results: Of the run.
        driving: What drives the widths.
        meshes: Pictures of the mesh under way, see `begin_meshes`.
        executor: Processes that draw side by side; None: this one draws.
        quiet: No progress.
    """
    names = drawn_in_parts(results, executor, quiet=quiet)
    names += submitted(executor, draw_shares, driving, results).result()
    names += [name for name, made in meshes.items() if made.result()]
    return [*particle_pictures(results), *names]


def begin_meshes(results: Results, executor: Executor | None) -> dict[str, Future[bool]]:
    """Pictures of the mesh under way, by their files; False where there is no display."""
    content, pictures = results.content, mesh_pictures(results)
    if not pictures or content.radius is None or content.round is None:
        return {}
    cell, mesh = modal_parts(content.radius, content.round), content.mesh
    return {
        name: submitted(executor, draw_mesh, cell, mesh, results.folder / name, kind)
        for name, kind in pictures.items()
    }


def keep(folder: Path, key: str, names: Sequence[str]) -> None:
    """Write down which figures were drawn, and the fingerprint of what they show."""
    write_text(folder / KEPT, as_json({"fingerprint": key, "figures": names}))


def kept(folder: Path, key: str) -> list[str] | None:
    """Names of an earlier run's figures, if all are there and show what has this fingerprint."""
    names = written_down(folder / KEPT, key)
    there = all((folder / name).is_file() and (folder / name).stat().st_size for name in names)
    return names if names and there else None


def sweep(folder: Path, names: Iterable[str]) -> None:
    """Remove figures that an earlier run has written down and that are not among `names`."""
    gone = {*written_down(folder / "summary.json"), *written_down(folder / KEPT)} - {*names}
    for path in map(Path, gone):
        drawn = path.parent == Path("figures") and path.suffix in (".svg", ".png")
        if drawn and is_figure(path.stem):
            with suppress(OSError, ValueError):  # not there, or no name of a file
                (folder / path).unlink()
    if gone:
        (folder / KEPT).unlink(missing_ok=True)


def written_down(file: Path, key: str = "") -> list[str]:
    """Names of an earlier run's figures; none of a damaged file or one of another fingerprint."""
    try:
        told = json.loads(file.read_text(encoding="utf-8"))
        names = told["figures"] if not key or told["fingerprint"] == key else []
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return []
    return [*map(str, names)] if isinstance(names, list) else []


def drawn_in_parts(results: Results, executor: Executor | None, *, quiet: bool) -> list[str]:
    """Draw all figures of the results, in parts where processes share them."""
    count = len(list(drawings(results)))
    parts = count if executor is None else min(count, PARTS)
    names: dict[int, list[str]] = {}
    with progress("Figures", quiet=quiet) as tick:
        own = tick if executor is None else None
        drawn = [submitted(executor, draw_part, results, k, parts, own) for k in range(parts)]
        for done, part in enumerate(drawn, start=1):
            names |= part.result()
            if tick:
                tick(done / parts)
    return [name for place in sorted(names) for name in names[place]]


def draw_part(
    results: Results, part: int, parts: int, tick: Tick | None = None
) -> dict[int, list[str]]:
    """Draw every figure whose place leaves the rest `part`; names of their files by place."""
    todo = list(drawings(results))
    places = range(part, len(todo), parts)
    if tick:
        tick((part + 1) / parts)
    return {k: drawn_now([todo[k]], results) for k in places}


def drawn_now(todo: Iterable[Drawing], results: Results) -> list[str]:
    """Draw some figures; names of their files."""
    with style():
        return [
            str(path.relative_to(results.folder))
            for name, make in todo
            for path in save(make(), results.folder / "figures" / file_stem(name, results))
        ]


def particle_pictures(results: Results) -> list[str]:
    """Names of the figures of the microstructure stage, where the case has it."""
    found = [] if results.microstructure is None else microstructure.pictures(results.folder)
    return [str(path.relative_to(results.folder)) for path in found]


def mesh_pictures(results: Results) -> dict[str, str]:
    """Files and kinds of fig. 15 and of the stress on slices, where prisms gave the modulus."""
    if results.modulus is None or results.content.modulus.method != "prism":
        return {}
    mesh = f"figures/{file_stem('fig15-prism-mesh', results)}.png"
    return {mesh: "mesh", "figures/stress-on-slices.png": "stress"}
