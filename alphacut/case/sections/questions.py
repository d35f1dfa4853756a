"""Sections on questions to the motion of a frame: are limits exceeded, what goes together."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from alphacut.case.key import NOT_NEGATIVE, Key, Section


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
