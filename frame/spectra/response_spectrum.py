"""Response spectrum of a record, by the exact response of oscillators to piecewise linear loads."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number, require, require_numbers
from alphacut.frame.records.history import Accelerogram
from alphacut.frame.spectra.target import TargetSpectrum

Complex = NDArray[np.complex128]
READINGS = 40
"""Readings of the displacement in a period, n. A peak of u lies at most T/(2n) from a reading, and
u' = 0 there, so that ω² |u| is read too low by at most ω² (T/2n)²/2 max |u''| = π²/(2n²) max |u''|.
For n = 40 this is 0.31 % of the largest relative acceleration |u''|."""
MIN_PERIOD = 1e-3
"""Shortest period above 0, in s: the time rises as the step of the record over the period."""


def response_spectrum(
    ground: Accelerogram, periods: ArrayLike, damping: float = 0.05, *, readings: int = READINGS
) -> Array:
    """Return the spectral pseudo-acceleration Sa = ω² max |u| of a record at many periods.

    The displacement u of a linear oscillator relative to the ground follows from
    u'' + 2 ζ ω u' + ω² u = -a(t), from rest. It is computed exactly for the piecewise linear record
    a(t) (Nigam, Jennings 1969), and one period of free vibration after the record is included. The
    peak is read at 40 or more times a period and at the times of all samples. It is too low by at
    most 0.31 % of the largest relative acceleration |u''|. A response that is nearly a sine of the
    period has |u''| near Sa, so that this is 0.31 % of Sa. A short pulse under a long period has
    |u''| far above Sa: more readings are needed there.

    Args:
        ground: Ground acceleration a(t), of which the samples count alone.
        periods: Undamped natural periods 2π/ω, in s, in any order and shape. At the period 0 the
            spectrum is the largest ground acceleration.
        damping: Damping ratio ζ, from 0 to 0.999.
        readings: Least number n of readings in a period; the peak is too low by at most
            π²/(2n²) times the largest |u''|. With 0 it is read at the times of the samples alone,
            as by programs that step through the record.

    Returns:
        Sa in m/s², in the shape of the periods.

    Raises:
        RefusedError: A period is neither 0 nor from 0.001 s on, or another number is not as said.

    Example:
        >>> from alphacut.frame import Accelerogram, response_spectrum
        >>> pulse = Accelerogram(0.01, [0.0, 3.0, 0.0])
        >>> response_spectrum(pulse, [0.0, 0.1, 1.0]).round(2).tolist()
        [3.0, 1.69, 0.17]
    """
    ratio = checked_number("damping", damping, least=0, most=0.999)
    checked_number("readings", readings, least=0, whole=True)
    shaped = checked_periods(periods)
    oscillates = shaped != 0
    positive = shaped[oscillates]
    found = np.full(shaped.shape, ground.extremes[0])
    largest = np.zeros(len(positive))
    for k, values in _pseudo_accelerations(ground, positive, ratio, readings):
        largest[k] = max(largest[k], np.abs(values).max())
    found[oscillates] = largest
    return found


def record_spectrum(
    ground: Accelerogram, periods: ArrayLike, damping: float = 0.05, *, at_samples: bool = False
) -> TargetSpectrum:
    """Return the spectrum of a record for the response-spectrum method, linear between periods.

    Args:
        ground: Ground acceleration.
        periods: Rising natural periods in s, two or more, such as those of the modes.
        damping: Damping ratio ζ, from 0 to 0.999.
        at_samples: Whether peaks are those at the times of the samples, as many programs and
            textbooks take them. Else they are read 2,000 times a period, and are too low by at
            most 1.24e-6 of the largest relative acceleration (see `response_spectrum`).

    Returns:
        Pseudo-accelerations; the name says which kind of peaks they have.

    Raises:
        RefusedError: The periods do not rise or are fewer than two, or `response_spectrum` refuses
            a number.
    """
    peaks = "at all times"
    readings = 2000
    if at_samples:
        peaks = "at the record's instants"
        readings = 0
    return TargetSpectrum(
        np.asarray(periods, float),
        response_spectrum(ground, periods, damping, readings=readings),
        name=f"spectrum of {ground.name or 'a record'}, peaks {peaks}",
        clause=f"samples every {ground.step:g} s",
        damping=damping,
    )


def checked_periods(periods: ArrayLike, key: str = "periods") -> Array:
    """Return periods as an array; raises RefusedError if one is neither 0 nor from 0.001 s on."""
    require_numbers(key, np.asarray(periods))
    shaped = np.asarray(periods, float)
    smallest = shaped[shaped != 0].min(initial=np.inf)
    allowed = f"0 s, and periods from {MIN_PERIOD:g} s on"
    require(smallest >= MIN_PERIOD, key, f"{smallest:g} s", allowed)
    return shaped


class RotatedSpectra(NamedTuple):
    """Median and largest value of a spectrum over all directions, in m/s², by the period.

    Args:
        rotd50: RotD50, the median over the directions.
        rotd100: RotD100, the largest value of them.
    """

    rotd50: Array
    rotd100: Array


def rotated_spectra(
    first: Accelerogram, second: Accelerogram, periods: ArrayLike, damping: float = 0.05
) -> RotatedSpectra:
    """Return the spectra RotD50 and RotD100 of two horizontal components (Boore 2010).

    At each period they are the median and the largest value of the spectral pseudo-acceleration
    of the record a₁ cos θ + a₂ sin θ over the 180 directions θ = 0°, 1°, … 179°.

    Args:
        first: The component a₁.
        second: The component a₂, at right angles to the first, with as many samples at the same
            times.
        periods: Undamped natural periods, in s, as of `response_spectrum`.
        damping: Damping ratio ζ, from 0 to 0.999.

    Returns:
        `rotd50` and `rotd100` in m/s², each in the shape of the periods.

    Raises:
        RefusedError: The components differ in their times, a period is neither 0 nor from 0.001 s
            on, or the damping ratio is not such a number.

    Example:
        >>> from alphacut.frame import Accelerogram, rotated_spectra
        >>> pulse = Accelerogram(0.01, [0.0, 3.0, 0.0])
        >>> still = Accelerogram(0.01, [0.0, 0.0, 0.0])
        >>> found = rotated_spectra(pulse, still, [0.0, 0.1])
        >>> found.rotd100.round(2).tolist(), found.rotd50.round(2).tolist()
        ([3.0, 1.69], [2.12, 1.19])
    """
    ratio = checked_number("damping", damping, least=0, most=0.999)
    first.require_times_of(second)
    shaped = checked_periods(periods)
    flat = shaped.ravel()
    directions = np.radians(np.arange(180))
    turns = np.column_stack([np.cos(directions), np.sin(directions)])

    def peaks_by_direction(of_first: Array, of_second: Array) -> Array:
        return np.asarray(np.abs(turns @ np.stack([of_first, of_second])).max(axis=1))

    # The response is linear in the record, so that those to the components are turned.
    ground_peaks = peaks_by_direction(first.samples, second.samples)
    oscillating = np.flatnonzero(flat)
    largest = np.where(flat[:, np.newaxis] == 0, ground_peaks, 0.0)  # (periods, directions)
    both = (_pseudo_accelerations(ground, flat[oscillating], ratio) for ground in (first, second))
    for of_first, of_second in zip(*both, strict=True):
        row = largest[oscillating[of_first.oscillator]]
        np.maximum(row, peaks_by_direction(of_first.values, of_second.values), out=row)
    return RotatedSpectra(
        rotd50=np.median(largest, axis=1).reshape(shaped.shape),
        rotd100=largest.max(axis=1).reshape(shaped.shape),
    )


def spectral_acceleration(ground: Accelerogram, period: float, ratio: float) -> float:
    """Return the spectral pseudo-acceleration of a record at one period, in m/s².

    It is that of `response_spectrum`.

    Args:
        ground: Ground acceleration.
        period: Undamped natural period, in s, positive.
        ratio: Damping ratio, from 0 to 0.999.

    Raises:
        RefusedError: The period is not a positive, finite number, or the damping ratio is not such
            a number.
    """
    checked_number("period", period, positive=True)
    return float(response_spectrum(ground, period, ratio))


class _Advance(NamedTuple):
    """How the states y of oscillators advance by a time τ within a step h of the record.

    y(t + τ) = `decay` y(t) - `constant` a - `ramp` Δa, where a is the sample of the record at t and
    Δa the difference of the next sample from it. Each field has the shape of the oscillators.
    """

    decay: Complex
    constant: Complex
    ramp: Complex

    @classmethod
    def of(cls, roots: Complex, time: float, step: float) -> _Advance:
        """Return the coefficients after positive times τ, in the shape of `roots * time`.

        With the roots λ of the oscillators and z = λ τ they are exp(z), τ φ1 and (τ²/h) φ2, where
        φ1 = (exp(z) - 1)/z and φ2 = (φ1 - 1)/z. The difference φ1 - 1 cancels to some 1e-16/|z|,
        which is 1e-11 for a period of 1000 s and steps of 0.005 s.
        """
        z = roots * time
        first = np.expm1(z) / z
        ramp = time**2 / step * (first - 1) / z
        return cls(np.exp(z), time * first, ramp)


class _Readings(NamedTuple):
    """Values of ω² u of one oscillator of several, at one time in each step of a record."""

    oscillator: int
    values: Array  # (steps,)


def _pseudo_accelerations(
    ground: Accelerogram, periods: Array, ratio: float, readings: int = READINGS
) -> Iterator[_Readings]:
    """Yield ω² u of oscillators with positive periods, at samples and `readings` times a period.

    Oscillators and times follow in an order that depends on the step and the length of the record,
    the periods and the ratio alone.

    With the root λ = ω (-ζ + i √(1 - ζ²)) of the characteristic polynomial and its conjugate λ*,
    y = u' - λ* u satisfies y' = λ y - a(t), and u = Im y / Im λ.
    """
    omega = 2 * pi / periods
    roots: Complex = np.asarray(omega * complex(-ratio, sqrt(1 - ratio**2)), complex)
    step = ground.step
    # After the last sample the load is zero for one period, as |u| may be largest there.
    zeros = np.zeros(int(np.ceil(periods.max(initial=0.0) / step)))
    starts = np.append(ground.samples[:-1], zeros)
    differences = np.append(np.diff(ground.samples), zeros)
    # States y at the beginning of each step, shape (steps, oscillators).
    whole = _Advance.of(roots, step, step)
    loads = np.outer(starts, whole.constant) + np.outer(differences, whole.ramp)
    states = np.zeros_like(loads)
    for k in range(len(starts) - 1):
        states[k + 1] = whole.decay * states[k] - loads[k]

    scale = omega**2 / roots.imag
    for k, period in enumerate(periods):
        substeps = max(1, int(np.ceil(readings * step / period)))
        for j in range(1, substeps + 1):
            part = _Advance.of(roots[[k]], j / substeps * step, step)
            inside = part.decay * states[:, k] - part.constant * starts - part.ramp * differences
            yield _Readings(k, scale[k] * inside.imag)
