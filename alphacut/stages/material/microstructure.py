"""Microstructure of a case: from particles to the fuzzy radius map."""

from __future__ import annotations

import re
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.case.case import Case
from alphacut.case.load import section_from
from alphacut.case.sections.material import Radius
from alphacut.case.sections.particles import PackedSpheres
from alphacut.case.sections.particles import Packing as PackingSection
from alphacut.io.files import as_json, say, write_text
from alphacut.io.netcdf import write_dataset
from alphacut.io.problem import BadInput
from alphacut.io.progress import Tick
from alphacut.io.units import engineering, span
from alphacut.stages.material.micrograph import crop_of, fractions

if TYPE_CHECKING:
    from alphacut.stochastic.microstructure import Microstructure, Study
    from alphacut.stochastic.particles.radius_laws import RadiusLaw
    from alphacut.stochastic.sections import Measured, Simulated
    from alphacut.stochastic.spheres.microstructure import SphereMicrostructure
    from alphacut.stochastic.spheres.packing import SpherePackings
    from alphacut.stochastic.spheres.wicksell import RadiiPBox
    from alphacut.stochastic.theta.truncated_normal import Array


LEAST_SLOPE = 1e-4  # at and below it a slope is that of a map that barely rises
FAR = 300  # times the median, or below it: a size perhaps of another unit
APART, ALONE = 1.5, 0.1  # ratio of neighbouring sizes, and share of all between, that is told
CRYSTALLISE = 0.8  # area fraction from which equal discs were measured to be crystals in part


def source(case: Case) -> Simulated | Measured | SpherePackings:
    """Source of the discs or spheres."""
    from alphacut.stochastic.particles.circles_csv import CircleFile
    from alphacut.stochastic.particles.image import SectionImage
    from alphacut.stochastic.particles.packing import Packing
    from alphacut.stochastic.sections import Measured, Simulated

    given = case.microstructure
    if given.spheres:
        return packed_spheres(case, given.spheres)
    if wanted := given.packing:
        law = radii_of(case, "packing", wanted)
        packing = Packing(
            wanted.discs, wanted.area_fraction, law, gap=wanted.gap, method=wanted.method
        )
        return Simulated(packing, wanted.packings)
    if circles := given.circles:
        (width, height), (x, y), path = circles.size, circles.origin, case.beside(circles.file)
        own = {key: getattr(circles, key) for key in ("unit", "overlap", "periodic", "drop")}
        return Measured(CircleFile(path, (width, height), (x, y), **own))
    photograph = given.image
    assert photograph is not None  # one of the three is there, or the case is refused
    file, pixel = case.beside(photograph.file), photograph.pixel
    return Measured(
        SectionImage(file, pixel, photograph.particles, drop=photograph.drop, crop=crop_of(case))
    )


def packed_spheres(case: Case, given: PackedSpheres) -> SpherePackings:
    """Packings of spheres: of a law, of measured radii, or of what the circles of a section leave.

    Raises:
        BadInput: A file cannot be read, no spheres have these circles, or they need too many.
    """
    from alphacut.stochastic.spheres.packing import SpherePacking, SpherePackings

    unfold = given.circles is not None
    law, box = unfolded_radii(case, given) if unfold else (radii_of(case, "spheres", given), None)
    packing = SpherePacking(given.spheres, given.volume_fraction, law)
    try:
        return SpherePackings(packing, given.packings, box)
    except ValueError as error:
        raise case.refuse("microstructure.spheres.spheres", str(error)) from None


def unfolded_radii(case: Case, given: PackedSpheres) -> tuple[RadiusLaw, RadiiPBox]:
    """Law of the spheres behind the circles of a section, and the bounds of it that they leave.

    Where no key says from which radius on circles are seen, it is the smallest circle's, and that
    one tells no more.

    Raises:
        BadInput: The file cannot be read, or no spheres have these circles.
    """
    from alphacut.stochastic.errors import RefusedError
    from alphacut.stochastic.particles.radius_laws import MeasuredRadii
    from alphacut.stochastic.spheres.wicksell import middle_law, radii_pbox

    small, large, key = given.smallest_radius, given.largest_radius, "microstructure.spheres"
    assert given.circles is not None
    assert small is not None  # with circles both are there, or the case is refused
    assert large is not None
    try:
        radii = np.array(MeasuredRadii.read(case.beside(given.circles)).values)
        visible = float(radii[0]) if given.visible is None else given.visible
        if visible >= small:
            told = f"smallest_radius = {engineering(small, 'm')} must exceed the smallest circle"
            raise ValueError(f"{told} seen, {engineering(visible, 'm')}: raise it or set visible")
        seen = radii[radii > visible]
        box = radii_pbox(seen, visible=visible, smallest=small, largest=large, level=given.level)
        return middle_law(seen, box, visible=visible), box
    except (ValueError, RefusedError) as error:
        raise case.refuse(f"{key}.circles", str(error)) from None


def radii_of(case: Case, of: str, packing: PackingSection | PackedSpheres) -> RadiusLaw:
    """The law of the radii of a packing: log-normal, or that of a list or a sieve curve."""
    from alphacut.stochastic.particles.radius_laws import LogNormalRadii
    from alphacut.stochastic.particles.sieve import read_radii

    if packing.file is None:
        smallest, largest = packing.smallest_radius, packing.largest_radius
        assert smallest is not None  # without a file both are there, or the case is refused
        assert largest is not None
        return LogNormalRadii(smallest, largest)
    try:
        return read_radii(case.beside(packing.file), 2 if of == "packing" else 3)
    except ValueError as error:
        raise case.refuse(f"microstructure.{of}.file", str(error)) from None


def study_of(case: Case) -> Study:
    """Study that the case asks for.

    Raises:
        BadInput: A value lies outside its range.
    """
    from alphacut.stochastic.microstructure import Study

    given = case.microstructure
    limits = given.limits
    try:
        return Study(
            source(case),
            (limits[0], limits[1]) if limits else None,
            given.share,
            given.seed,
            given.confidence,
            given.bootstrap,
            band=given.band,
            sampling=given.sampling,
        )
    except ValueError as error:
        raise BadInput.of("microstructure", str(error), file=str(case.path)) from None


def require_readable(case: Case) -> Study:
    """Study of a case whose files of circles and radii can be read, and whose programs are there.

    Raises:
        BadInput: A file cannot be read, or holds what makes no sense.
    """
    from alphacut.stochastic.errors import RefusedError
    from alphacut.stochastic.particles.image import SectionImage
    from alphacut.stochastic.sections import Measured
    from alphacut.stochastic.spheres.packing import SpherePackings
    from alphacut.stochastic.spheres.power_cells import voro

    wanted = study_of(case)
    if isinstance(wanted.source, SpherePackings):
        try:
            voro()
        except RefusedError as error:
            raise case.refuse("microstructure.spheres", str(error)) from None
    elif isinstance(wanted.source, Measured):
        file = wanted.source.file
        try:
            file.material() if isinstance(file, SectionImage) else file.read()
        except ValueError as error:
            kind = "image" if isinstance(file, SectionImage) else "circles"
            raise case.refuse(f"microstructure.{kind}.file", str(error)) from None
    return wanted


def plan(case: Case) -> Iterator[str]:
    """Lines on the sizes that were read, and on what the stage will do with spheres."""
    from alphacut.stochastic.particles.image import SectionImage
    from alphacut.stochastic.particles.radius_laws import MeasuredRadii
    from alphacut.stochastic.sections import Measured
    from alphacut.stochastic.spheres.packing import SpherePackings

    if "microstructure" not in case.stages:
        return
    wanted, given = source(case), case.microstructure
    if isinstance(wanted, Measured):
        if given.circles:
            sizes = 2 * wanted.file.read().discs.radii
            yield f"microstructure.circles.file: {len(sizes)} circles, diameters {span(sizes, 'm')}"
        elif isinstance(wanted.file, SectionImage):
            sides = wanted.file.pixel * np.array(wanted.file.material().shape)
            told = " × ".join(engineering(float(side), "m") for side in sides[::-1])
            yield f"microstructure.image: the image shows a section of {told}; check pixel"
        return
    law, packed = wanted.packing.radii, given.packing or given.spheres
    if packed is not None and packed.file:
        read = law.values if isinstance(law, MeasuredRadii) else (law.smallest, law.largest)
        yield f"microstructure: {law.label}, diameters {span(2 * np.array(read), 'm')}"
    if not isinstance(wanted, SpherePackings):
        return
    law = (packing := wanted.laws["the law"]).radii
    yield (
        f"microstructure: {wanted.packings} packings of {packing.spheres} spheres, volume fraction"
        f" {packing.volume_fraction:g}, radii {engineering(law.smallest, 'm')} …"
        f" {engineering(law.largest, 'm')} ({law.label}); r_n = r/a of their Laguerre cells,"
        " weighted by volume"
    )
    if wanted.section is not None:
        yield (
            f"microstructure: the map also holds {len(wanted.laws) - 1} other laws that the"
            f" circles leave possible; {wanted.section.unknown}"
        )


def compute(
    case: Case, *, workers: int = 1, progress: Tick | None = None, quiet: bool = False
) -> Microstructure | SphereMicrostructure:
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
    from alphacut.stochastic.spheres.microstructure import sphere_study

    wanted = study_of(case)
    work = sphere_study if case.microstructure.spheres else study
    with pool(workers) as executor:
        try:
            found = work(wanted, executor=executor, progress=progress)
        except ValueError as error:
            raise BadInput.of("microstructure", str(error), file=str(case.path)) from None
    if not quiet:
        for remark in (*findings(case, found), *crisp_slopes(fragment(found))):
            say(remark)
    return found


def findings(case: Case, found: Microstructure | SphereMicrostructure) -> Iterator[str]:
    """Lines on what was found, without what `dense_remark` has told before, and on given sizes."""
    before = "\n".join(dense_remark(case))
    yield from (line for line in left_out(found) if line.removeprefix("warning: ") not in before)
    yield from given_sizes(case)


LEFT_OUT = 0.1  # share of the spheres' volume without a cubic cell, above which it is warned of


def left_out(found: Microstructure | SphereMicrostructure) -> Iterator[str]:
    """Lines on what is not known of spheres, on what was not taken as measured, on the image."""
    from alphacut.stochastic.microstructure import TIGHTEST
    from alphacut.stochastic.spheres.microstructure import SphereMicrostructure

    if isinstance(found, SphereMicrostructure):
        yield (
            f"{'warning: ' if found.share_beyond > LEFT_OUT else ''}the map is of"
            f" {1 - found.share_beyond:.0%} of the volume; packed at {found.packed[0].fraction:.3f}"
            f" so that the map has {found.fraction_of_map:.3f}"
        )
        yield from (f"warning: {remark}" for remark in found.remarks)
        return
    reasons = [reason for section in found.sections for reason in section.read.rejected.values()]
    if reasons:
        told = "; ".join(kinds(reasons))
        taken = sum(len(section.discs) for section in found.sections)
        yield f"warning: {len(reasons)} of {taken + len(reasons)} particles were left out: {told}"
    if found.share_capped > 5e-5:  # less is told as 0.00 %
        yield (
            f"{found.share_capped:.2%} of the area lies in cells tighter than r_n = {TIGHTEST:g},"
            " as between particles that touch, and is taken as that tight; no square cell is"
            " tighter"
        )
    if found.is_crystalline:
        yield f"warning: {crystalline(found.hexagonal_order)}"
    if found.sections[0].read.phase_fraction is not None:
        yield from fractions(found, found.sections[0].read.phase_fraction)


def crystalline(order: float) -> str:
    """What a bond order means."""
    return (
        f"the particles lie in rows as in a crystal: |⟨e^{{6iφ}}⟩| of the bonds between neighbours"
        f" is {order:.3f}, 1 in a triangular lattice and near 0 at random; take a smaller area"
        " fraction or unequal particles if the material has no such order"
    )


def dense_remark(case: Case) -> Iterator[str]:
    """Remarks on sizes far off, on more spheres than asked for, on particles packed too densely."""
    from alphacut.stochastic.particles.radius_laws import MeasuredRadii

    packing, spheres = case.microstructure.packing, case.microstructure.spheres
    if (packed := packing or spheres) is None:
        return
    of = "packing" if packing else "spheres"
    law = radii_of(case, of, packed)
    sizes = np.array(law.values if isinstance(law, MeasuredRadii) else [law.largest])
    for ratio in sizes[[0, -1]] / np.median(sizes):
        if not 1 / FAR <= ratio <= FAR:
            yield f"microstructure.{of}.file: a size is {ratio:.3g} times the median: check units"
    yield from wide_gap(sizes, of)
    if spheres is not None:
        for remark in packed_spheres(case, spheres).remarks:
            yield f"microstructure.spheres.spheres: {remark}"
        # fitted to packings of log-normal radii over factors of 1.5, 3.1 and 10
        limit = 0.415 - 0.075 * np.log(min(law.largest / law.smallest, 10))
        if spheres.volume_fraction > limit:
            told = f"above about {limit:.2f} with these radii a quarter or more of the volume may"
            yield (
                f"microstructure.spheres.volume_fraction: {told} have no cubic cell; run then marks"
                " E not to be published; Hashin–Shtrikman bounds or benchmarks.rve.many_spheres"
                " serve"
            )
    elif packing and packing.area_fraction >= CRYSTALLISE and law.smallest == law.largest:
        yield (
            f"microstructure.packing: equal discs on {packing.area_fraction:g} of the area"
            " crystallise in part; the run measures how far (hexagonal_order) and says so"
        )


def wide_gap(sizes: Array, of: str) -> Iterator[str]:
    """A remark where much of the particles has sizes of which a list, (n,) in m, has none."""
    low, high, power = sizes[:-1], sizes[1:], 2 if of == "packing" else 3
    held = sum((low**k * high ** (power - k) for k in range(power + 1)), np.zeros(len(low)))
    empty = np.where(high > APART * low, held, 0.0)  # means of r^power, times power + 1
    share = empty.max(initial=0.0) / max(held.sum(), 1e-300)
    if share > ALONE:
        gap = int(np.argmax(empty))
        part = "area" if of == "packing" else "volume"
        yield (
            f"microstructure.{of}.file: {share:.0%} of the particles' {part} has diameters"
            f" {span(2 * sizes[gap : gap + 2], 'm')}, of which the list has none: between its"
            " sizes the law is linear; list more particles, or leave out the lone ones"
        )


def kinds(reasons: list[str]) -> Iterator[str]:
    """The four commonest kinds of reasons, which differ by numbers alone, each with its first."""
    kind = [re.sub(r"-?\d[\d.e+-]*", "…", reason) for reason in reasons]
    for name, count in Counter(kind).most_common(4):
        same = {reason for reason, its in zip(reasons, kind, strict=True) if its == name}
        first = reasons[kind.index(name)]
        words = "such as one that" if len(same) > 1 else "since each"
        yield f"{count} {words} {first}"


def given_sizes(case: Case) -> Iterator[str]:
    """A line where sizes come from a list: their chance is not in the slopes."""
    from alphacut.stochastic.particles.radius_laws import MeasuredRadii

    given = case.microstructure
    packed = given.packing or (given.spheres if given.spheres and given.spheres.file else None)
    if packed and packed.file:
        law = radii_of(case, "packing" if given.packing else "spheres", packed)
        few = "the error of the sieve curve"
        if isinstance(law, MeasuredRadii):
            few = f"that only {len(law.values)} sizes were measured"
        adds = ", and microstructure.sampling = true adds the chance of packings alone"
        yield (
            f"a2 and a4 take the given sizes as exact: {few} is not in"
            f" them{'' if given.sampling else adds}; to see it, run parts of the list and widen a2"
            " and a4 in radius.toml to hold them all"
        )


def crisp_slopes(fragment: str) -> Iterator[str]:
    """Line for each slope that came out crisp, its band holding one map."""
    radius = tomllib.loads(fragment)["radius"]
    for name in ("a2", "a4"):
        ends = radius[name] if isinstance(radius[name], list) else [radius[name]]
        if len(set(ends)) == 1 and ends[0] <= LEAST_SLOPE:
            yield (
                f"{name} is crisp: the fit wants the least slope of a rising map there, as where"
                " radii pile up at that end, and no key widens it"
            )
        elif len(set(ends)) == 1:
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
    radius = section_from(Radius, tomllib.loads(fragment)["radius"])
    return replace(case, sections=replace(case.sections, radius=radius))


def circles_of(found: Microstructure) -> str:
    """The circles seen in an image as a CSV file, lengths in m."""
    discs = found.sections[0].discs
    rows = np.column_stack([discs.centres, discs.radii])
    return "x [m],y [m],r [m]\n" + "".join(f"{x:.7g},{y:.7g},{r:.7g}\n" for x, y, r in rows)


PICTURES = {
    *("03-04_two_point", "05-08_neighbours", "06-07_neighbour_statistics", "09_correlation"),
    *("10_cells", "11_radii", "12_areas", "13_pbox"),
    *("radius_map", "radii_bounds", "image_circles"),
}


def pictures(folder: Path) -> list[Path]:
    """Figures of this stage in a folder of results."""
    found = sorted(folder.glob("figures/*.*"))
    return [path for path in found if path.stem in PICTURES and path.suffix in (".png", ".svg")]


def write(
    found: Microstructure | SphereMicrostructure,
    folder: Path,
    said: Mapping[str, str | int],
    *,
    figures: bool = True,
) -> list[str]:
    """Write numbers, figures, fragment and dataset; returns the paths from `folder`."""
    from alphacut.stochastic.figures.all import draw
    from alphacut.stochastic.microstructure import Microstructure
    from alphacut.stochastic.microstructure_summary import fragment, summary, to_dataset

    told = [remark.removeprefix("warning: ") for remark in left_out(found)]
    numbers = {**summary(found), "remarks": told}
    (folder / "microstructure.nc").unlink(missing_ok=True)  # comes last: it vouches for the others
    write_text(folder / "microstructure.json", as_json(numbers, indent=2))
    drawn = draw(found, folder / "figures") if figures else {}
    write_text(folder / "radius.toml", fragment(found))
    names = ["microstructure.json", "microstructure.nc", "radius.toml"]
    if isinstance(found, Microstructure) and found.sections[0].read.phase_fraction is not None:
        write_text(folder / "circles.csv", circles_of(found))
        names.append("circles.csv")
    write_dataset(to_dataset(found), folder / "microstructure.nc", said)
    files = [*(folder / name for name in names), *(path for of in drawn.values() for path in of)]
    return [str(path.relative_to(folder)) for path in files]
