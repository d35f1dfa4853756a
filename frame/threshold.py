"""A limit of a peak, as the question that a proof answers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array


@dataclass(frozen=True)
class Threshold:
    """A limit of an output's peak, as the question that a proof answers.

    Args:
        output: Name of the output.
        value: Limit of its magnitude, of its largest value, or of that of its negative, in SI
            units; None where the peak is to be bounded within the wanted gap instead.
        side: None of magnitudes, True of largest values, False of smallest ones, whose negatives
            are limited.
        answered: Level up to which trajectories are known to answer the question, since one
            exceeds the limit and another keeps it; −1 for none.
    """

    output: str
    value: float | None
    side: bool | None = None
    answered: float = -1.0

    def peak(self, both: Array) -> Array:
        """Return the peak that counts of largest values of (−output, output), shape (…, 2)."""
        if self.side is None:
            return np.asarray(both.max(axis=-1))
        return both[..., int(self.side)]
