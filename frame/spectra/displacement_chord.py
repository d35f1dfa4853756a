"""Spectral displacement over an interval of periods, by a line in T², and largest acceleration."""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from alphacut.base.arrays import Array
from alphacut.frame.spectra.target import TargetSpectrum


class Chord(NamedTuple):
    """A line `value` + `slope` (T² − `midpoint`), and the bound `error` of the distance from it."""

    midpoint: float
    value: float
    slope: float
    error: float


def displacement_chord(spectrum: TargetSpectrum, low: float, high: float) -> Chord:
    """Return a line in T² that is close to the spectral displacement Sa T²/(4 π²).

    It is exact where the acceleration is constant and where the displacement is.
    Between corners of the spectrum 4 π² Sd is a polynomial of at most third degree, or the minimum
    of the spectrum times T², whichever is larger. The extremes of its distance from the line are
    found from the roots of derivatives.

    Args:
        spectrum: The spectrum, which falls at two corners T_C and T_D at most.
        low: Shortest period, in s, within the range of the spectrum.
        high: Longest period, not below `low` and within the same range.
    """
    scale = 1 / (4 * np.pi**2)
    ends = _pieces(spectrum, low, high)
    at_ends: Array = scale * spectrum(ends) * ends**2
    midpoint = (low**2 + high**2) / 2
    slope = 0.0
    if high > low:
        slope = float((at_ends[-1] - at_ends[0]) / (high**2 - low**2))
    line = Polynomial([0.0, 0.0, slope])

    smallest = np.inf
    largest = -np.inf
    for first, last in pairwise(map(float, ends)):
        before = [corner for corner in spectrum.falls_from if corner <= first]
        sides = np.interp([first, last], spectrum.periods, spectrum.accelerations)
        rise = (sides[1] - sides[0]) / (last - first) if last > first else 0.0
        power = Polynomial([0.0] * (2 - len(before)) + [scale * np.prod(before)])
        falling = Polynomial([sides[0] - rise * first, rise]) * power
        floor = Polynomial([0.0, 0.0, scale * spectrum.minimum])
        # The larger of two functions is at most the larger maximum, at least the larger minimum.
        ranges = [_range(curve - line, first, last) for curve in (falling, floor)]
        smallest = min(smallest, max(least for least, _ in ranges))
        largest = max(largest, max(most for _, most in ranges))
    # The line is moved to the middle of the distances. Their rounding is far below 1e-12 of the
    # largest term.
    rounding = 1e-12 * (float(at_ends.max()) + abs(slope) * high**2)
    return Chord(
        midpoint=midpoint,
        value=(smallest + largest) / 2 + slope * midpoint,
        slope=slope,
        error=(largest - smallest) / 2 + rounding,
    )


def max_acceleration(spectrum: TargetSpectrum, low: float, high: float) -> float:
    """Return an upper bound of the spectral acceleration over an interval of periods, in m/s².

    It is attained where the spectrum does not rise and fall by its branches at once.

    Args:
        spectrum: The spectrum.
        low: Shortest period, in s, within the range of the spectrum.
        high: Longest period, not below `low` and within the same range.
    """
    ends = _pieces(spectrum, low, high)
    linear = np.interp(ends, spectrum.periods, spectrum.accelerations)
    largest = np.maximum(linear[:-1], linear[1:])
    for corner in spectrum.falls_from:
        largest = largest * corner / np.maximum(ends[:-1], corner)
    return float(max(largest.max(), spectrum.minimum) * (1 + 1e-12))


def _pieces(spectrum: TargetSpectrum, low: float, high: float) -> Array:
    """Return both ends of an interval of periods and the corners of the spectrum between them."""
    corners = np.concatenate([spectrum.periods, spectrum.falls_from])
    inside = np.unique(corners[(corners > low) & (corners < high)])
    return np.concatenate([[low], inside, [high]])


def _range(curve: Polynomial, first: float, last: float) -> tuple[float, float]:
    """Return the smallest and the largest value of a polynomial on an interval."""
    roots = np.real(curve.deriv().roots())
    # The real part of a complex root is one more point of the interval, and does no harm.
    points = np.concatenate([[first, last], roots[(roots > first) & (roots < last)]])
    values = curve(points)
    return float(values.min()), float(values.max())
