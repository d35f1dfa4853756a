"""Response spectra of records: exact for accelerations that are linear between samples.

An oscillator of period T and damping ratio ζ moves from sample to sample by the exponential of its
state matrix (Nigam, Jennings 1969); its peak is read at points of at most a fortieth of the period.
"""

from __future__ import annotations

from math import ceil, pi

import numpy as np

from alphacut.frame import Accelerogram
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import checked_number, require

POINTS_PER_PERIOD = 40
"""A peak of a sine read at points this far apart is low by at most 1 − cos(π/40) = 0.3 %."""


def spectral_acceleration(ground: Accelerogram, period: float, ratio: float) -> float:
    """Pseudo-acceleration ω² max |u| of an oscillator at rest at the start, in m/s².

    The free motion after the record's end is included for one period.

    Args:
        ground: The record.
        period: Undamped natural period T, in s, above 0.
        ratio: Damping ratio ζ, from 0 and below 1.

    Raises:
        RefusedError: The period or the ratio is out of range.
    """
    checked_number("period", period, positive=True)
    require(
        0 <= checked_number("ratio", ratio) < 1, "ratio", value=ratio, allowed="from 0 and below 1"
    )
    from scipy.linalg import expm  # which takes time to import
    from scipy.signal import lfilter

    omega = 2 * pi / period
    substeps = max(1, ceil(ground.step * POINTS_PER_PERIOD / period))
    substep = ground.step / substeps
    start, end = _substep_accelerations(ground, substeps, ceil(period / substep))
    # x' = F x of x = (u, u', a, a'), with a the ground's acceleration and a' its constant slope
    F = np.zeros((4, 4))
    F[0, 1] = 1.0
    F[1, :2] = -(omega**2), -2 * ratio * omega
    F[1, 2], F[2, 3] = -1.0, 1.0
    step_map = expm(F * substep)
    A, b = step_map[:2, :2], step_map[:2, 2:]
    load = b[:, :1] * start + b[:, 1:] * (end - start) / substep  # (2, steps)
    # u[k+1] = tr(A) u[k] − det(A) u[k−1] + what the loads of both steps add, by Cayley and Hamilton
    added = load[0].copy()
    added[1:] += A[0, 1] * load[1, :-1] - A[1, 1] * load[0, :-1]
    displacement = lfilter([1.0], [1.0, -np.trace(A), np.linalg.det(A)], added)
    return float(omega**2 * np.abs(displacement).max())


def _substep_accelerations(ground: Accelerogram, substeps: int, n_free: int) -> tuple[Array, Array]:
    """Ground's acceleration at the start and at the end of each substep, then of `n_free` zeros."""
    samples = ground.acceleration
    positions = np.arange((len(samples) - 1) * substeps + 1) / substeps
    values = np.interp(positions, np.arange(len(samples)), samples)
    zeros = np.zeros(n_free)
    return np.append(values[:-1], zeros), np.append(values[1:], zeros)
