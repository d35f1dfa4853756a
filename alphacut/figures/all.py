"""Every figure of a run, by the name of its file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.figures import envelope as figure_envelope
from alphacut.figures import follower as figure_follower
from alphacut.figures import frame as figure_frame
from alphacut.figures import fuzzy as figure_fuzzy
from alphacut.figures import image as figure_image
from alphacut.figures import modulus as figure_modulus
from alphacut.figures import questions as figure_questions
from alphacut.figures import radius as figure_radius
from alphacut.figures import response as figure_response
from alphacut.figures import shares as figure_shares
from alphacut.figures import update as figure_update
from alphacut.figures.style import save, style
from alphacut.io.progress import progress
from alphacut.stages.pipeline import Results
from alphacut.stages.vibration.exceedance import events

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

Drawing = tuple[str, Callable[[], "Figure"]]


def drawings(results: Results) -> Iterator[Drawing]:
    """Name and function of each figure that the results allow."""
    from alphacut.frame.structures.field_frame import FieldFrame

    if results.case.sections.radius:
        if "microstructure" not in results.case.stages:  # that stage draws both from its particles
            if results.case.quoted:
                yield "fig11-radii", lambda: figure_radius.radii(results.case)
            yield "fig13-p-box", lambda: figure_radius.p_box(results.case)
        yield "fig14-cone", lambda: figure_radius.cone(results.case)
    if (modulus := results.modulus) is not None:
        yield "fig16-stress-curves", lambda: figure_modulus.stress_curves(modulus)
        yield "fig17-mean-stress", lambda: figure_modulus.mean_stress(modulus)
        yield "fig18-modulus", lambda: figure_modulus.fuzzy_modulus(modulus, results.case)
        if results.case.quoted:
            yield "fig19-membership", lambda: figure_fuzzy.membership(modulus)
    if (picture := results.image) is not None:
        yield "image", lambda: figure_image.image(picture)
    if (stress := results.response) is not None:
        yield "response", lambda: figure_response.response(stress)
    if results.envelopes:
        yield "fig20-mapping", lambda: figure_fuzzy.mapping(results)
    if results.envelopes and results.case.sections.frame:
        yield "fig26-frame", lambda: figure_frame.frame(results.case)
        yield "fig27-chain", lambda: figure_frame.chain(results.case)
        built = None if results.structure is None else results.structure.frame
        if isinstance(built, FieldFrame):
            yield "field", partial(figure_frame.field, built.field)
    if results.envelopes and results.case.sections.tower:
        yield "tower", lambda: figure_frame.tower(results.case)
    model = None if results.structure is None else results.structure.linear
    if model is not None and (shaken := model.ground) is not None:
        yield "record", lambda: figure_envelope.record(shaken)
    if (
        results.case.sections.envelope
        and results.case.envelope.method == "graph-follower"
        and results.envelopes
    ):
        richest = max(results.studies, key=lambda study: len(study.task.fuzzy))
        yield "fig21-25-graph-follower", lambda: figure_follower.follower(results, richest)
    yield from update_drawings(results)
    if results.exceedance is not None:
        for limited in events(results.exceedance):
            several = "event" in results.exceedance.dims
            stem = f"exceedance-{str(limited.attrs['output']).replace(' ', '-')}"
            yield stem if several else "exceedance", partial(figure_envelope.exceedance, limited)
    if (decided := results.decision) is not None:
        yield "decision", lambda: figure_questions.decision(decided)
    if (hull := results.joint) is not None:
        yield "joint", lambda: figure_questions.joint(hull)
    for study in results.studies:
        yield from figure_envelope.drawings(study, results.envelopes[study.name])


def update_drawings(results: Results) -> Iterator[Drawing]:
    """Inputs and envelopes before and after measured modes, unless they refute the frame."""
    bands, learned = results.update, results.learned
    if learned is None or bands is None or learned.posterior is None:
        return
    yield "update-inputs", partial(figure_update.boxes, learned)
    for output in map(str, bands["output"].values):
        yield f"update-{output}", partial(figure_update.bands, bands, output)


def share_drawings(driving: xarray.Dataset) -> Iterator[Drawing]:
    """Figures of what drives the widths."""
    if "modulus_share" in driving:
        yield "shares-modulus", lambda: figure_shares.of_modulus(driving)
    if "share" in driving:
        yield "shares-over-time", lambda: figure_shares.over_time(driving)


def file_stem(name: str, results: Results) -> str:
    """The figure's name; the paper's number leads it in the paper's case alone."""
    return name if results.case.quoted else re.sub(r"^fig[\d-]+-", "", name)


def draw(results: Results, driving: xarray.Dataset, *, quiet: bool = False) -> list[str]:
    """Draw every figure as SVG and PNG into figures/; returns the names of the files."""
    folder = results.folder / "figures"
    names: list[str] = []
    todo = [*drawings(results), *share_drawings(driving)]
    with progress("Figures", quiet=quiet) as tick, style():
        for done, (name, make) in enumerate(todo, start=1):
            names += [
                str(path.relative_to(results.folder))
                for path in save(make(), folder / file_stem(name, results))
            ]
            if tick:
                tick(done / len(todo))
    return [*particle_pictures(folder, results), *names, *mesh_picture(results)]


def particle_pictures(folder: Path, results: Results) -> list[str]:
    """Figures of the microstructure stage: 03-04_two_point … 13_pbox, radius_map."""
    if "microstructure" not in results.case.stages:
        return []
    found = [path for path in sorted(folder.iterdir()) if re.match(r"\d|radi", path.name)]
    return [str(path.relative_to(results.folder)) for path in found]


def mesh_picture(results: Results) -> list[str]:
    """Fig. 15 and the stress on slices, where the modulus was computed on prisms."""
    if results.modulus is None or results.case.modulus.method != "prism":
        return []
    from alphacut.figures.mesh import draw_mesh

    pictures = {f"figures/{file_stem('fig15-prism-mesh', results)}.png": "mesh"}
    if results.case.mesh.interface == "conforming":
        pictures["figures/stress-on-slices.png"] = "stress"
    return [
        name
        for name, kind in pictures.items()
        if draw_mesh(results.case, results.folder / name, kind)
    ]
