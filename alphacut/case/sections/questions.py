"""Sections on a frame beyond one envelope: storeys that are alike, limits, what goes together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

from alphacut.case.key import NOT_NEGATIVE, POSITIVE, Key, Range, Section


@dataclass(frozen=True, kw_only=True, slots=True)
class Decision(Section):
    """Possibility and necessity, proved, that a storey frame exceeds limits at any time.

    The inputs and the duration are those of [envelope], the levels begin with its lowest.
    """

    limits: Annotated[
        tuple[str, ...],
        Key(
            "limits on the magnitude of outputs of the frame, one or several: 'drift1 <= 40 mm',"
            " 'a3 <= 2 m/s^2', 'base_shear <= 300 kN'; of a drift also a share of the storey's"
            " height: 'drift1 <= 0.5 %'"
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
        Literal["c", "m"],
        Key("what varies: c, the columns of a storey, or m, masses of the floors"),
    ]
    length: Annotated[
        float, Key("height over which the correlation falls to 1/e", "m", allowed=POSITIVE)
    ]
    share: Annotated[
        float,
        Key(
            "part of the variance that the directions hold",
            allowed=Range("above 0 and up to 1", 1e-6, 1.0, closed=True),
        ),
    ] = 0.95
