"""Microstructure of a case: from particles to the fuzzy radius map."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.case.load import section_from
from alphacut.case.sections.material import Radius
from alphacut.io.files import as_json, write_text
from alphacut.io.netcdf import write_dataset
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick

if TYPE_CHECKING:
    from alphacut.stochastic.microstructure import Microstructure, Study
    from alphacut.stochastic.particles.radius_laws import RadiusLaw
    from alphacut.stochastic.sections import Measured, Simulated


def source(case: Case) -> Simulated | Measured:
    """Source of the discs or spheres."""
    from alphacut.stochastic.particles.circles_csv import CircleFile
    from alphacut.stochastic.particles.image import SectionImage
    from alphacut.stochastic.particles.packing import Packing
    from alphacut.stochastic.particles.particles import SPHERES
    from alphacut.stochastic.sections import Measured, Simulated

    of = case.microstructure
    if (spheres := of.spheres) is not None:
        law = radii_of(case, spheres.file, spheres.smallest_radius, spheres.largest_radius)
        packing = Packing(spheres.spheres, spheres.volume_fraction, law, shape=SPHERES)
        return Simulated(packing, spheres.packings)
    if (discs := of.packing) is not None:
        law = radii_of(case, discs.file, discs.smallest_radius, discs.largest_radius)
        packing = Packing(discs.discs, discs.area_fraction, law, discs.gap, discs.method)
        return Simulated(packing, discs.packings)
    if (circles := of.circles) is not None:
        (width, height), (x, y), path = circles.size, circles.origin, case.beside(circles.file)
        own = {"periodic": circles.periodic, "overlap": circles.overlap}
        return Measured(CircleFile(path, (width, height), (x, y), **own))
    image = of.image
    assert image is not None  # one of the four is there, or the case is refused
    crop = None if image.crop is None else tuple(int(value) for value in image.crop)
    return Measured(SectionImage(case.beside(image.file), image.pixel, image.particles, crop))


def radii_of(
    case: Case, file: str | None, smallest: float | None, largest: float | None
) -> RadiusLaw:
    """The law of the radii of a packing: log-normal, or that of a list."""
    from alphacut.stochastic.particles.radius_laws import LogNormalRadii, MeasuredRadii

    if file is not None:
        return MeasuredRadii.read(case.beside(file))
    return LogNormalRadii(smallest or 0.0, largest or 0.0)


def study_of(case: Case) -> Study:
    """Study of the case's particles."""
    from alphacut.stochastic.microstructure import Study

    of = case.microstructure
    return Study(
        source(case),
        (of.limits[0], of.limits[1]) if of.limits else None,
        of.share,
        of.seed,
        of.confidence,
        of.bootstrap,
        band=of.band,
        sampling=of.sampling,
    )


def compute(case: Case, *, workers: int = 1, progress: Tick | None = None) -> Microstructure:
    """From particles to the fuzzy radius map; the same for any number of workers.

    Args:
        case: The case.
        workers: Processes that share the packings.
        progress: Receives the share done.

    Raises:
        BadInput: Measured data have no meaning, or particles find no place.
    """
    from alphacut.fuzzy.campaign.workers import pool
    from alphacut.fuzzy.refused import FailedError, RefusedError
    from alphacut.stochastic.microstructure import study

    try:
        with pool(workers) as executor:
            return study(study_of(case), executor=executor, progress=progress)
    except (RefusedError, FailedError) as error:
        raise BadInput.of("microstructure", str(error), file=str(case.path)) from None


def with_radius(case: Case, fragment: str) -> Case:
    """The case with the section [radius] of a fragment."""
    radius = section_from(Radius, tomllib.loads(fragment)["radius"])
    return replace(case, sections=replace(case.sections, radius=radius))


PICTURES = {
    *("03-04_two_point", "05-08_neighbours", "06-07_neighbour_statistics", "09_correlation"),
    *("10_cells", "11_radii", "12_areas", "13_pbox", "radius_map", "image_circles"),
}


def pictures(folder: Path) -> list[Path]:
    """Figures of this stage in a folder of results."""
    files = sorted(folder.glob("figures/*.*"))
    return [path for path in files if path.stem in PICTURES and path.suffix in (".png", ".svg")]


def write(result: Microstructure, folder: Path, facts: Mapping[str, str | int]) -> list[str]:
    """Write numbers, figures, fragment and dataset; returns the paths from `folder`."""
    from alphacut.stochastic.figures.all import draw
    from alphacut.stochastic.microstructure_summary import fragment, summary, to_dataset

    (folder / "microstructure.nc").unlink(missing_ok=True)  # comes last: it vouches for the others
    write_text(folder / "microstructure.json", as_json(summary(result), indent=2))
    drawn = draw(result, folder / "figures")
    write_text(folder / "radius.toml", fragment(result))
    names = ["microstructure.json", "microstructure.nc", "radius.toml"]
    if "image_circles" in drawn:
        discs = result.sections[0].particles
        rows = np.column_stack([discs.centres, discs.radii])
        lines = "".join(f"{x:.7g},{y:.7g},{r:.7g}\n" for x, y, r in rows)
        write_text(folder / "circles.csv", "x [m],y [m],r [m]\n" + lines)
        names.append("circles.csv")
    write_dataset(to_dataset(result), folder / "microstructure.nc", facts)
    files = [*(folder / name for name in names), *(path for of in drawn.values() for path in of)]
    return [str(path.relative_to(folder)) for path in files]
