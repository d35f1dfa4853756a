"""The case file's keys: one table that the checks, the JSON Schema, the help texts and the docs all read."""

from __future__ import annotations

from alphacut.key import COUNT, DEVIATIONS, MEMBERSHIP, NOT_NEGATIVE, POISSON, POSITIVE, RATIO, UNIT, Key, Range, Section
from fuzzy import Crisp

VERSION = 1
STAGES = ("microstructure", "modulus", "envelope")
ENVELOPE_METHODS = ("auto", "modal", "graph-follower", "improved-graph-follower", "vertex", "monte-carlo", "quasi-monte-carlo")
INTEGRATORS = ("midpoint", "newmark", "rk4", "gauss4", "exact", "composition4")
PLANS = ("general", "reduced", "extended", "signed")
CELL_METHODS = ("prism", "slices", "table", "series", "auto")
ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)

KNOWN_VERSION = Range(f"equal to {VERSION}", lower=VERSION, upper=VERSION, closed=True)

TOP = Section(
    "What the case is.",
    {
        "schema": Key("version of the case format", "integer", required=True, allowed=KNOWN_VERSION),
        "title": Key("one line, for figures and the report", "text", required=True),
        "about": Key("a paragraph: what the case shows", "text", required=True),
        "source": Key("where the values come from", "text", default=""),
        "stages": Key("stages that `alphacut run` computes, in order", "choices", required=True, choices=STAGES),
    },
)

MICROSTRUCTURE = Section(
    "From particles to the random radius: exactly one of the sections packing, circles, image below it.",
    {
        "seed": Key("seed of everything left to chance", "integer", required=True, allowed=Range("0 or more", 0.0, closed=True)),
        "limits": Key("lower and upper limit of r_n = r/a; share decides if left out", "numbers", allowed=UNIT),
        "share": Key("share of area that the limits keep", "number", default=0.9927, allowed=UNIT),
        "confidence": Key("level of the empirical distribution's bootstrap band", "number", default=0.99, allowed=UNIT),
        "bootstrap": Key("resamples", "integer", default=500, allowed=Range("100 or more", 100.0, closed=True)),
        "band": Key(
            "half width, in probability, by which the distribution may leave the p-box; that bootstrap band if left out",
            "number",
            allowed=Range("0 or greater and below 1", 0.0, 1.0, closed=True, below=True),
        ),
        "sampling": Key("whether a2 and a4 also hold the slopes' own bootstrap band: fewer data, a fuzzier map", "flag", default=False),
    },
)

PACKING = Section(
    "Discs packed at random in a periodic box, equal or truncated log-normal (eq. 11).",
    {
        "packings": Key("independent packings", "integer", default=20, allowed=Range("5 or more", 5.0, closed=True)),
        "discs": Key("discs in each packing", "integer", required=True, allowed=Range("10 or more", 10.0, closed=True)),
        "area_fraction": Key("share of the area that discs cover", "number", required=True, allowed=Range("inside (0, 0.85)", 0.0, 0.85)),
        "smallest_radius": Key("smallest radius", "number", "m", required=True, allowed=POSITIVE),
        "largest_radius": Key("largest radius", "number", "m", required=True, allowed=POSITIVE),
        "gap": Key("least gap between surfaces", "number", "m", default=0.0, allowed=NOT_NEGATIVE),
        "method": Key("how they are packed", "choice", default="auto", choices=("auto", "sequential", "relaxed")),
    },
)

CIRCLES = Section(
    "Measured circles from a CSV file with the columns x, y, r.",
    {
        "file": Key("CSV file, its units in the header: x [mm], y [mm], r [mm]", "text", required=True),
        "size": Key("width and height of the section", "numbers", "m", required=True, allowed=POSITIVE),
        "origin": Key("lower left corner of the section in the file's coordinates", "numbers", "m", default=(0.0, 0.0)),
        "periodic": Key("whether the section repeats itself; otherwise it is an open window", "flag", default=False),
        "unit": Key("unit of columns whose header names none", "text", default=""),
        "drop": Key("leave out rows that make no sense instead of refusing the file", "flag", default=False),
        "overlap": Key("overlap that counts as error of measurement, over the smaller radius", "number", default=0.0, allowed=MEMBERSHIP),
    },
)

IMAGE = Section(
    "Circles segmented from the image of a section.",
    {
        "file": Key("image file", "text", required=True),
        "pixel": Key("side of a pixel", "number", "m", required=True, allowed=POSITIVE),
        "particles": Key("bright or dark against the matrix", "choice", default="auto", choices=("auto", "bright", "dark")),
    },
)

RADIUS = Section(
    "Random radius of the particle over half the cell's side: cubic Hermite map of the truncated normal θ (eq. 12).",
    {
        "theta": Key("support of θ in standard deviations", "numbers", default=(-3.0, 3.0), allowed=DEVIATIONS),
        "a1": Key("radius at the lower end of θ", required=True, allowed=UNIT),
        "a2": Key("slope dr/dξ at the lower end", required=True),
        "a3": Key("radius at the upper end of θ", required=True, allowed=UNIT),
        "a4": Key("slope dr/dξ at the upper end", required=True),
    },
)

CELL = Section(
    "The two elastic phases of the periodic cell, in plane strain.",
    {
        "matrix_modulus": Key("Young's modulus of the matrix", unit="Pa", required=True, allowed=POSITIVE),
        "matrix_poisson": Key("Poisson's ratio of the matrix", required=True, allowed=POISSON),
        "inclusion_modulus": Key("Young's modulus of the particle", unit="Pa", required=True, allowed=POSITIVE),
        "inclusion_poisson": Key("Poisson's ratio of the particle", required=True, allowed=POISSON),
    },
)

MESH = Section(
    "Discretisation of the product domain.",
    {
        "layers": Key("element layers in θ", "integer", default=12, allowed=COUNT),
        "size": Key("element size over half the cell's side", "number", default=0.15, allowed=UNIT),
        "interface": Key(
            "conforming, or sign(z) at quadrature points (eq. 13)", "choice", default="conforming", choices=("conforming", "sign")
        ),
    },
)

MODULUS = Section(
    "The fuzzy modulus: how it is computed, or what stands in for it.",
    {
        "method": Key("model of the cell", "choice", default="prism", choices=CELL_METHODS),
        "plan": Key("samples of the transformation method", "choice", default="general", choices=PLANS),
        "alpha": Key("α-levels", "numbers", default=ALPHA, allowed=MEMBERSHIP),
        "tolerance": Key("relative tolerance on E, for method auto", "number", default=1e-4, allowed=POSITIVE),
        "value": Key("a known modulus instead of a computed one", unit="Pa", allowed=POSITIVE),
        "file": Key("α-cuts from a NetCDF file instead of computed ones", "text"),
        "measured": Key("CSV file of measured moduli instead of computed ones", "text"),
    },
)

RESPONSE = Section(
    "What the random stress of the cell is beside its mean: its p-box, fuzzy quantiles, and the fuzzy probability of exceeding a limit.",
    {
        "quantity": Key("homogenised stress 11 under load 1, or 12 under load 2", "choice", default="s11", choices=("s11", "s12")),
        "quantiles": Key("probabilities whose quantiles are wanted", "numbers", default=(0.05, 0.5, 0.95), allowed=UNIT),
        "limit": Key("stress whose probability of being exceeded is wanted", "number", "Pa", allowed=POSITIVE),
    },
)

FRAME = Section(
    "Storey frame: rigid floors on elastic columns, numbered from the ground.",
    {
        "masses": Key("mass of each floor", "fuzzy list", "kg", required=True, allowed=POSITIVE),
        "lengths": Key("length of the columns below each floor", "fuzzy list", "m", required=True, allowed=POSITIVE, alone=True),
        "modulus": Key("Young's modulus where none is handed on", unit="Pa", allowed=POSITIVE),
        "second_moment": Key("second moment of area of one column", unit="m^4", required=True, allowed=POSITIVE),
        "damping_ratio": Key(
            "viscous damping over the critical one: of all modes, or of each by rising frequency; beside the other damping",
            "fuzzy list",
            allowed=RATIO,
            alone=True,
        ),
        "dampers": Key(
            "viscous damper of each floor; needed where no other damping is given",
            "fuzzy list",
            "N*s/m",
            default=(Crisp(0.0),),
            allowed=NOT_NEGATIVE,
            alone=True,
        ),
        "damper_placement": Key("to the ground, or between storeys; needed with dampers", "choice", choices=("ground", "storey")),
        "displacements": Key(
            "displacement of each floor at the start; needed without an accelerogram", "fuzzy list", "m", default=(Crisp(0.0),), alone=True
        ),
        "velocities": Key(
            "velocity of each floor at the start; needed without an accelerogram", "fuzzy list", "m/s", default=(Crisp(0.0),), alone=True
        ),
        "rayleigh_mass": Key("factor a of Rayleigh damping a M + b K", unit="1/s", default=Crisp(0.0), allowed=NOT_NEGATIVE),
        "rayleigh_stiffness": Key("factor b of Rayleigh damping a M + b K", unit="s", default=Crisp(0.0), allowed=NOT_NEGATIVE),
        "accelerogram": Key("CSV file of the ground's acceleration; displacements are then relative to the ground", "text"),
        "outputs": Key("observed quantities: q1, v1, drift1, shear1 …, base_shear; all displacements if left out", "choices", default=()),
    },
)

TOWER = Section(
    "Plane beam frame of many storeys and bays, clamped at its foot, reduced to a few shapes that hold for all its fuzzy inputs.",
    {
        "storeys": Key("number of storeys", "integer", required=True, allowed=COUNT),
        "bays": Key("number of bays", "integer", required=True, allowed=COUNT),
        "height": Key("height of a storey", "number", "m", required=True, allowed=POSITIVE),
        "width": Key("width of a bay", "number", "m", required=True, allowed=POSITIVE),
        "column_area": Key("area of a column", "number", "m^2", required=True, allowed=POSITIVE),
        "column_moment": Key("second moment of area of a column", "number", "m^4", required=True, allowed=POSITIVE),
        "beam_area": Key("area of a beam", "number", "m^2", required=True, allowed=POSITIVE),
        "beam_moment": Key("second moment of area of a beam", "number", "m^4", required=True, allowed=POSITIVE),
        "E_columns": Key("Young's modulus of the lower half's columns", unit="Pa", required=True, allowed=POSITIVE),
        "E_columns_top": Key("Young's modulus of the upper half's columns", unit="Pa", required=True, allowed=POSITIVE),
        "E_beams": Key("Young's modulus of the beams", unit="Pa", required=True, allowed=POSITIVE),
        "mass": Key("mass of the floors over the length of the beams", unit="kg/m", required=True, allowed=POSITIVE),
        "density": Key("density of the columns", "number", "kg/m^3", required=True, allowed=NOT_NEGATIVE),
        "damping_ratio": Key("viscous damping over the critical one, of all modes; beside Rayleigh's", allowed=RATIO),
        "rayleigh_mass": Key(
            "factor a of Rayleigh damping a M + b K; needed without damping_ratio", unit="1/s", default=Crisp(0.0), allowed=NOT_NEGATIVE
        ),
        "rayleigh_stiffness": Key(
            "factor b of Rayleigh damping a M + b K; needed without damping_ratio", unit="s", default=Crisp(0.0), allowed=NOT_NEGATIVE
        ),
        "accelerogram": Key("CSV file of the ground's acceleration", "text", required=True),
    },
)

PENDULUM = Section(
    "Damped pendulum: a mass on a bar under gravity; the output is the force in the bar.",
    {
        "mass": Key("mass", unit="kg", required=True, allowed=POSITIVE),
        "length": Key("length of the bar", unit="m", required=True, allowed=POSITIVE),
        "damping": Key("moment over angular velocity", unit="N*m*s", required=True, allowed=NOT_NEGATIVE),
        "gravity": Key("acceleration of gravity", unit="m/s^2", required=True, allowed=POSITIVE),
        "angle": Key("angle at the start, 0 hanging down", unit="rad", required=True),
        "angular_velocity": Key("angular velocity at the start", unit="rad/s", required=True),
        "tolerance": Key("wanted error of the force, or gain worth a new trajectory", "number", "N", default=1e-3, allowed=POSITIVE),
    },
)

STUDY = Section(
    "One envelope that `alphacut run` computes; what it leaves out is taken from [envelope].",
    {
        "name": Key("name of the study and of its file envelope_NAME.nc", "text", required=True),
        "fuzzy": Key("inputs that are fuzzy; all others take their modal value", "choices", required=True),
        "duration": Key("length of the simulation", "number", "s", required=True, allowed=POSITIVE),
        "figures": Key("figure of the paper for each output, or for one", "choices", default=()),
        "output": Key("the one output that is drawn; all if left out", "text", default=""),
    },
    repeated=True,
)

ENVELOPE = Section(
    "Fuzzy forward dynamics.",
    {
        "fuzzy": Key(
            "inputs that are fuzzy, of a frame: E, I, m or m1 …, l, d, q0, v0, zeta (damping ratio) …",
            "choices",
            required=True,
        ),
        "alpha": Key("α-levels", "numbers", default=ALPHA, allowed=MEMBERSHIP),
        "method": Key("how the envelope is found", "choice", default="auto", choices=ENVELOPE_METHODS),
        "integrator": Key("time stepping; by the method if left out: exact for modal, else midpoint", "choice", choices=INTEGRATORS),
        "order": Key("order κ of the Taylor models", "integer", default=2, allowed=Range("1 or 2", 1, 2, closed=True)),
        "tolerance": Key(
            "wanted error of a frame's displacements; for graph-follower the gain that is worth a new trajectory",
            "number",
            "m",
            default=1e-4,
            allowed=POSITIVE,
        ),
        "relative_tolerance": Key("the same as a share of each output's peak, in place of tolerance", "number", allowed=UNIT),
        "duration": Key("length of the simulation", "number", "s", required=True, allowed=POSITIVE),
        "step": Key("time step", "number", "s", required=True, allowed=POSITIVE),
    },
)

EXCEEDANCE = Section(
    "Fuzzy probability that an output exceeds a limit within [envelope]'s duration; what is not random stays fuzzy.",
    {
        "output": Key("the output: q3, drift1, base_shear …; of a tower roof or drift, of a pendulum force", "text", required=True),
        "limit": Key("magnitude it must not exceed, with the output's unit", "text", required=True),
        "random": Key("inputs that are random, with a density of the shape of their membership", "choices", default=()),
        "samples": Key("random draws at each fuzzy point", "integer", default=200, allowed=COUNT),
        "seed": Key("seed of the draws", "integer", default=0, allowed=Range("0 or more", 0.0, closed=True)),
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
NEEDED = {
    "microstructure": ("microstructure",),
    "modulus": ("radius", "cell"),
    "envelope": ("envelope",),
}  # sections that a stage cannot do without
IMPLIED = {"mesh": "cell", "modulus": "cell"}  # sections that hold their defaults where they are left out and the other one is there


def dotted(section: str, key: str) -> str:
    """Full name of a key, ``cell.matrix_modulus``."""
    return f"{section}.{key}" if section else key


def every_key() -> dict[str, Key]:
    """All keys by their full names."""
    return {dotted(name, key): entry for name, section in SECTIONS.items() for key, entry in section.keys.items()}
