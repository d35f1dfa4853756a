"""The keys of the sections on structures and their vibration."""

from __future__ import annotations

from alphacut.case.key import (
    COUNT,
    MEMBERSHIP,
    NOT_NEGATIVE,
    POSITIVE,
    RATIO,
    UNIT,
    Key,
    Range,
    Section,
)
from alphacut.fuzzy import Crisp

ENVELOPE_METHODS = (
    "auto",
    "modal",
    "graph-follower",
    "improved-graph-follower",
    "vertex",
    "monte-carlo",
    "quasi-monte-carlo",
)
INTEGRATORS = ("midpoint", "newmark", "rk4", "gauss4", "exact", "composition4")
NONLINEAR = ("midpoint", "composition4", "rk4")  # those that integrate a pendulum
ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)

FRAME = Section(
    "Storey frame: rigid floors on elastic columns, numbered from the ground.",
    {
        "masses": Key("mass of each floor", "fuzzy list", "kg", required=True, allowed=POSITIVE),
        "lengths": Key(
            "length of the columns below each floor",
            "fuzzy list",
            "m",
            required=True,
            allowed=POSITIVE,
            alone=True,
        ),
        "modulus": Key("Young's modulus where none is handed on", unit="Pa", allowed=POSITIVE),
        "second_moment": Key(
            "second moment of area of one column; where storeys differ a crisp one for each",
            "fuzzy list",
            "m^4",
            required=True,
            allowed=POSITIVE,
            alone=True,
        ),
        "columns": Key(
            "columns in each storey, clamped at both ends; fuzzy where a storey's stiffness is",
            "fuzzy list",
            default=(Crisp(2.0),),
            allowed=POSITIVE,
            alone=True,
        ),
        "damping_ratio": Key(
            "viscous damping over the critical one: of all modes, or of each by rising frequency;"
            " beside the other damping",
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
        "damper_placement": Key(
            "to the ground, or between storeys; needed with dampers",
            "choice",
            choices=("ground", "storey"),
        ),
        "displacements": Key(
            "displacement of each floor at the start; needed without an accelerogram",
            "fuzzy list",
            "m",
            default=(Crisp(0.0),),
            alone=True,
        ),
        "velocities": Key(
            "velocity of each floor at the start; needed without an accelerogram",
            "fuzzy list",
            "m/s",
            default=(Crisp(0.0),),
            alone=True,
        ),
        "rayleigh_mass": Key(
            "factor a of Rayleigh damping a M + b K",
            unit="1/s",
            default=Crisp(0.0),
            allowed=NOT_NEGATIVE,
        ),
        "rayleigh_stiffness": Key(
            "factor b of Rayleigh damping a M + b K",
            unit="s",
            default=Crisp(0.0),
            allowed=NOT_NEGATIVE,
        ),
        "accelerogram": Key(
            "CSV file of the ground's acceleration; displacements are then relative to the ground",
            "text",
        ),
        "outputs": Key(
            "observed quantities: q1, v1 (m/s), drift1, shear1 … (in the columns of a storey;"
            " dampers excluded), base_shear (that of the lowest storey); all displacements if"
            " left out",
            "choices",
            default=(),
        ),
    },
)

TOWER = Section(
    "Plane beam frame of many storeys and bays, clamped at its foot, reduced to a few shapes that"
    " hold for all its fuzzy inputs.",
    {
        "storeys": Key("number of storeys", "integer", required=True, allowed=COUNT),
        "bays": Key("number of bays", "integer", required=True, allowed=COUNT),
        "height": Key("height of a storey", "number", "m", required=True, allowed=POSITIVE),
        "width": Key("width of a bay", "number", "m", required=True, allowed=POSITIVE),
        "column_area": Key("area of a column", "number", "m^2", required=True, allowed=POSITIVE),
        "column_moment": Key(
            "second moment of area of a column", "number", "m^4", required=True, allowed=POSITIVE
        ),
        "beam_area": Key("area of a beam", "number", "m^2", required=True, allowed=POSITIVE),
        "beam_moment": Key(
            "second moment of area of a beam", "number", "m^4", required=True, allowed=POSITIVE
        ),
        "E_columns": Key(
            "Young's modulus of the lower half's columns",
            unit="Pa",
            required=True,
            allowed=POSITIVE,
        ),
        "E_columns_top": Key(
            "Young's modulus of the upper half's columns",
            unit="Pa",
            required=True,
            allowed=POSITIVE,
        ),
        "E_beams": Key("Young's modulus of the beams", unit="Pa", required=True, allowed=POSITIVE),
        "mass": Key(
            "mass of the floors over the length of the beams",
            unit="kg/m",
            required=True,
            allowed=POSITIVE,
        ),
        "density": Key(
            "density of the columns", "number", "kg/m^3", required=True, allowed=NOT_NEGATIVE
        ),
        "damping_ratio": Key(
            "viscous damping over the critical one, of all modes; beside Rayleigh's", allowed=RATIO
        ),
        "rayleigh_mass": Key(
            "factor a of Rayleigh damping a M + b K; needed without damping_ratio",
            unit="1/s",
            default=Crisp(0.0),
            allowed=NOT_NEGATIVE,
        ),
        "rayleigh_stiffness": Key(
            "factor b of Rayleigh damping a M + b K; needed without damping_ratio",
            unit="s",
            default=Crisp(0.0),
            allowed=NOT_NEGATIVE,
        ),
        "accelerogram": Key("CSV file of the ground's acceleration", "text", required=True),
    },
)

PENDULUM = Section(
    "Damped pendulum: a mass on a bar under gravity; the output is the force in the bar.",
    {
        "mass": Key("mass", unit="kg", required=True, allowed=POSITIVE),
        "length": Key("length of the bar", unit="m", required=True, allowed=POSITIVE),
        "damping": Key(
            "moment over angular velocity", unit="N*m*s", required=True, allowed=NOT_NEGATIVE
        ),
        "gravity": Key("acceleration of gravity", unit="m/s^2", required=True, allowed=POSITIVE),
        "angle": Key("angle at the start, 0 hanging down", unit="rad", required=True),
        "angular_velocity": Key("angular velocity at the start", unit="rad/s", required=True),
        "tolerance": Key(
            "wanted error of the force, or gain worth a new trajectory",
            "number",
            "N",
            default=1e-3,
            allowed=POSITIVE,
        ),
    },
)

STUDY = Section(
    "One envelope that `alphacut run` computes; what it leaves out is taken from [envelope].",
    {
        "name": Key(
            "name of the study and of its file envelope_NAME.nc: letters, digits and . _ + -",
            "text",
            required=True,
        ),
        "fuzzy": Key(
            "inputs that are fuzzy; all others take their modal value", "choices", required=True
        ),
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
            "inputs that are fuzzy, of a frame: E, I, m or m1 …, l, c (columns), d, q0, v0, zeta"
            " (damping ratio) …",
            "choices",
            required=True,
        ),
        "alpha": Key("α-levels", "numbers", default=ALPHA, allowed=MEMBERSHIP),
        "method": Key(
            "how the envelope is found", "choice", default="auto", choices=ENVELOPE_METHODS
        ),
        "integrator": Key(
            "time stepping; by the method if left out: exact for modal, else midpoint",
            "choice",
            choices=INTEGRATORS,
        ),
        "order": Key(
            "order κ of the Taylor models",
            "integer",
            default=2,
            allowed=Range("1 or 2", 1, 2, closed=True),
        ),
        "tolerance": Key(
            "wanted error of displacements; of other outputs the same share of their peaks as of"
            " the first displacement's; for graph-follower the gain that is worth a new trajectory",
            "number",
            "m",
            default=1e-4,
            allowed=POSITIVE,
        ),
        "relative_tolerance": Key(
            "the same as a share of each output's peak, in place of tolerance",
            "number",
            allowed=UNIT,
        ),
        "certify": Key(
            "gap within which the bounds of displacements of a linear structure, up to six inputs"
            " fuzzy, are enclosed and proved; for outputs of other units the same share of their"
            " peaks as of the first displacement's; minutes of computing; no proof if left out;"
            " with a damping ratio the error of the model can only be sampled",
            "number",
            "m",
            allowed=POSITIVE,
        ),
        "duration": Key("length of the simulation", "number", "s", required=True, allowed=POSITIVE),
        "step": Key("time step", "number", "s", required=True, allowed=POSITIVE),
    },
)

EXCEEDANCE = Section(
    "Fuzzy probability that an output exceeds a limit within [envelope]'s duration; what is not"
    " random stays fuzzy.",
    {
        "output": Key(
            "the output: q3, drift1, base_shear …; of a tower roof or drift, of a pendulum force",
            "text",
            required=True,
        ),
        "limit": Key(
            "magnitude it must not exceed, with the output's unit; of a drift also a share of the"
            " storey's modal height: 0.5 %",
            "text",
            required=True,
        ),
        "random": Key(
            "inputs that are random, with a density of the shape of their membership",
            "choices",
            default=(),
        ),
        "samples": Key("random draws at each fuzzy point", "integer", default=200, allowed=COUNT),
        "seed": Key(
            "seed of the draws", "integer", default=0, allowed=Range("0 or more", 0.0, closed=True)
        ),
    },
)
