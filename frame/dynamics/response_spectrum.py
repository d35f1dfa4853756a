"""Response spectrum of a record: largest motion of one oscillator for each natural period.

The ground's acceleration is linear between samples, so the motion q̈ + 2 ζ ω q̇ + ω² q = −a(t) is
known exactly from node to node (Nigam and Jennings, Bull. Seism. Soc. Am. 59, 909, 1969). Here the
recurrence is one of a complex number, z = q̇ − λ̄ q with λ = −ζ ω + i ω √(1 − ζ²). Between nodes
the peak is that of the cubic through both ends' values and slopes; its error is bounded.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil, sqrt

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.numbers import require_number, require_numbers
from alphacut.frame.structures.linear import Accelerogram

TURN = 0.1
"""Largest phase ω h of a step, in rad."""
MOST = 5_000_000
"""Steps of one oscillator, at most."""


@dataclass(frozen=True, eq=False)
class ResponseSpectrum:
    """Largest displacements of oscillators relative to the ground, over their periods.

    Args:
        periods: Undamped natural periods, shape (P,), in s.
        damping: Ratio ζ of all of them.
        displacement: max |q|, shape (P,), in m.
        error: By how much it may be wrong, shape (P,), in m: a bound, to round-off.
    """

    periods: Array
    damping: float
    displacement: Array
    error: Array

    @property
    def omega(self) -> Array:
        """Angular frequencies, shape (P,), in rad/s."""
        return 2 * np.pi / self.periods

    @property
    def pseudo_velocity(self) -> Array:
        """ω max |q|, shape (P,), in m/s."""
        return self.omega * self.displacement

    @property
    def pseudo_acceleration(self) -> Array:
        """ω² max |q|, shape (P,), in m/s²."""
        return self.omega**2 * self.displacement


def response_spectrum(
    ground: Accelerogram, periods: Sequence[float] | Array, damping: float = 0.05
) -> ResponseSpectrum:
    """The spectrum of a record; oscillators start at rest and go on swinging after its end.

    Args:
        ground: The record.
        periods: Undamped natural periods, shape (P,), positive, in s.
        damping: Ratio ζ of all oscillators, 0 or greater and below 1.

    Raises:
        ValueError: A period is not positive, or so short that its steps are too many; or the ratio
            is out of range.
    """
    require_numbers("periods", periods, "s")
    require_number("damping", damping, "")
    wanted = np.asarray(periods, float).ravel()
    if not len(wanted) or not (wanted > 0).all():
        raise ValueError("periods: each must be greater than 0 s, and there must be one at least")
    if not 0 <= damping < 1:
        raise ValueError(
            f"damping: {damping:g} is not allowed; it must be 0 or greater and below 1"
        )
    found = np.array([_peak(ground, 2 * np.pi / period, damping) for period in wanted])
    return ResponseSpectrum(wanted, float(damping), found[:, 0], found[:, 1])


def _peak(ground: Accelerogram, omega: float, damping: float) -> tuple[float, float]:
    """Largest |q| of an oscillator and the bound of its error."""
    parts = max(1, ceil(omega * ground.step / TURN))
    h = ground.step / parts
    after = ceil(2 * np.pi / (omega * sqrt(1 - damping**2)) / h) + 1  # a period holds the peak
    count = (len(ground.acceleration) - 1) * parts
    if count + after > MOST:
        raise ValueError(
            f"periods: {2 * np.pi / omega:.3g} s needs {count + after:.2g} steps, above {MOST:.2g};"
            " take longer periods, or shorter ones than a hundred durations of the record"
        )
    first, last = _loads(np.asarray(ground.acceleration, float), parts, after)
    q, v = _motion(omega, damping, h, first, last)
    return _largest(q, v, h), _left_out(q, v, first, (last - first) / h, omega, damping, h)


def _loads(samples: Array, parts: int, after: int) -> tuple[Array, Array]:
    """Acceleration just after the beginning and just before the end of every step."""
    share = np.arange(parts) / parts
    rise = np.diff(samples)[:, None]
    first = (samples[:-1, None] + rise * share).ravel()
    last = (samples[:-1, None] + rise * (share + 1 / parts)).ravel()
    rest = np.zeros(after)
    return np.concatenate([first, rest]), np.concatenate([last, rest])


def _motion(
    omega: float, damping: float, h: float, first: Array, last: Array
) -> tuple[Array, Array]:
    """Motion q and q̇ at all nodes, each (T + 1,), from rest."""
    from scipy.signal import lfilter

    rate = omega * complex(-damping, sqrt(1 - damping**2))
    whole, ramp = _phi(rate * h)
    push = -h * ((whole - ramp) * first + ramp * last)
    z = np.concatenate([[0.0], lfilter([1.0], [1.0, -np.exp(rate * h)], push)])
    q = z.imag / rate.imag
    return q, z.real + rate.real * q


def _phi(x: complex) -> tuple[complex, complex]:
    """∫ exp(x (1 − s)) ds and ∫ exp(x (1 − s)) s ds over [0, 1], by their series: |x| is small."""
    whole, ramp, term = 0j, 0j, 1 + 0j
    for k in range(1, 20):  # x^(k−1) / k! and x^(k−1) / (k + 1)!
        term = term * (x if k > 1 else 1) / k
        whole, ramp = whole + term, ramp + term / (k + 1)
    return whole, ramp


def _largest(q: Array, v: Array, h: float) -> float:
    """Largest magnitude of the cubics through values and slopes of the nodes."""
    a, b, rise = h * v[:-1], h * v[1:], np.diff(q)
    # q(s) = q0 + a s + (3 rise − 2 a − b) s² + (a + b − 2 rise) s³ turns where its slope is 0:
    # twice in a step in which the ground stops the motion and drives it on
    square, cube = 3 * rise - 2 * a - b, a + b - 2 * rise
    root = np.sqrt(np.maximum(square**2 - 3 * cube * a, 0.0))
    both = -(square + np.copysign(root, square))
    top = float(np.abs(q).max())
    for over, under in ((a, both), (both, 3 * cube)):
        with np.errstate(over="ignore"):  # a root far outside the step
            s = np.divide(over, under, out=np.zeros_like(a), where=under != 0).clip(0.0, 1.0)
        top = max(top, float(np.abs(q[:-1] + s * (a + s * (square + s * cube))).max()))
    return top


def _left_out(
    q: Array, v: Array, load: Array, slope: Array, omega: float, damping: float, h: float
) -> float:
    """Bound of |q − its cubics|: h⁴ / 384 times the largest fourth derivative within the steps.

    Within a step a is linear, so the second derivative and those above swing freely, and what
    swings freely with damping stays below the energy that it begins with.
    """
    drag, square = 2 * damping * omega, omega**2
    second = -load - drag * v[:-1] - square * q[:-1]
    third = -slope - drag * second - square * v[:-1]
    fourth = -drag * third - square * second
    fifth = -drag * fourth - square * third
    return h**4 / 384 * float(np.hypot(fourth, fifth / omega).max())
