"""Microstructure of a case: from particles to the fuzzy radius map."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from alphacut.case.case import Case
from alphacut.case.checks import beside
from alphacut.case.schema import RADIUS
from alphacut.case.values import read
from alphacut.io.files import as_json, say, whole_file, write_text
from alphacut.io.problem import BadInput, Problem
from alphacut.io.progress import Tick

if TYPE_CHECKING:
    from alphacut.stochastic.microstructure import Microstructure, Study
    from alphacut.stochastic.particles.radius_law import RadiusLaw
    from alphacut.stochastic.sections import Measured, Simulated

SOURCES = ("packing", "circles", "image")


def source(case: Case) -> Simulated | Measured:
    """Source of the discs."""
    from alphacut.stochastic.particles.circles_csv import CircleFile
    from alphacut.stochastic.particles.image import SectionImage
    from alphacut.stochastic.particles.packing import Packing
    from alphacut.stochastic.sections import Measured, Simulated

    key = "microstructure"
    if case.has(f"{key}.packing.discs"):
        key += ".packing"
        fraction, gap, method = (
            case.number(f"{key}.area_fraction"),
            case.number(f"{key}.gap"),
            case.text(f"{key}.method"),
        )
        packing = Packing(
            case.integer(f"{key}.discs"), fraction, radii_of(case, key), gap=gap, method=method
        )
        return Simulated(packing, case.integer(f"{key}.packings"))
    if case.has(f"{key}.circles.file"):
        key += ".circles"
        width, height = case.numbers(f"{key}.size")
        x, y = case.numbers(f"{key}.origin")
        words = {
            "periodic": case.values[f"{key}.periodic"] is True,
            "drop": case.values[f"{key}.drop"] is True,
        }
        path = beside(case, case.text(f"{key}.file"))
        return Measured(
            CircleFile(
                path,
                (width, height),
                (x, y),
                unit=case.text(f"{key}.unit"),
                overlap=case.number(f"{key}.overlap"),
                **words,
            )
        )
    key += ".image"
    return Measured(
        SectionImage(
            beside(case, case.text(f"{key}.file")),
            case.number(f"{key}.pixel"),
            case.text(f"{key}.particles"),
        )
    )


def radii_of(case: Case, key: str) -> RadiusLaw:
    """The law of the radii of a packing: log-normal between two ends, or that of a list."""
    from alphacut.stochastic.particles.log_normal import LogNormalRadii
    from alphacut.stochastic.particles.measured import MeasuredRadii

    if not case.has(f"{key}.file"):
        return LogNormalRadii(
            case.number(f"{key}.smallest_radius"), case.number(f"{key}.largest_radius")
        )
    try:
        return MeasuredRadii.read(beside(case, case.text(f"{key}.file")))
    except ValueError as error:
        raise case.refuse(f"{key}.file", str(error)) from None


def study_of(case: Case) -> Study:
    """Study that the case asks for.

    Raises:
        BadInput: A value lies outside its range.
    """
    from alphacut.stochastic.microstructure import Study

    limits = case.numbers("microstructure.limits") if case.has("microstructure.limits") else None
    try:
        return Study(
            source(case),
            (limits[0], limits[1]) if limits else None,
            case.number("microstructure.share"),
            case.integer("microstructure.seed"),
            case.number("microstructure.confidence"),
            case.integer("microstructure.bootstrap"),
            band=case.number("microstructure.band") if case.has("microstructure.band") else None,
            sampling=case.values["microstructure.sampling"] is True,
        )
    except ValueError as error:
        raise BadInput(Problem("microstructure", str(error), file=str(case.path))) from None


def require_readable(case: Case) -> None:
    """Read the file of circles that a case names, if it does.

    Raises:
        BadInput: It cannot be read, or holds what makes no sense.
    """
    from alphacut.stochastic.sections import Measured

    given = source(case)
    if not (isinstance(given, Measured) and case.has("microstructure.circles.file")):
        return
    try:
        given.file.read()
    except ValueError as error:
        raise BadInput(
            Problem("microstructure.circles.file", str(error), file=str(case.path))
        ) from None


def compute(
    case: Case, *, workers: int = 1, progress: Tick | None = None, quiet: bool = False
) -> Microstructure:
    """From particles to the fuzzy radius map; the same for any number of workers.

    Args:
        case: The case.
        workers: Processes that share the packings.
        progress: Told the share done.
        quiet: Leave it to the caller to say what was left out and which slope came out crisp.

    Raises:
        BadInput: Measured data make no sense.
    """
    from alphacut.fuzzy.campaign.workers import pool
    from alphacut.stochastic.microstructure import study
    from alphacut.stochastic.microstructure_summary import fragment

    wanted = study_of(case)
    with pool(workers) as executor:
        try:
            found = study(wanted, executor=executor, progress=progress)
        except ValueError as error:
            raise BadInput(Problem("microstructure", str(error), file=str(case.path))) from None
    for remark in () if quiet else (*left_out(found), *crisp_slopes(fragment(found))):
        say(remark)
    return found


def left_out(found: Microstructure) -> Iterator[str]:
    """One line on the measured particles that were not taken, by reason, if there are any."""
    reasons = [reason for section in found.sections for reason in section.rejected.values()]
    if reasons:
        told = ", ".join(
            f"{reason} ({count})"
            for reason, count in Counter(map(without_numbers, reasons)).most_common(4)
        )
        taken = sum(len(section.discs) for section in found.sections)
        yield f"warning: {len(reasons)} of {taken + len(reasons)} particles were left out: {told}"


def without_numbers(reason: str) -> str:
    """The kind of a reason: each of its numbers an ellipsis."""
    return re.sub(r"-?\d[\d.e+-]*", "…", reason)


def crisp_slopes(fragment: str) -> Iterator[str]:
    """Warning for each slope that came out crisp, its band holding one map."""
    radius = tomllib.loads(fragment)["radius"]
    for name in ("a2", "a4"):
        ends = radius[name] if isinstance(radius[name], list) else [radius[name]]
        if len(set(ends)) == 1:
            why = (
                "the band around the particles' distribution is so wide that no width of this slope"
                " is needed to reach into it"
            )
            cure = (
                "microstructure.sampling = true adds the slope's own uncertainty, a smaller"
                " microstructure.band asks for a closer fit"
            )
            yield f"warning: {name} came out crisp: {why}; {cure}"


def with_radius(case: Case, fragment: str) -> Case:
    """The case with the section [radius] of a fragment."""
    table = tomllib.loads(fragment)["radius"]
    return case.with_values(
        radius={name: read(value, RADIUS.keys[name]) for name, value in table.items()}
    )


def read_fragment(path: Path) -> str:
    """The fragment that a run has stored."""
    return path.read_text(encoding="utf-8")


def write(
    found: Microstructure, folder: Path, said: Mapping[str, str | int], *, figures: bool = True
) -> list[str]:
    """Write numbers, figures, fragment and dataset; returns the paths from `folder`."""
    from alphacut.stochastic.figures.all import draw
    from alphacut.stochastic.microstructure_summary import fragment, summary, to_dataset

    write_text(folder / "microstructure.json", as_json(summary(found), indent=2))
    drawn = draw(found, folder / "figures") if figures else {}
    write_text(folder / "radius.toml", fragment(found))
    with whole_file(folder / "microstructure.nc") as partial:
        to_dataset(found).assign_attrs(said).to_netcdf(partial)
    numbers = [
        folder / name for name in ("microstructure.json", "microstructure.nc", "radius.toml")
    ]
    files = [*numbers, *(path for paths in drawn.values() for path in paths)]
    return [str(path.relative_to(folder)) for path in files]
