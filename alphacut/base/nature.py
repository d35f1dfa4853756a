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
    """Return the lower or upper end of a range, rounded so that what it promises stays true.

    Attained ends, which some inputs reach, are rounded towards the inside of the range; estimated
    and guaranteed ones, which hold the true range, towards the outside. A value that differs from a
    rounded one by less than 1e-10 of itself counts as that one. Zero, NaN and infinities are
    returned as they are.

    Args:
        value: The end.
        side: "lower" or "upper".
        nature: What the end promises.
        digits: Number of significant digits, 1 or more.
    """
    if value == 0 or not math.isfinite(value):
        return value
    is_upward = (side == "upper") != (nature is Nature.ATTAINED)
    exponent = digits - 1 - math.floor(math.log10(abs(value)))
    scale = 10.0 ** min(exponent, 308)  # the largest power of ten; tinier values get fewer digits
    # Without this 0.1 · 3, which is 0.30000000000000004 in floats, would be rounded up to 0.3001.
    round_off = 1e-10 * abs(value) * scale
    if is_upward:
        return math.ceil(value * scale - round_off) / scale
    return math.floor(value * scale + round_off) / scale
