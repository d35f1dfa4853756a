"""Smallest box that is proved to hold every parameter that agrees with the measured modes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.identify.chain import Chain
from alphacut.frame.identify.measured import MeasuredMode, ModeCut
from alphacut.frame.identify.relaxation import Relaxation, relaxation
from alphacut.fuzzy.arrays import Array

SETTLED = 0.03
"""Share of the widths that a further pass must take off to be worth another one."""


@dataclass(frozen=True, eq=False)
class Enclosure:
    """A box of log parameters.

    Args:
        lower: Lower ends, shape (d,).
        upper: Upper ends.
    """

    lower: Array
    upper: Array


def enclosure(
    chain: Chain, lower: Array, upper: Array, modes: list[tuple[MeasuredMode, ModeCut]], passes: int
) -> Enclosure | None:
    """The box, from one that holds all parameters that are possible; None where none agree.

    Args:
        chain: The frame.
        lower: Lower ends of the log parameters over their nominal values, shape (d,).
        upper: Upper ends.
        modes: Measured modes and their cuts at a level.
        passes: Most passes over all ends.
    """
    amplitudes: dict[tuple[int, int], tuple[float, float]] = {}
    for _ in range(passes):
        held = relaxation(chain, lower, upper, modes, amplitudes)
        if held is None:
            return None
        for key, expression in held.shapes.items():
            low, high = _ends(held, expression)
            if low > high:
                return None
            amplitudes[key] = (low, high)
        if amplitudes:
            held = relaxation(chain, lower, upper, modes, amplitudes)
            if held is None:
                return None
        before = upper - lower
        ends = np.stack([lower, upper])
        for at, expression in enumerate(held.parameters):
            if lower[at] == upper[at]:
                continue
            low, high = _ends(held, expression)
            if max(low, lower[at]) > min(high, upper[at]):
                return None
            ends[:, at] = max(low, lower[at]), min(high, upper[at])
        lower, upper = ends
        with np.errstate(invalid="ignore", divide="ignore"):
            gained = 1 - np.where(before > 0, (upper - lower) / before, 1.0)
        if gained.max() < SETTLED:
            break
    return Enclosure(lower, upper)


def _ends(held: Relaxation, expression: dict[int, float]) -> tuple[float, float]:
    return held.least(expression), -held.least(expression, -1.0)
