"""Keys of the section [cell] where the cell is a picture: an image, polygons or an inequality."""

from __future__ import annotations

from alphacut.case.key import NOT_NEGATIVE, POISSON, POSITIVE, UNIT, Key, Range

DIVISIONS = Range("from 1 to 16", 1.0, 16.0, closed=True)
TILES = Range("from 2 to 64", 2.0, 64.0, closed=True)
PICTURES = ("image", "polygons", "inequality")

PICTURE_KEYS = {
    "image": Key(
        "grey or labelled image of every section of a prismatic material, in place of the round"
        " particle: PNG, TIFF, or a NumPy array .npy",
        "text",
    ),
    "polygons": Key(
        "CSV file of the particle's corners instead, x [mm], y [mm], y upwards; a row nan, nan"
        " between polygons",
        "text",
    ),
    "inequality": Key(
        'where the particle is instead, x and y in m: "(x - 1)**2 + (y - 1)**2 <= 0.25"', "text"
    ),
    "pixel": Key(
        "side of a pixel of the image, or its width and height",
        "numbers",
        "m",
        allowed=POSITIVE,
        alone=True,
    ),
    "size": Key(
        "width and height of the cell: needed by an outline, checked against an image's pixels",
        "numbers",
        "m",
        allowed=POSITIVE,
    ),
    "pixels": Key(
        "pixels across the cell of an outline",
        "integer",
        default=256,
        allowed=Range("from 4 to 8192", 4.0, 8192.0, closed=True),
    ),
    "threshold": Key("grey value from which on a pixel is of the next phase", "fuzzy list"),
    "threshold_deviation": Key(
        "standard deviation of a random threshold, normal about threshold", allowed=NOT_NEGATIVE
    ),
    "quantiles": Key(
        "probabilities whose quantiles of E are wanted, beside a random threshold",
        "numbers",
        default=(0.05, 0.5, 0.95),
        allowed=UNIT,
    ),
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
    "shear": Key("shear modulus of each phase, beside bulk", "fuzzy list", "Pa", allowed=POSITIVE),
    "boundary": Key(
        "periodic: the picture repeats itself; window: it is cut from a larger material",
        "choice",
        default="periodic",
        choices=("periodic", "window"),
    ),
    "tiles": Key("tiles along each side of a window", "integer", default=4, allowed=TILES),
    "division": Key(
        "parts along each side into which every pixel is divided; if left out 2 where the moduli"
        " differ by at most a factor 10, else 1",
        "integer",
        allowed=DIVISIONS,
    ),
    "width": Key(
        "width of the stiffness's bounds, as a share, for which pixels are divided further",
        "number",
        allowed=Range("from 1e-6 to 1", 1e-6, 1.0, closed=True),
    ),
}
