"""Sections on the vibration of a structure: envelopes, studies, exceedance of a limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal, get_args

from alphacut.case.key import (
    ALPHA,
    COUNT,
    MEMBERSHIP,
    NATURAL,
    SHARE,
    UNIT,
    Key,
    Range,
    Section,
    positive,
)

EnvelopeMethod = Literal[
    "auto",
    "modal",
    "graph-follower",
    "improved-graph-follower",
    "vertex",
    "monte-carlo",
    "quasi-monte-carlo",
]
IntegratorName = Literal["midpoint", "rk4", "exact", "composition4"]
ENVELOPE_METHODS: tuple[str, ...] = get_args(EnvelopeMethod)
INTEGRATORS: tuple[str, ...] = get_args(IntegratorName)
NONLINEAR = ("midpoint", "composition4", "rk4")  # those that integrate a pendulum


@dataclass(frozen=True, kw_only=True, slots=True)
class Study(Section):
    """One envelope that `alphacut run` computes.

    Keys that it leaves out are taken from [envelope].
    """

    repeated: ClassVar[bool] = True

    name: Annotated[
        str, Key("name of the study and of its file envelope_NAME.nc: letters, digits and . _ + -")
    ]
    fuzzy: Annotated[
        tuple[str, ...],
        Key("inputs that are fuzzy; all others take their modal value", of_inputs=True),
    ]
    duration: Annotated[float, positive("length of the simulation", "s")]
    figures: Annotated[tuple[str, ...], Key("figure of the paper for each output, or for one")] = ()
    output: Annotated[str, Key("the one output that is drawn; all if left out")] = ""


@dataclass(frozen=True, kw_only=True, slots=True)
class Envelope(Section):
    """Fuzzy forward dynamics."""

    fuzzy: Annotated[
        tuple[str, ...],
        Key(
            "inputs that are fuzzy, of a frame: E, I, m or m1 …, l, c (columns), k (stiffness), d,"
            " q0, v0, zeta (damping ratio) …; also by their keys: masses, masses[1] …",
            of_inputs=True,
        ),
    ]
    alpha: Annotated[tuple[float, ...], Key("α-levels", allowed=MEMBERSHIP)] = ALPHA
    method: Annotated[EnvelopeMethod, Key("how the envelope is found")] = "auto"
    integrator: Annotated[
        IntegratorName | None,
        Key(
            "time stepping; by the method if left out: exact for modal, else midpoint (of linear"
            " structures Newmark's method of average acceleration)"
        ),
    ] = None
    order: Annotated[
        int, Key("order κ of the Taylor models", allowed=Range("1 or 2", 1, 2, closed=True))
    ] = 2
    tolerance: Annotated[
        float,
        positive(
            "wanted error: of every output where all are displacements; where units are mixed, of"
            " the first displacement, and of every other output, displacements too, the same share"
            " of its peak (`check` prints each); a declared error above one that is asked for is"
            " a failure",
            "m",
        ),
    ] = 0.0001
    relative_tolerance: Annotated[
        float | None,
        Key("the same as a share of each output's peak, in place of tolerance", allowed=UNIT),
    ] = None
    gain: Annotated[
        float,
        Key(
            "gain that is worth a new trajectory to a Graph Follower, as a share of the tolerance",
            allowed=SHARE,
        ),
    ] = 0.25
    certify: Annotated[
        float | None,
        positive(
            "gap within which the bounds of a linear structure, up to six inputs fuzzy, are"
            " enclosed, and proved unless the result says verified by sampling: of every output"
            " where all are displacements; where units are mixed, of the first displacement, and of"
            " the others the same share of their peaks, so 3 mm of q1 may be 14 mm of q6 (`check`"
            " prints each); if left out, method auto proves its tolerance",
            "m",
        ),
    ] = None
    shares: Annotated[
        bool, Key("whether run tells what drives the width: an envelope more for each fuzzy input")
    ] = True
    duration: Annotated[float, positive("length of the simulation", "s")]
    step: Annotated[float, positive("time step", "s")]


@dataclass(frozen=True, kw_only=True, slots=True)
class Exceedance(Section):
    """Fuzzy probability that an output exceeds a limit within [envelope]'s duration.

    Inputs that are not random stay fuzzy. It takes output and limit, or limits.
    """

    output: Annotated[
        str,
        Key(
            "the output: q3, drift1, base_shear …; of a tower roof or drift (of its lowest storey),"
            " of a pendulum force"
        ),
    ] = ""
    limit: Annotated[
        str,
        Key(
            "magnitude it must not exceed, with the output's unit; of a drift also a"
            " share of the storey's modal height: 0.5 %"
        ),
    ] = ""
    limits: Annotated[
        tuple[str, ...],
        Key(
            "limits on several outputs at once, 'drift1 <= 0.5 %', 'a3 <= 2 m/s^2'; that any of"
            " them is exceeded is judged too"
        ),
    ] = ()
    random: Annotated[
        tuple[str, ...],
        Key(
            "inputs that are random, with a density of the shape of their membership",
            of_inputs=True,
        ),
    ] = ()
    samples: Annotated[int, Key("random draws at each fuzzy point", allowed=COUNT)] = 200
    seed: Annotated[int, Key("seed of the draws", allowed=NATURAL)] = 0
