"""Stage microstructure: from particles to the fuzzy radius map."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from alphacut.case.material import RadiusMapSection
from alphacut.case.particles import MicrostructureSection
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.columns import columns_text
from alphacut.io.files import Document, write_text
from alphacut.io.provenance import file_digest
from alphacut.stages.store import Stage, StageResult, Work
from alphacut.stochastic.microstructure import Microstructure, study
from alphacut.stochastic.microstructure_summary import fragment, summary, to_dataset


def stage(section: MicrostructureSection, spheres: bool, figures: bool = True) -> Stage:
    """The stage of some particles; in a folder it writes radius.toml and figures as well."""
    file = section.sources[0].file
    inputs = [section, spheres, file and file_digest(file)]
    compute = partial(compute_map, section, spheres, figures)
    return Stage("microstructure", inputs, ("stochastic",), compute)


def compute_map(
    section: MicrostructureSection, spheres: bool, figures: bool, work: Work
) -> StageResult:
    """The fuzzy radius map with its data; the same for any number of workers.

    Raises:
        RefusedError: Measured data have no meaning.
        FailedError: The packing is too dense.
    """
    with pool(work.workers) as executor:
        map_of = study(section.study(spheres=spheres), executor=executor, progress=work.tick)
    numbers = summary(map_of)
    if work.folder is not None:
        write(map_of, numbers, work.folder, figures=figures)
    return StageResult(numbers, to_dataset(map_of))


def radius_of(result: StageResult) -> RadiusMapSection:
    """The section [radius] that the particles give."""
    return RadiusMapSection.model_validate(result.document["radius"])


def write(map_of: Microstructure, numbers: Document, folder: Path, *, figures: bool) -> None:
    """Writes the fragment of a case, the circles of an image, and figures."""
    from alphacut.stochastic.figures.all import draw

    drawn = draw(map_of, folder / "figures") if figures else {}
    write_text(folder / "radius.toml", fragment(numbers))
    if "image_circles" in drawn:
        write_text(folder / "circles.csv", _circles(map_of))


def _circles(map_of: Microstructure) -> str:
    """The circles seen in an image as a CSV file, lengths in m."""
    discs = map_of.sections[0].particles
    x, y = np.transpose(discs.centres)
    return columns_text({"x [m]": x, "y [m]": y, "r [m]": discs.radii})
