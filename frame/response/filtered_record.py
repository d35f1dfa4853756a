"""Ground motion behind a linear oscillator, as a record for another structure.

An oscillator that stands on a floor, and is too light to move it, has the relative displacement w,

    w'' + 2 ζ Ω w' + Ω² w = −a_floor(t).

The floor's absolute acceleration follows from that of the ground a(t) by a linear system at rest,
and so does −Ω² w from the floor's. Two such systems may be exchanged: −Ω² w is the acceleration of
the floor under the ground acceleration b(t) = −Ω² w_ground, the response to a(t) of the same
oscillator on the ground. So the structure needs no oscillator added to it, and frequencies of both
may coincide.

With σ = Ω (−ζ + i √(1 − ζ²)) and ρ' = σ ρ + a, ρ(0) = 0, the response is b = κ Im ρ, where
κ = Ω/√(1 − ζ²). Since a is linear in each step of its record,

    b' = κ Im(σ ρ),    b'' = κ Im(σ² ρ) + Ω² a,    b''' = κ Im(σ³ ρ + σ² a) + Ω² a'.
"""

from __future__ import annotations

from math import ceil
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.response.duhamel import responses_at_nodes


class FilteredRecord(NamedTuple):
    """A piecewise linear record c(t) near the response b(t) of an oscillator to a record.

    Args:
        record: c(t), in m/s².
        integral_error: Guaranteed bound of |∫₀ᵗ (b − c) dτ| up to the end of the record, in m/s.
    """

    record: Accelerogram
    integral_error: float


def filtered_record(
    ground: Accelerogram, period: float, ratio: float, *, substeps: int, duration: float
) -> FilteredRecord:
    """Return −Ω² w of an oscillator on the ground, which is linear in parts of the record's steps.

    The samples are b − (h²/12) b'' at nodes with the distance h, so that the integral of their
    polygon differs from that of b by the order h⁴ at the nodes, and h³ between them.

    Args:
        ground: Ground acceleration from t = 0 on, without a sine, in m/s².
        period: Undamped natural period 2π/Ω, in s, positive.
        ratio: Damping ratio ζ, from 0 on and below 1.
        substeps: Number of parts of a step of the record.
        duration: Time in s up to which the response is needed.

    Raises:
        UnprovedError: The oscillator turns too far within a step of the record.
    """
    omega = 2 * np.pi / period
    sigma = omega * complex(-ratio, np.sqrt(1 - ratio**2))
    kappa = omega**2 / sigma.imag
    h = ground.step / substeps
    time = h * np.arange(ceil(duration / h) + 2, dtype=float)
    rho = responses_at_nodes(np.array([sigma]), ground, time)[0, :, 0]
    # Where the record begins or ends with a jump, a node has a value before and one behind it.
    behind = ground.values(time)
    before = ground.before(time)
    bend = kappa * (sigma**2 * rho).imag + omega**2 * behind
    excess = h**2 / 12 * bend  # of b over the samples
    samples = kappa * rho.imag - excess

    # D(t) = ∫₀ᵗ (b − c) dτ at the nodes, where ∫ b = κ Im((ρ − ∫ a) / σ).
    of_ground = _cumulated(h / 2 * (behind[:-1] + before[1:]))
    of_samples = _cumulated(h / 2 * (samples[:-1] + samples[1:]))
    integral = kappa * ((rho - of_ground) / sigma).imag - of_samples
    # Within a step D is a cubic polynomial, with D''' = b'' at its beginning, but for b''' h⁴/24 at
    # most. A polynomial is no larger than its Bernstein coefficients.
    start = integral[:-1]
    first = h * excess[:-1]
    second = h**2 / 2 * (kappa * (sigma * rho[:-1]).imag - np.diff(samples) / h)
    third = h**3 / 6 * bend[:-1]
    coefficients = [
        start,
        start + first / 3,
        start + 2 / 3 * first + second / 3,
        start + first + second + third,
    ]
    magnitude, slope = ground.extremes
    largest_rho = float(np.abs(rho).max()) + h * magnitude
    jerk = kappa * omega**2 * (omega * largest_rho + magnitude) + omega**2 * slope
    # Rounding matters here, since D is a small difference: that of ρ, some units for each interval
    # of the record, enters each term with powers of Ω h; sums of N numbers have N − 1 roundings.
    growth = kappa * np.exp(omega * h) / omega
    of_sums = h * (np.abs(samples).sum() + growth * (np.abs(behind) + np.abs(before)).sum())
    of_responses = (32 + 8 * len(ground.samples)) * growth * (largest_rho + magnitude * h)
    roundings = UNIT_ROUNDOFF * (len(time) * of_sums + of_responses)
    error = float(np.abs(coefficients).max()) + h**4 / 24 * jerk + roundings
    return FilteredRecord(Accelerogram(h, samples, name=ground.name), error * (1 + 1e-9))


def _cumulated(areas: Array) -> Array:
    """Return sums of areas up to each node, the first one 0, of shape (areas + 1,)."""
    return np.append(0.0, np.cumsum(areas))
