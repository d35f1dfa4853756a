"""Stage microstructure: from particles to the fuzzy radius map."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.base.kept_files import file_digest, write_text
from alphacut.base.progress_bar import subprogress
from alphacut.case.microstructure import MicrostructureSection
from alphacut.io.files import Document
from alphacut.stages.store import Stage, StageContext, StageResult
from alphacut.stochastic import FittedRadiusMap, fit_radius_map

Draw = Callable[[FittedRadiusMap, Path, MicrostructureSection], None]
"""Draws the figures of a radius map into a folder."""


def stage(
    section: MicrostructureSection, *, spheres: bool, draw: Draw | None = None
) -> Stage[Document]:
    """Return the stage that computes the fuzzy radius map of particles.

    If results are kept, its folder gets radius.toml, the section [radius] of a case; circles.csv
    with the circles of an image; and what `draw` writes.

    Args:
        section: The particles, and the seed of all random numbers.
        spheres: Whether the particles are spheres; they are discs otherwise.
        draw: Function that draws figures of the fitted map into a folder; None for no figures.

    Raises:
        OSError: The file of particles, if there is one, cannot be read.
    """
    # The section holds the name of a file only: its digest makes the stage new if the content is.
    file = section.sources[0].file
    inputs = [section, spheres, file and file_digest(file)]

    def compute(context: StageContext) -> StageResult[Document]:
        """Compute the radius map, and write its files if the context has a folder."""
        packed = 0.35  # fraction of the time that packing takes, measured on cases/concrete.toml
        particles = section.particles(
            spheres=spheres,
            workers=context.workers,
            progress=subprogress(context.tick, 0.0, packed),
        )
        fitted = fit_radius_map(
            particles,
            limits=section.limits,
            seed=section.seed,
            workers=context.workers,
            progress=subprogress(context.tick, packed, 1.0),
        )
        numbers = fitted.numbers()
        folder = context.folder
        if folder is not None:
            write_text(folder / "radius.toml", fragment(numbers))
            if draw is not None:
                draw(fitted, folder / "figures", section)
            if section.image is not None:
                # 17 digits give each number back exactly: the file can take the image's place.
                rows = np.column_stack([particles[0].centres, particles[0].radii])
                columns = {"header": "x [m],y [m],r [m]", "delimiter": ",", "comments": ""}
                np.savetxt(folder / "circles.csv", rows, fmt="%.17g", **columns)
        return StageResult(numbers, fitted.to_dataset())

    return Stage("microstructure", inputs, ("stochastic",), Document, compute)


def fragment(numbers: Mapping[str, Any]) -> str:
    """Return the section [radius] of a case as TOML text, with the fractions as comments.

    Args:
        numbers: Results of a fitted radius map. `radius` has a1 … a4, each a number or the three
            corners of a triangular one. Fractions are `mean_area_fraction_of_map`, of the map;
            `area_fraction`, of the particles; and `fraction_of_case`, or None. Of spheres the first
            two have "volume" in place of "area". `cells` is the number of fitted cells, and
            `share_kept` the fraction of their area or volume in cells within the limits.

    Returns:
        Lines that end with a newline: the head [radius] with a comment, then "NAME = VALUE" for
        each parameter with ten digits.
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
