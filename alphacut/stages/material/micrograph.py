"""Micrograph of a case: the part that is material, and what its circles keep of its particles."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from alphacut.case.case import Case

if TYPE_CHECKING:
    from alphacut.stochastic.microstructure import Microstructure
    from alphacut.stochastic.theta.truncated_normal import Array

TOLD, FALLEN = 0.01, 0.05
"""Relative distances of the fraction that E takes from the image's that are told and warned of."""


def crop_of(case: Case) -> tuple[int, int, int, int] | None:
    """The part of a photograph that is material, in whole pixels.

    Raises:
        BadInput: It is not four whole numbers.
    """
    photograph = case.microstructure.image
    given = None if photograph is None else photograph.crop
    if given is None:
        return None
    if len(given) != 4 or any(value % 1 != 0 for value in given):
        raise case.refuse(
            "microstructure.image.crop",
            "the part needs left, top, right and bottom in whole pixels",
            "for example [0, 0, 1024, 884]",
        )
    left, top, right, bottom = map(int, given)
    return left, top, right, bottom


def compared(fraction: float) -> str:
    """The phase's own area fraction of the image, in words."""
    told = "the particles' share of the whole image"
    return f"area fraction to compare with others: {fraction:.4f}, {told}"


def uncertain(places: Array) -> str:
    """Clusters whose discs are not told for sure, with their places, given in m."""
    at = ", ".join(f"({1e3 * x:.4g}, {1e3 * y:.4g})" for x, y in places)
    ends = ("", "was") if len(places) == 1 else ("s", "were")
    clusters = "cluster{} of touching particles {}".format(*ends)
    return (
        f"warning: {len(places)} {clusters} parted uncertainly, at {at} mm from the lower left"
        " corner: look at image_circles.png"
    )


def fractions(found: Microstructure, fraction: float) -> Iterator[str]:
    """The one area fraction to compare with, what E takes of it, and what is lost between."""
    from alphacut.stochastic.particles.image import MISFIT, STRANGERS, UNEVEN, uneven_in_words

    read = found.sections[0].read
    taken, cells = found.fraction_of_map, len(found.sample.values)
    count = sum(len(section.discs) for section in found.sections)
    yield (
        f"{compared(fraction)}; E takes {taken:.4f}, from the {cells} of {count} circles whose"
        f" cells the image's edge cannot change: the edge, and what is not round, leave"
        f" {found.sample.area_fraction:.4f}; microstructure.limits and the map's fit do the rest"
    )
    if abs(taken / fraction - 1) > TOLD:
        yield (
            "for E of fibres at the image's own fraction, pack these circles:"
            f' [microstructure.packing] file = "circles.csv", area_fraction = {fraction:.4f},'
            ' discs = 2000, in place of [microstructure.image], and cell.particles = "cylinders"'
            "; the stage writes them beside radius.toml: put its folder before their name"
        )
    if abs(taken / fraction - 1) > FALLEN:
        yield (
            f"warning: E takes an area fraction of {taken:.4f}, {taken / fraction - 1:+.0%} of the"
            f" image's {fraction:.4f}: particles were left out or are not round, or the image shows"
            " too few; the image itself as the cell ([cell] image) loses none"
        )
    if (misfit := read.misfit) > MISFIT:
        yield (
            f"warning: {misfit:.1%} of the particles' area lies outside the circles that stand for"
            f" them, where discs that touch leave less than {MISFIT:.0%}: they are not round"
        )
    if len(read.unsure):
        yield uncertain(read.unsure)
    if light := read.light:
        yield (
            f"the light differed by {light:.2f} of the contrast over the image and was evened"
            " (surfaces of degree 8); look at the circles drawn over the image"
        )
    if (apart := read.unevenness) > UNEVEN:
        told = "circles may be missing, false or of a wrong radius"
        yield f"warning: {uneven_in_words(apart)}, and read it again; {told}"
    if (strange := read.strange) > STRANGERS:
        yield (
            f"warning: {strange:.2%} of the pixels are much brighter or darker than both phases, as"
            " a label, a scale bar, a frame or a third phase; they count as matrix or particles:"
            " crop them off ([microstructure.image] crop) or paint them over"
        )
