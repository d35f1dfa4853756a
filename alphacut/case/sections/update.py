"""Section on measured natural modes, from which the inputs of a frame are learned."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from alphacut.case.key import MEMBERSHIP, POSITIVE, Key, Section


@dataclass(frozen=True, kw_only=True, slots=True)
class Update(Section):
    """Measured natural modes of a storey frame, from which `run` and `update` learn its inputs."""

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
        Key("fuzzy inputs that are learned: E, I, c (columns), l, m, or single ones as c1"),
    ]
    held_out: Annotated[
        tuple[float, ...],
        Key("modes that are not learned from, but predicted and compared", allowed=POSITIVE),
    ] = ()
    frequency_deviation: Annotated[
        float | None,
        Key(
            "standard deviation of one measured frequency as a share of it, where it is known from"
            " elsewhere; from the rows' scatter if left out",
            allowed=POSITIVE,
        ),
    ] = None
    shape_deviation: Annotated[
        float | None,
        Key("the same of an amplitude, as a share of the largest of its mode", allowed=POSITIVE),
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
