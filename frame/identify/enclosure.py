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
    """A box of log parameters, and the solver's points at its faces.

    Args:
        lower: Lower ends, shape (d,).
        upper: Upper ends.
        points: Points of the last relaxation where its ends are reached, shape (·, d).
    """

    lower: Array
    upper: Array
    points: Array


def enclosure(
    chain: Chain,
    lower: Array,
    upper: Array,
    modes: list[tuple[MeasuredMode, ModeCut]],
    passes: int,
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
    points = np.zeros((0, len(lower)))
    for _ in range(passes):
        held = relaxation(chain, lower, upper, modes, amplitudes)
        if held is None:
            return None
        for key, expression in held.shapes.items():
            low, high = _ends(held, expression)[:2]
            if low > high:
                return None
            amplitudes[key] = (low, high)
        if amplitudes:
            held = relaxation(chain, lower, upper, modes, amplitudes)
            if held is None:
                return None
        before, rows = upper - lower, []
        ends = np.stack([lower, upper])
        for at, expression in enumerate(held.parameters):
            if lower[at] == upper[at]:
                continue
            low, high, reached = _ends(held, expression)
            if max(low, lower[at]) > min(high, upper[at]):
                return None
            ends[:, at] = max(low, lower[at]), min(high, upper[at])
            rows += [_point(held, x, lower) for x in reached if x is not None]
        lower, upper = ends
        points = np.array(rows).reshape(-1, len(lower))
        with np.errstate(invalid="ignore", divide="ignore"):
            gained = 1 - np.where(before > 0, (upper - lower) / before, 1.0)
        if gained.max() < SETTLED:
            break
    return Enclosure(lower, upper, points)


def _ends(
    held: Relaxation, expression: dict[int, float]
) -> tuple[float, float, tuple[Array | None, Array | None]]:
    low, first = held.least(expression)
    high, last = held.least(expression, -1.0)
    return low, -high, (first, last)


def _point(held: Relaxation, x: Array, fixed: Array) -> Array:
    """Log parameters of a point of the linear program."""
    logs = [
        sum(a * (1.0 if at < 0 else x[at]) for at, a in expression.items())
        for expression in held.parameters
    ]
    return np.array(logs, float).reshape(fixed.shape)
