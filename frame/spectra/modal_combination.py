"""Combination of the peaks of modes, which are reached at different times, to the peak of a sum."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.frame.spectra.target import TargetSpectrum

Ends = tuple[Array, Array] | tuple[float, float]
"""Lower and upper ends."""
COMBINATIONS = {
    "SRSS": "square root of the sum of squares",
    "CQC": "complete quadratic combination",
}
"""Rules of combination, by their names in the literature."""


@dataclass(frozen=True, eq=False)
class SpectralModes:
    """The lowest K modes of a structure at S parameter sets, for m outputs.

    Args:
        omega: Angular frequencies ω in rad/s, rising, shape (S, K).
        ratios: Damping ratios φᵀ D φ / (2 ω), with φᵀ M φ = 1, shape (S, K).
        mass_fractions: Effective masses over the mass that moves with the ground, shape (S, K).
        factors: Participation factor φᵀ M ι times the output of the mode shape, shape (S, K, m).
            Times the spectral displacement it is the peak of the output by this mode.
    """

    omega: Array
    ratios: Array
    mass_fractions: Array
    factors: Array

    @property
    def periods(self) -> Array:
        """Natural periods in s, shape (S, K)."""
        return np.asarray(2 * np.pi / self.omega)

    def peaks(self, accelerations: Array) -> Array:
        """Return the peaks of the outputs by each mode, with their signs, shape (S, K, m).

        Args:
            accelerations: Spectral pseudo-acceleration of each mode, in m/s², shape (S, K).
        """
        displacements = accelerations / self.omega**2
        return np.asarray(self.factors * displacements[..., np.newaxis])


@dataclass(frozen=True)
class Combination:
    """What is combined: the spectrum, the rule, and the number of modes.

    Args:
        spectrum: Pseudo-acceleration over the period.
        rule: "SRSS" or "CQC".
        modes: Number of the lowest modes that are combined; None for all.
        own_ratios: Whether CQC takes the damping ratio of each mode; else that of the spectrum.
    """

    spectrum: TargetSpectrum
    rule: str
    modes: int | None
    own_ratios: bool

    def combined(self, modes: SpectralModes, accelerations: Array | None = None) -> Array:
        """Return the combined peaks of the outputs, shape (S, m).

        Args:
            modes: The modes.
            accelerations: Spectral accelerations of the modes in place of those of the spectrum, in
                m/s², shape (S, K).

        Raises:
            RefusedError: A period lies outside the range of the spectrum, or CQC is to take the
                damping ratio of a mode that has none.
        """
        correlations = np.eye(modes.omega.shape[1])
        if self.rule == "CQC":
            ratios = np.full_like(modes.ratios, self.spectrum.damping)
            if self.own_ratios:
                ratios = modes.ratios
            allowed = "above 0 for CQC, as two modes without damping are correlated in no way"
            require(bool((ratios > 0).all()), "damping ratio", f"{ratios.min():g}", allowed)
            correlations = correlation(modes.omega, ratios)
        if accelerations is None:
            accelerations = self.spectrum(modes.periods)
        return combined_peaks(modes.peaks(accelerations), correlations)


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
    low, high = np.log(periods[0]), np.log(periods[1])
    x_low = np.maximum(low[:, np.newaxis] - high - 1e-14, 0.0)
    x_high = np.maximum(high[:, np.newaxis] - low + 1e-14, 0.0)
    first = (ratios[0][:, np.newaxis], ratios[1][:, np.newaxis])
    return _correlation_over(x_low, x_high, first, ratios)


class QuadraticFit(NamedTuple):
    """A quadratic function `factor` z², and the bound `error` of the distance from it."""

    factor: float
    error: float


def decorrelation_fit(
    periods: tuple[float, float], ratios: tuple[float, float], midpoint: float
) -> QuadraticFit:
    """Return a quadratic function that is close to 1 − ρ_ij over a range of periods.

    Its argument is z = (T_i² − T_j²)/`midpoint`.

    Args:
        periods: Shortest and longest period T of both modes, in s, positive.
        ratios: Smallest and largest damping ratio of both, positive.
        midpoint: Any positive number, in s².
    """
    shortest, longest = periods
    # Cells of x = ln(T_i/T_j), T_i not below T_j: 200 of them make the error some 1 % too large.
    edges = np.linspace(0.0, np.log(longest / shortest) + 1e-14, 201)
    x_low = edges[:-1]
    x_high = edges[1:]
    smallest, largest = _correlation_over(x_low, x_high, ratios, ratios)
    # T_i² − T_j² = T_j² (exp(2 x) − 1) = T_i² (1 − exp(−2 x))
    z_low = shortest**2 * np.expm1(2 * x_low) / midpoint * (1 - 1e-12)
    z_high = longest**2 * -np.expm1(-2 * x_high) / midpoint * (1 + 1e-12)
    # Any factor will do. 1 − ρ rises less than quadratically, so that the best one is above that
    # of the last cell.
    factors = (1 - smallest[-1]) / max(z_high[-1], 1e-6) ** 2 * np.linspace(0.7, 3.0, 47)
    above = (1 - smallest) - factors[:, np.newaxis] * z_low**2
    below = factors[:, np.newaxis] * z_high**2 - (1 - largest)
    errors = np.maximum(above, below).max(axis=1) * (1 + 1e-9) + 1e-14
    best = int(errors.argmin())
    return QuadraticFit(float(factors[best]), float(errors[best]))


def _correlation_over(
    x_low: Array, x_high: Array, first_ratios: Ends, second_ratios: Ends
) -> tuple[Array, Array]:
    """Return bounds of ρ over ranges of x = ln(T_i/T_j) ≥ 0 and of the damping ratios of i and j.

    All arrays are broadcast; the ratios are lower and upper ends.
    """
    # Numerator and denominator rise with ζ, the denominator with x, and of the numerator mode i's
    # term falls with x and mode j's rises. All are widened by far more than their rounding.
    numerators = []
    denominators = []
    for first, second, x, x_opposite in (
        (first_ratios[0], second_ratios[0], x_low, x_high),
        (first_ratios[1], second_ratios[1], x_high, x_low),
    ):
        terms = first * np.exp(-x_opposite / 2) + second * np.exp(x / 2)
        numerators.append(2 * np.sqrt(first * second) * terms)
        squares = first**2 + second**2
        denominators.append(np.sinh(x) ** 2 + 2 * first * second * np.cosh(x) + squares)
    smallest = numerators[0] / denominators[1] * (1 - 1e-12)
    largest = numerators[1] / denominators[0] * (1 + 1e-12)
    return np.asarray(smallest), np.asarray(np.minimum(largest, 1.0))
