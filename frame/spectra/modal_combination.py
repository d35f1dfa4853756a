"""Combination of the peaks of modes, which are reached at different times, to the peak of a sum."""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array

COMBINATIONS = {
    "SRSS": "square root of the sum of squares",
    "CQC": "complete quadratic combination",
}
"""Rules of combination, by their names in the literature."""


def correlation(frequencies: Array, ratios: Array) -> Array:
    """Return the correlation coefficients ρ of modes for CQC (Der Kiureghian 1981).

    They are those of the responses of two oscillators to white noise. With x = ln(ω_i/ω_j) they are

        ρ = 2 √(ζ_i ζ_j) (ζ_i exp(x/2) + ζ_j exp(−x/2))
            / (sinh² x + 2 ζ_i ζ_j cosh x + ζ_i² + ζ_j²),

    which is the common form in ω_i/ω_j with numerator and denominator divided by 4 (ω_i/ω_j)².

    Args:
        frequencies: Angular frequencies ω, positive, shape (…, modes).
        ratios: Damping ratios ζ, positive, shape (…, modes).

    Returns:
        Symmetric matrices of shape (…, modes, modes), with ones on the diagonal.
    """
    logarithms = np.log(frequencies)
    x = logarithms[..., :, np.newaxis] - logarithms[..., np.newaxis, :]
    first = ratios[..., :, np.newaxis]
    second = ratios[..., np.newaxis, :]
    numerator = 2 * np.sqrt(first * second) * (first * np.exp(x / 2) + second * np.exp(-x / 2))
    denominator = np.sinh(x) ** 2 + 2 * first * second * np.cosh(x) + first**2 + second**2
    return np.asarray(numerator / denominator)


def combined_peaks(peaks: Array, correlations: Array) -> Array:
    """Return √(Σ_ij ρ_ij r_i r_j) of modal peaks r.

    Args:
        peaks: Peaks of the outputs by mode, with their signs, shape (…, modes, outputs).
        correlations: ρ, symmetric and not indefinite but for rounding, shape (…, modes, modes);
            the identity for SRSS.

    Returns:
        Combined peaks, not negative, shape (…, outputs).
    """
    squares = np.sum(peaks * (correlations @ peaks), axis=-2)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def correlation_range(
    periods: tuple[Array, Array], ratios: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return bounds of the `correlation` of modes whose periods and damping ratios have ranges.

    Args:
        periods: Lower and upper ends of natural periods, positive, shape (modes,) each. The first
            mode is known to have the longest period, and so on; the ranges may overlap.
        ratios: Lower and upper ends of damping ratios, positive, shape (modes,) each.

    Returns:
        Bounds of ρ, from 0 to 1, shape (modes, modes) each; valid above the diagonal alone.
    """
    # x = ln(T_i/T_j) is not negative for i < j. Numerator and denominator rise with ζ, the
    # denominator with x, and of the numerator mode i's term falls with x and mode j's rises. All
    # are widened by far more than their rounding.
    low, high = np.log(periods[0]), np.log(periods[1])
    x_low = np.maximum(low[:, np.newaxis] - high - 1e-14, 0.0)
    x_high = np.maximum(high[:, np.newaxis] - low + 1e-14, 0.0)
    numerators = []
    denominators = []
    for second, x, x_opposite in ((ratios[0], x_low, x_high), (ratios[1], x_high, x_low)):
        first = second[:, np.newaxis]
        terms = first * np.exp(-x_opposite / 2) + second * np.exp(x / 2)
        numerators.append(2 * np.sqrt(first * second) * terms)
        squares = first**2 + second**2
        denominators.append(np.sinh(x) ** 2 + 2 * first * second * np.cosh(x) + squares)
    smallest = numerators[0] / denominators[1] * (1 - 1e-12)
    largest = numerators[1] / denominators[0] * (1 + 1e-12)
    return np.asarray(smallest), np.asarray(np.minimum(largest, 1.0))
