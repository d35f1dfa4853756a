"""Sections on particles: packed at random, measured, or seen on a photograph."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from alphacut.case.key import NATURAL, NOT_NEGATIVE, RATIO, UNIT, Key, Range, Section, positive

PACKINGS = Key("independent packings", allowed=Range("from 5 to 10,000", 5.0, 1e4, closed=True))


@dataclass(frozen=True, kw_only=True, slots=True)
class Microstructure(Section):
    """From particles to the random radius.

    Exactly one of the sections packing, circles, image and, for spheres, spheres stands below it.
    """

    seed: Annotated[int, Key("seed of everything left to chance", allowed=NATURAL)]
    limits: Annotated[
        tuple[float, ...] | None,
        Key("lower and upper limit of r_n = r/a; share decides if left out", allowed=UNIT),
    ] = None
    share: Annotated[float, Key("share of area that the limits keep", allowed=UNIT)] = 0.9927
    confidence: Annotated[
        float, Key("level of the empirical distribution's bootstrap band", allowed=UNIT)
    ] = 0.99
    bootstrap: Annotated[
        int, Key("resamples", allowed=Range("from 100 to 1e5", 100.0, 1e5, closed=True))
    ] = 500
    band: Annotated[
        float | None,
        Key(
            "half width, in probability, by which the distribution may leave the p-box;"
            " that bootstrap band if left out",
            allowed=Range("0 or greater and below 1", 0.0, 1.0, closed=True, below=True),
        ),
    ] = None
    sampling: Annotated[
        bool | None,
        Key(
            "whether a2 and a4 also hold the slopes' own bootstrap band, as far as its maps are"
            " monotone: fewer data, a fuzzier map; true for circles and image, false for packing"
            " and spheres (whose band is of packings drawn anew) if left out"
        ),
    ] = None
    packing: Packing | None = None
    circles: Circles | None = None
    image: Photograph | None = None
    spheres: PackedSpheres | None = None


@dataclass(frozen=True, kw_only=True, slots=True)
class Packing(Section):
    """Discs packed at random in a periodic box.

    Equal, truncated log-normal (eq. 11), or of the radii in a file.
    """

    packings: Annotated[int, PACKINGS] = 20
    discs: Annotated[
        int, Key("discs in each packing", allowed=Range("from 10 to 1e6", 10.0, 1e6, closed=True))
    ]
    area_fraction: Annotated[
        float,
        Key("share of the area that discs cover", allowed=Range("inside (0, 0.84)", 0.0, 0.84)),
    ]
    smallest_radius: Annotated[
        float | None, positive("smallest radius of the log-normal law; needed without a file", "m")
    ] = None
    largest_radius: Annotated[
        float | None, positive("largest radius of the log-normal law; needed without a file", "m")
    ] = None
    file: Annotated[
        str | None,
        Key(
            "CSV file of measured radii or diameters, a column r [mm] or d [mm], in place of both",
            file=True,
        ),
    ] = None
    gap: Annotated[float, Key("least gap between surfaces", "m", allowed=NOT_NEGATIVE)] = 0.0
    method: Annotated[Literal["auto", "sequential", "relaxed"], Key("how they are packed")] = "auto"


@dataclass(frozen=True, kw_only=True, slots=True)
class Circles(Section):
    """Measured circles from a CSV file with the columns x, y, r."""

    file: Annotated[
        str, Key("CSV file, its units in the header: x [mm], y [mm], r [mm]", file=True)
    ]
    size: Annotated[tuple[float, ...], positive("width and height of the section", "m")]
    origin: Annotated[
        tuple[float, ...], Key("lower left corner of the section in the file's coordinates", "m")
    ] = (0.0, 0.0)
    periodic: Annotated[
        bool, Key("whether the section repeats itself; otherwise it is an open window")
    ] = False
    overlap: Annotated[
        float,
        Key("overlap that counts as error of measurement, over the smaller radius", allowed=RATIO),
    ] = 0.0


PIXELS = Range("from 0 to 1e6", 0.0, 1e6, closed=True)


@dataclass(frozen=True, kw_only=True, slots=True)
class Photograph(Section):
    """Circles segmented from the image of a section."""

    file: Annotated[str, Key("image file", file=True)]
    pixel: Annotated[float, positive("side of a pixel", "m")]
    particles: Annotated[
        Literal["auto", "bright", "dark"], Key("bright or dark against the matrix")
    ] = "auto"
    crop: Annotated[
        tuple[float, ...] | None,
        Key(
            "the part that is material, without scale bar and caption: left, top, right and bottom"
            " in pixels from the upper left corner; an image with a rectangle of one grey needs it",
            allowed=PIXELS,
        ),
    ] = None


@dataclass(frozen=True, kw_only=True, slots=True)
class PackedSpheres(Section):
    """Spheres packed at random in a periodic cube and divided into Laguerre cells.

    Equal, truncated log-normal (eq. 11), or of measured radii.
    """

    packings: Annotated[int, PACKINGS] = 20
    spheres: Annotated[
        int, Key("spheres in each packing", allowed=Range("from 50 to 1e5", 50.0, 1e5, closed=True))
    ]
    volume_fraction: Annotated[
        float,
        Key(
            "share of the volume that spheres fill, on average that of area in plane sections",
            allowed=Range("inside (0, 0.45)", 0.0, 0.45),
        ),
    ]
    smallest_radius: Annotated[
        float | None,
        positive(
            "smallest radius of the log-normal law; needed without a file",
            "m",
        ),
    ] = None
    largest_radius: Annotated[
        float | None,
        positive(
            "largest radius of the log-normal law; needed without a file",
            "m",
        ),
    ] = None
    file: Annotated[
        str | None,
        Key(
            "CSV file of measured radii or diameters, a column r [mm] or d [mm]",
            file=True,
        ),
    ] = None
