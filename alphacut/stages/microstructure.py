"""Stage microstructure: from particles to the fuzzy radius map."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.base.kept_files import file_digest, write_text
from alphacut.base.progress_bar import subprogress
from alphacut.case.microstructure import MicrostructureSection
from alphacut.io.files import Document
from alphacut.stages.store import Stage, StageContext, StageResult
from alphacut.stochastic import FittedRadiusMap, fit_radius_map

PACKED = 0.35
"""Fraction of the work that packing takes, for the progress; measured on cases/concrete.toml."""


Draw = Callable[[FittedRadiusMap, Path, MicrostructureSection], None]
"""Draws the figures of a radius map into a folder."""


def stage(
    section: MicrostructureSection, *, spheres: bool, draw: Draw | None = None
) -> Stage[Document]:
    """Return the stage that computes the fuzzy radius map of particles.

    If there is a folder, it gets radius.toml, a section of a case, figures if there is what draws
    them, and circles.csv of an image.
    """
    file = section.sources[0].file
    inputs = [section, spheres, file and file_digest(file)]
    compute = partial(_computed, section, spheres, draw)
    return Stage("microstructure", inputs, ("stochastic",), Document, compute)


def _computed(
    section: MicrostructureSection, spheres: bool, draw: Draw | None, context: StageContext
) -> StageResult[Document]:
    particles = section.particles(
        spheres=spheres,
        workers=context.workers,
        progress=subprogress(context.tick, 0.0, PACKED),
    )
    fitted = fit_radius_map(
        particles,
        limits=section.limits,
        seed=section.seed,
        workers=context.workers,
        progress=subprogress(context.tick, PACKED, 1.0),
    )
    numbers, folder = fitted.numbers(), context.folder
    if folder is not None:
        write_text(folder / "radius.toml", fragment(numbers))
        if draw is not None:
            draw(fitted, folder / "figures", section)
        if section.image is not None:
            rows = np.column_stack([particles[0].centres, particles[0].radii])
            columns = {"header": "x [m],y [m],r [m]", "delimiter": ",", "comments": ""}
            np.savetxt(folder / "circles.csv", rows, fmt="%.17g", **columns)
    return StageResult(numbers, fitted.to_dataset())


def fragment(numbers: Mapping[str, Any]) -> str:
    """Return the section [radius] of a case as TOML text, with fractions as comments.

    Args:
        numbers: Of `FittedRadiusMap.numbers`.
    """
    measure = "volume" if "mean_volume_fraction_of_map" in numbers else "area"
    map_fraction = numbers[f"mean_{measure}_fraction_of_map"]
    words = f"; of the particles: {numbers[f'{measure}_fraction']:.4f}"
    if numbers["fraction_of_case"] is not None:
        words += f"; of the case: {numbers['fraction_of_case']:g}"
    lines = [
        f"[radius]  # from {numbers['cells']} cells; the limits keep"
        f" {numbers['share_kept']:.4%} of their {measure}",
        f"# {measure} fraction of this map at its nominal values: {map_fraction:.4f}{words}",
    ]
    for name, value in numbers["radius"].items():
        if isinstance(value, list):
            corners = ", ".join(f"{corner:.10g}" for corner in value)
            lines.append(f"{name} = [{corners}]")
        else:
            lines.append(f"{name} = {value:.10g}")
    return "\n".join(lines) + "\n"
