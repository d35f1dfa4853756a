"""The keys of the section on an image of the microstructure."""

from __future__ import annotations

from alphacut.case.key import MEMBERSHIP, POISSON, POSITIVE, Key, Range, Section
from alphacut.case.schema_structure import ALPHA

DIVISIONS = Range("from 1 to 16", 1.0, 16.0, closed=True)
TILES = Range("from 2 to 64", 2.0, 64.0, closed=True)

IMAGE_CELL = Section(
    "Prismatic material whose every section is an image: proved bounds of its plane-strain"
    " stiffness. One of file, polygons, inequality.",
    {
        "file": Key("grey or labelled image: PNG, TIFF, or a NumPy array .npy", "text"),
        "pixel": Key("width of a pixel of the file", "number", "m", allowed=POSITIVE),
        "pixel_height": Key(
            "height of a pixel that is not square", "number", "m", allowed=POSITIVE
        ),
        "window": Key(
            "width and height of the image, checked against its pixels",
            "numbers",
            "m",
            allowed=POSITIVE,
        ),
        "polygons": Key(
            "CSV file of the particle's corners, x [mm], y [mm], y upwards; a row nan, nan between"
            " polygons",
            "text",
        ),
        "inequality": Key(
            'where the particle is, x and y in m: "(x - 1)**2 + (y - 1)**2 <= 0.25"', "text"
        ),
        "size": Key("width and height of the cell of an outline", "numbers", "m", allowed=POSITIVE),
        "pixels": Key(
            "pixels across the cell of an outline",
            "integer",
            default=256,
            allowed=Range("from 4 to 8192", 4.0, 8192.0, closed=True),
        ),
        "threshold": Key("grey value from which on a pixel is of the next phase", "fuzzy list"),
        "labels": Key("value of each phase in a labelled image, instead of thresholds", "numbers"),
        "modulus": Key(
            "Young's modulus of each phase, from dark to bright or as labelled",
            "fuzzy list",
            "Pa",
            allowed=POSITIVE,
        ),
        "poisson": Key("Poisson's ratio of each phase", "fuzzy list", allowed=POISSON, alone=True),
        "bulk": Key(
            "bulk modulus K of each phase, that of three dimensions, instead of modulus",
            "fuzzy list",
            "Pa",
            allowed=POSITIVE,
        ),
        "shear": Key(
            "shear modulus of each phase, beside bulk", "fuzzy list", "Pa", allowed=POSITIVE
        ),
        "boundary": Key(
            "periodic: the image repeats itself; window: it is cut from a larger material",
            "choice",
            default="periodic",
            choices=("periodic", "window"),
        ),
        "tiles": Key("tiles along each side of a window", "integer", default=4, allowed=TILES),
        "division": Key(
            "parts along each side into which every pixel is divided for closer bounds",
            "integer",
            default=1,
            allowed=DIVISIONS,
        ),
        "width": Key(
            "width of the stiffness's bounds, as a share, for which pixels are divided further",
            "number",
            allowed=Range("from 1e-6 to 1", 1e-6, 1.0, closed=True),
        ),
        "accuracy": Key(
            "energy that the solver may leave, relative; more only widens the bounds",
            "number",
            default=3e-6,
            allowed=Range("from 1e-12 to 0.1", 1e-12, 0.1, closed=True),
        ),
        "alpha": Key("α-levels", "numbers", default=ALPHA, allowed=MEMBERSHIP),
    },
)
