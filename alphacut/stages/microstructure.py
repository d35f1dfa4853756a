"""Stage microstructure: from particles to the fuzzy radius map."""

from __future__ import annotations

from functools import partial

import numpy as np

from alphacut.case.microstructure import MicrostructureSection
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.arrays import columns_text
from alphacut.io.files import Document, write_text
from alphacut.io.provenance import file_digest
from alphacut.stages.store import Stage, StageContext, StageResult
from alphacut.stochastic.microstructure import fragment, study, summary, to_dataset


def stage(section: MicrostructureSection, spheres: bool, figures: bool = True) -> Stage[Document]:
    """The stage that computes the radius map of particles, and writes radius.toml and figures."""
    file = section.sources[0].file
    inputs = [section, spheres, file and file_digest(file)]
    compute = partial(compute_map, section, spheres, figures)
    return Stage("microstructure", inputs, ("stochastic",), Document, compute)


def compute_map(
    section: MicrostructureSection, spheres: bool, figures: bool, context: StageContext
) -> StageResult[Document]:
    """Computes the fuzzy radius map of particles, whatever the number of workers.

    If there is a folder, it gets radius.toml, a section of a case, figures if wanted, and
    circles.csv of an image.
    """
    with pool(context.workers) as executor:
        result = study(section.study(spheres=spheres), executor=executor, progress=context.tick)
    numbers, folder = summary(result), context.folder
    if folder is not None:
        from alphacut.stochastic.figures.all import draw

        drawn = draw(result, folder / "figures") if figures else {}
        write_text(folder / "radius.toml", fragment(numbers))
        if "image_circles" in drawn:
            discs = result.sections[0].particles
            x, y = np.transpose(discs.centres)
            circles = columns_text({"x [m]": x, "y [m]": y, "r [m]": discs.radii})
            write_text(folder / "circles.csv", circles)
    return StageResult(numbers, to_dataset(result))
