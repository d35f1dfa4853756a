"""Spectral acceleration of a record, by the exact response of an oscillator."""

from __future__ import annotations

from math import ceil, pi

import numpy as np

from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.storey import StoreyFrame


def spectral_acceleration(ground: Accelerogram, period: float, ratio: float) -> float:
    """Return the pseudo-acceleration ω² max |u| of an oscillator that starts at rest, in m/s².

    The free vibration after the record is included for one period.

    Args:
        ground: The record.
        period: Undamped natural period, in s.
        ratio: Damping ratio, below 1.
    """
    omega = 2 * pi / period
    # The peak of a sine that is read at n points per period is too low by at most 1 - cos(π / n),
    # which is 0.3 % for n = 40.
    substeps = max(1, ceil(ground.step * 40 / period))
    substep = ground.step / substeps
    length = ground.step * (len(ground.samples) - 1)
    duration = substep * ceil((length + period) / substep)
    oscillator = StoreyFrame([1.0], stiffness=[omega**2], damping_ratio=ratio, ground=ground)
    flow = LinearFlow(oscillator, (), duration, substep, Exact(), by_modes=False)
    no_parameters = np.zeros((1, 0))
    return float(omega**2 * np.abs(flow.values(no_parameters)).max())
