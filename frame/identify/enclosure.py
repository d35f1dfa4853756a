"""Smallest box that is proved to hold every parameter that agrees with the measured modes."""

from __future__ import annotations

import numpy as np

from alphacut.frame.identify.chain import Chain
from alphacut.frame.identify.measured import MeasuredMode, ModeCut
from alphacut.frame.identify.relaxation import relaxation
from alphacut.fuzzy.arrays import Array

PASSES = 6
"""Most passes over all ends."""
SETTLED = 0.03
"""Share of the widths that a further pass must take off to be worth another one."""


def enclosure(
    chain: Chain,
    lower: Array,
    upper: Array,
    modes: list[tuple[MeasuredMode, ModeCut]],
) -> tuple[Array, Array] | None:
    """Ends of the box, from one that holds all parameters that are possible; None if none agree.

    Args:
        chain: The frame.
        lower: Lower ends of the log parameters over their nominal values, shape (d,).
        upper: Upper ends.
        modes: Measured modes and their cuts at a level.
    """
    amplitudes: dict[tuple[int, int], tuple[float, float]] = {}
    for _ in range(PASSES):
        held = relaxation(chain, lower, upper, modes, amplitudes)
        if held is not None and held.shapes:
            amplitudes |= {key: held.ends(shape) for key, shape in held.shapes.items()}
            if any(low > high for low, high in amplitudes.values()):
                return None
            held = relaxation(chain, lower, upper, modes, amplitudes)
        if held is None:
            return None
        before, ends = upper - lower, np.stack([lower, upper])
        for at in np.flatnonzero(before > 0):
            low, high = held.ends(held.parameters[at])
            ends[:, at] = max(low, lower[at]), min(high, upper[at])
        lower, upper = ends
        if (lower > upper).any():
            return None
        width = np.where(before > 0, before, 1.0)
        if (1 - np.where(before > 0, upper - lower, 1.0) / width).max() < SETTLED:
            break
    return lower, upper
