"""Spectral acceleration of a record, by the exact motion of an oscillator."""

from __future__ import annotations

from math import ceil, pi

import numpy as np

from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.storey import StoreyFrame

POINTS_PER_PERIOD = 40
"""A peak of a sine read at points this far apart is low by at most 1 − cos(π/40) = 0.3 %."""


def spectral_acceleration(ground: Accelerogram, period: float, ratio: float) -> float:
    """Pseudo-acceleration `ω² max |u|` of an oscillator at rest at the start, in m/s².

    `period` T is undamped, in s; the damping `ratio` ζ is below 1. The free motion after the
    record's end is included for one period.
    """
    omega, substeps = 2 * pi / period, max(1, ceil(ground.step * POINTS_PER_PERIOD / period))
    substep, length = ground.step / substeps, ground.step * (len(ground.samples) - 1)
    duration = substep * ceil((length + period) / substep)
    oscillator = StoreyFrame([1.0], stiffness=[omega**2], damping_ratio=ratio, ground=ground)
    flow = LinearFlow(oscillator, (), duration, substep, Exact(), by_modes=False)
    return float(omega**2 * np.abs(flow.values(np.zeros((1, 0)))).max())
