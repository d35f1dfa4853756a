"""Sections on a frame beyond one envelope: measured modes, alike storeys, limits, pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from alphacut.case.key import MEMBERSHIP, NOT_NEGATIVE, UNIT, Key, Range, Section, positive


@dataclass(frozen=True, kw_only=True, slots=True)
class Decision(Section):
    """Possibility and necessity that a storey frame exceeds limits at any node, proved if possible.

    Inputs, duration and nodes are those of [envelope], the levels begin with its lowest.
    """

    limits: Annotated[
        tuple[str, ...],
        Key(
            "limits on the magnitude of outputs of the frame, one or several: 'drift1 <= 40 mm',"
            " 'a3 <= 2 m/s^2', 'base_shear <= 300 kN'; of a drift also a share of the storey's"
            " height: 'drift1 <= 0.5 %'; an output may have several"
        ),
    ]


@dataclass(frozen=True, kw_only=True, slots=True)
class Joint(Section):
    """Hull of what two outputs may be together at one time, or one output at two times."""

    outputs: Annotated[tuple[str, ...], Key("two outputs of the structure, or one at two times")]
    times: Annotated[
        tuple[float, ...],
        Key("one time, or two: multiples of [envelope] step", "s", allowed=NOT_NEGATIVE),
    ]


@dataclass(frozen=True, kw_only=True, slots=True)
class Field(Section):
    """Storeys of a frame that are alike but not equal: a fuzzy field, correlated by distance.

    The one fuzzy value of all storeys is the support of each; few directions of a Karhunen–Loève
    expansion, c_1, c_2 …, stand for the storeys' own values c1, c2 …
    """

    of: Annotated[
        Literal["c", "k", "m"],
        Key(
            "what varies: c, the columns of a storey, k, its stiffness where that is given, or m,"
            " masses of the floors"
        ),
    ]
    length: Annotated[float, positive("height over which the correlation falls to 1/e", "m")]
    share: Annotated[
        float,
        Key(
            "part of the variance that the directions hold",
            allowed=Range("above 0 and up to 1", 1e-6, 1.0, closed=True),
        ),
    ] = 0.95


@dataclass(frozen=True, kw_only=True, slots=True)
class Update(Section):
    """Measured natural modes or a recorded motion, from which `run` and `update` learn inputs."""

    measured: Annotated[
        str | None,
        Key(
            "CSV file mode,frequency,q1,q2 …: number of the mode, natural frequency in Hz, and"
            " amplitudes of the floors that were measured, to any scale; a row for each time that"
            " the mode was measured",
            file=True,
        ),
    ] = None
    recorded: Annotated[
        str | None,
        Key(
            "CSV file time [s],q1 [mm],q2 [mm] … in place of measured modes: outputs of the frame,"
            " of one unit, recorded from t = 0 on at even steps, with errors alike and independent",
            file=True,
        ),
    ] = None
    learn: Annotated[
        tuple[str, ...],
        Key(
            "fuzzy inputs that are learned: E, I, c (columns), k (stiffness), l, m, or single ones"
            " as c1",
            of_inputs=True,
        ),
    ]
    held_out: Annotated[
        tuple[float, ...], positive("modes that are not learned from, but predicted and compared")
    ] = ()
    frequency_deviation: Annotated[
        float | None,
        Key(
            "standard deviation of one measured frequency as a share of it, where it is known from"
            " elsewhere; from the rows' scatter if left out",
            allowed=UNIT,
        ),
    ] = None
    shape_deviation: Annotated[
        float | None,
        Key("the same of an amplitude, as a share of the largest of its mode", allowed=UNIT),
    ] = None
    independent: Annotated[
        bool,
        Key(
            "whether the errors of all measured quantities are independent of each other; of"
            " unknown dependence if not"
        ),
    ] = False
    alpha: Annotated[tuple[float, ...], Key("α-levels, above 0", allowed=MEMBERSHIP)] = (
        0.05,
        0.25,
        0.5,
        0.75,
        1.0,
    )
