"""Stage microstructure: from particles to the fuzzy radius map."""

from __future__ import annotations

import numpy as np

from alphacut.case.microstructure import MicrostructureSection
from alphacut.fuzzy.campaign.workers import pool
from alphacut.io.files import Document, write_text
from alphacut.io.provenance import file_digest
from alphacut.stages.store import Stage, StageContext, StageResult
from alphacut.stochastic.microstructure import fragment, study, summary, to_dataset


def stage(section: MicrostructureSection, spheres: bool, figures: bool = True) -> Stage[Document]:
    """The stage that computes the fuzzy radius map of particles, whatever the number of workers.

    If there is a folder, it gets radius.toml, a section of a case, figures if wanted, and
    circles.csv of an image.
    """
    file = section.sources[0].file
    inputs = [section, spheres, file and file_digest(file)]

    def compute(context: StageContext) -> StageResult[Document]:
        with pool(context.workers) as executor:
            result = study(section.study(spheres=spheres), executor=executor, progress=context.tick)
        numbers, folder = summary(result), context.folder
        if folder is not None:
            import pandas as pd

            from alphacut.stochastic.figures.all import draw

            drawn = draw(result, folder / "figures") if figures else {}
            write_text(folder / "radius.toml", fragment(numbers))
            if "image_circles" in drawn:
                discs = result.sections[0].particles
                rows = np.column_stack([discs.centres, discs.radii])
                circles = pd.DataFrame(rows, columns=["x [m]", "y [m]", "r [m]"])
                circles.to_csv(folder / "circles.csv", index=False)
        return StageResult(numbers, to_dataset(result))

    return Stage("microstructure", inputs, ("stochastic",), Document, compute)
