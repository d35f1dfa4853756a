"""What bounds promise, and the rounding of their ends that keeps the promise."""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import StrEnum


class Nature(StrEnum):
    """What bounds promise, from the weakest to the strongest."""

    ATTAINED = "attained"  # inner bounds: some inputs reach them, others may go farther
    ESTIMATED = "estimated"  # right to within an error that is estimated
    GUARANTEED = "guaranteed"  # outer bounds: proved that nothing lies outside

    @property
    def sentence(self) -> str:
        """The promise in one sentence."""
        return {
            "attained": "Some inputs reach these bounds; the true range may be wider.",
            "estimated": "The true bounds lie within the error, as an independent check tells.",
            "guaranteed": "No value in the α-cut lies outside these bounds; this is proved.",
        }[self]

    @staticmethod
    def weakest(natures: Iterable[Nature]) -> Nature:
        """The weakest of one or more natures."""
        return min(natures, key=list(Nature).index)


def rounded(value: float, side: str, nature: Nature, digits: int = 4) -> float:
    """Return the lower or upper end of a range, rounded to some significant digits.

    Attained ends are rounded towards the inside of the range, others towards the outside, so that
    they stay true. A difference in the tenth digit is taken for round-off.
    """
    if value == 0 or not math.isfinite(value):
        return value
    is_upward = (side == "upper") != (nature is Nature.ATTAINED)
    scale = 10.0 ** (digits - 1 - math.floor(math.log10(abs(value))))
    round_off = 1e-10 * abs(value) * scale
    if is_upward:
        return math.ceil(value * scale - round_off) / scale
    return math.floor(value * scale + round_off) / scale
