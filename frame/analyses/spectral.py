"""Spectral acceleration of a record, by the exact response of an oscillator."""

from __future__ import annotations

from math import ceil, pi

import numpy as np

from alphacut.base.errors import checked_number
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.structures.storey import StoreyFrame


def spectral_acceleration(ground: Accelerogram, period: float, ratio: float) -> float:
    """Return the spectral pseudo-acceleration Sa = ω² max |u| of a record, in m/s².

    The displacement u of a linear oscillator relative to the ground follows from
    u'' + 2 ζ ω u' + ω² u = -a(t), from rest. It is computed exactly for the piecewise linear record
    a(t), and one period of free vibration after the record is included. The peak is read at 40 or
    more times a period, which misses at most 0.3 % of it.

    Args:
        ground: Ground acceleration a(t).
        period: Undamped natural period 2π/ω, in s, positive.
        ratio: Damping ratio ζ, at least 0 and below 1.

    Raises:
        RefusedError: The period is not a positive, finite number, or the damping ratio is negative,
            or 1 or more.
    """
    checked_number("period", period, positive=True)
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
