"""Keys of the case file: one table for checks, JSON Schema, help and docs."""

from __future__ import annotations

from alphacut.case.key import (
    COUNT,
    DEVIATIONS,
    MEMBERSHIP,
    NOT_NEGATIVE,
    POISSON,
    POSITIVE,
    UNIT,
    Key,
    Range,
    Section,
)
from alphacut.case.schema_image import PICTURE_KEYS
from alphacut.case.schema_structure import (
    ALPHA,
    ENVELOPE,
    EXCEEDANCE,
    FRAME,
    PENDULUM,
    STUDY,
    TOWER,
)
from alphacut.case.schema_structure import ENVELOPE_METHODS as ENVELOPE_METHODS
from alphacut.case.schema_structure import INTEGRATORS as INTEGRATORS
from alphacut.case.schema_structure import NONLINEAR as NONLINEAR

VERSION = 1
STAGES = ("microstructure", "modulus", "image", "envelope")
PLANS = ("general", "reduced", "extended", "signed")
CELL_METHODS = ("prism", "slices", "table", "series", "image", "auto")

KNOWN_VERSION = Range(f"equal to {VERSION}", lower=VERSION, upper=VERSION, closed=True)

TOP = Section(
    "What the case is.",
    {
        "schema": Key(
            "version of the case format", "integer", required=True, allowed=KNOWN_VERSION
        ),
        "title": Key("one line, for figures and the report", "text", required=True),
        "about": Key("a paragraph: what the case shows", "text", required=True),
        "source": Key("where the values come from", "text", default=""),
        "stages": Key(
            "stages that `alphacut run` computes, in order",
            "choices",
            required=True,
            choices=STAGES,
        ),
    },
)

MICROSTRUCTURE = Section(
    "From particles to the random radius: exactly one of the sections packing, circles, image"
    " below it.",
    {
        "seed": Key(
            "seed of everything left to chance",
            "integer",
            required=True,
            allowed=Range("0 or more", 0.0, closed=True),
        ),
        "limits": Key(
            "lower and upper limit of r_n = r/a; share decides if left out", "numbers", allowed=UNIT
        ),
        "share": Key("share of area that the limits keep", "number", default=0.9927, allowed=UNIT),
        "confidence": Key(
            "level of the empirical distribution's bootstrap band",
            "number",
            default=0.99,
            allowed=UNIT,
        ),
        "bootstrap": Key(
            "resamples", "integer", default=500, allowed=Range("100 or more", 100.0, closed=True)
        ),
        "band": Key(
            "half width, in probability, by which the distribution may leave the p-box; that"
            " bootstrap band if left out",
            "number",
            allowed=Range("0 or greater and below 1", 0.0, 1.0, closed=True, below=True),
        ),
        "sampling": Key(
            "whether a2 and a4 also hold the slopes' own bootstrap band: fewer data, a fuzzier map",
            "flag",
            default=False,
        ),
    },
)

PACKING = Section(
    "Discs packed at random in a periodic box: equal, truncated log-normal (eq. 11), or of the"
    " radii in a file.",
    {
        "packings": Key(
            "independent packings",
            "integer",
            default=20,
            allowed=Range("5 or more", 5.0, closed=True),
        ),
        "discs": Key(
            "discs in each packing",
            "integer",
            required=True,
            allowed=Range("10 or more", 10.0, closed=True),
        ),
        "area_fraction": Key(
            "share of the area that discs cover",
            "number",
            required=True,
            allowed=Range("inside (0, 0.85)", 0.0, 0.85),
        ),
        "smallest_radius": Key(
            "smallest radius of the log-normal law; needed without a file",
            "number",
            "m",
            allowed=POSITIVE,
        ),
        "largest_radius": Key(
            "largest radius of the log-normal law; needed without a file",
            "number",
            "m",
            allowed=POSITIVE,
        ),
        "file": Key(
            "CSV file of measured radii or diameters, a column r [mm] or d [mm], in place of both",
            "text",
        ),
        "gap": Key("least gap between surfaces", "number", "m", default=0.0, allowed=NOT_NEGATIVE),
        "method": Key(
            "how they are packed",
            "choice",
            default="auto",
            choices=("auto", "sequential", "relaxed"),
        ),
    },
)

CIRCLES = Section(
    "Measured circles from a CSV file with the columns x, y, r.",
    {
        "file": Key(
            "CSV file, its units in the header: x [mm], y [mm], r [mm]", "text", required=True
        ),
        "size": Key(
            "width and height of the section", "numbers", "m", required=True, allowed=POSITIVE
        ),
        "origin": Key(
            "lower left corner of the section in the file's coordinates",
            "numbers",
            "m",
            default=(0.0, 0.0),
        ),
        "periodic": Key(
            "whether the section repeats itself; otherwise it is an open window",
            "flag",
            default=False,
        ),
        "unit": Key("unit of columns whose header names none", "text", default=""),
        "drop": Key(
            "leave out rows that make no sense instead of refusing the file", "flag", default=False
        ),
        "overlap": Key(
            "overlap that counts as error of measurement, over the smaller radius",
            "number",
            default=0.0,
            allowed=MEMBERSHIP,
        ),
    },
)

IMAGE = Section(
    "Circles segmented from the image of a section.",
    {
        "file": Key("image file", "text", required=True),
        "pixel": Key("side of a pixel", "number", "m", required=True, allowed=POSITIVE),
        "particles": Key(
            "bright or dark against the matrix",
            "choice",
            default="auto",
            choices=("auto", "bright", "dark"),
        ),
    },
)

RADIUS = Section(
    "Random radius of the particle over half the cell's side: cubic Hermite map of the truncated"
    " normal θ (eq. 12).",
    {
        "theta": Key(
            "support of θ in standard deviations",
            "numbers",
            default=(-3.0, 3.0),
            allowed=DEVIATIONS,
        ),
        "a1": Key("radius at the lower end of θ", required=True, allowed=UNIT),
        "a2": Key("slope dr/dξ at the lower end", required=True),
        "a3": Key("radius at the upper end of θ", required=True, allowed=UNIT),
        "a4": Key("slope dr/dξ at the upper end", required=True),
    },
)

CELL = Section(
    "The periodic cell, in plane strain: two elastic phases and a round particle, or a picture of"
    " its phases (one of image, polygons, inequality), of which stage image gives proved bounds.",
    {
        "matrix_modulus": Key(
            "Young's modulus of the matrix", unit="Pa", required=True, allowed=POSITIVE
        ),
        "matrix_poisson": Key("Poisson's ratio of the matrix", required=True, allowed=POISSON),
        "inclusion_modulus": Key(
            "Young's modulus of the particle", unit="Pa", required=True, allowed=POSITIVE
        ),
        "inclusion_poisson": Key("Poisson's ratio of the particle", required=True, allowed=POISSON),
        **PICTURE_KEYS,
    },
    unless=tuple(PICTURE_KEYS),
)

MESH = Section(
    "Discretisation of the product domain.",
    {
        "layers": Key("element layers in θ", "integer", default=12, allowed=COUNT),
        "size": Key("element size over half the cell's side", "number", default=0.15, allowed=UNIT),
        "interface": Key(
            "conforming, or sign(z) at quadrature points (eq. 13)",
            "choice",
            default="conforming",
            choices=("conforming", "sign"),
        ),
    },
)

MODULUS = Section(
    "The fuzzy modulus: how it is computed, or what stands in for it.",
    {
        "method": Key("model of the cell", "choice", default="prism", choices=CELL_METHODS),
        "plan": Key(
            "samples of the transformation method", "choice", default="general", choices=PLANS
        ),
        "alpha": Key("α-levels", "numbers", default=ALPHA, allowed=MEMBERSHIP),
        "tolerance": Key(
            "relative tolerance on E, for method auto",
            "number",
            default=1e-4,
            allowed=Range("from 1e-10 to 0.1", 1e-10, 0.1, closed=True),
        ),
        "value": Key("a known modulus instead of a computed one", unit="Pa", allowed=POSITIVE),
        "file": Key("α-cuts from a NetCDF file instead of computed ones", "text"),
        "measured": Key("CSV file of measured moduli instead of computed ones", "text"),
        "claim": Key(
            "what the cuts of measured moduli hold with probability 1 - α: next value, mean,"
            " median or quantile Q",
            "text",
            default="next value",
        ),
        "bounds": Key(
            "physically possible moduli, two numbers; needed with measured ones",
            unit="Pa",
            allowed=POSITIVE,
        ),
        "law": Key(
            "law of measured moduli, where it is known", "choice", choices=("normal", "log-normal")
        ),
    },
)

RESPONSE = Section(
    "What the random stress of the cell is beside its mean: its p-box, fuzzy quantiles, and the"
    " fuzzy probability of exceeding a limit.",
    {
        "quantity": Key(
            "homogenised stress 11 under ε11 = ε22 = 0.01, or 12 under ε12 = 0.01",
            "choice",
            default="s11",
            choices=("s11", "s12"),
        ),
        "quantiles": Key(
            "probabilities whose quantiles are wanted",
            "numbers",
            default=(0.05, 0.5, 0.95),
            allowed=UNIT,
        ),
        "limit": Key(
            "stress whose probability of being exceeded is wanted", "number", "Pa", allowed=POSITIVE
        ),
    },
)

SECTIONS: dict[str, Section] = {
    "": TOP,
    "microstructure": MICROSTRUCTURE,
    "microstructure.packing": PACKING,
    "microstructure.circles": CIRCLES,
    "microstructure.image": IMAGE,
    "radius": RADIUS,
    "cell": CELL,
    "mesh": MESH,
    "modulus": MODULUS,
    "response": RESPONSE,
    "frame": FRAME,
    "pendulum": PENDULUM,
    "tower": TOWER,
    "study": STUDY,
    "envelope": ENVELOPE,
    "exceedance": EXCEEDANCE,
}
# sections that a stage cannot do without
NEEDED = {
    "microstructure": ("microstructure",),
    "modulus": ("radius", "cell"),
    "image": ("cell",),
    "envelope": ("envelope",),
}
# sections that hold their defaults where they are left out and the other one is there
IMPLIED = {
    "mesh": "cell",
    "modulus": "cell",
}


def dotted(section: str, key: str) -> str:
    """Full name of a key, ``cell.matrix_modulus``."""
    return f"{section}.{key}" if section else key


def every_key() -> dict[str, Key]:
    """All keys by their full names."""
    return {
        dotted(name, key): entry
        for name, section in SECTIONS.items()
        for key, entry in section.keys.items()
    }
