"""Sections on a frame beyond one envelope: measured modes, alike storeys, limits, pairs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from alphacut.case.key import MEMBERSHIP, UNIT, Key, Section, positive


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
class Update(Section):
    """Measured natural modes, from which `run` and `update` learn inputs."""

    measured: Annotated[
        str,
        Key(
            "CSV file mode,frequency,q1,q2 …: number of the mode, natural frequency in Hz, and"
            " amplitudes of the floors that were measured, to any scale; a row for each time that"
            " the mode was measured",
            file=True,
        ),
    ]
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
