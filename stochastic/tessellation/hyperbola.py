"""Wall between two discs: a hyperbola in polar form, with its exact sector area.

Points as far from disc i as from disc j lie on ρ(ψ) = 1/(C + M cos ψ), ψ the angle at the centre of
i from the direction of j,
    M = 2d/(d² − Δ²),  C = −2Δ/(d² − Δ²),  d the distance of the centres, Δ = r_i − r_j, |Δ| < d.
With the hyperbolic anomaly s, tan(ψ/2) = √((M + C)/(M − C)) tanh(s/2), the radius is ρ = (M cosh s
− C)/κ², κ² = M² − C², and ½ ∫ ρ² dψ = (M sinh s − C s)/(2κ³): Kepler's law of areas for the unbound
orbit. Written in middle and half width of s, every term is positive, so that nothing cancels for
slender sectors, nearly hidden discs or centres next to a wall.
"""

from __future__ import annotations

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array


def anomaly(psi: Array, near: Array, far: Array) -> Array:
    """Hyperbolic anomaly s of the angle ψ.

    Args:
        psi: Angle from the direction of the neighbour, shape (m,), brought to [−π, π] here.
        near: d + Δ, twice the least distance of the wall from the centre, shape (m,).
        far: d − Δ, shape (m,).
    """
    psi = psi - 2 * np.pi * np.round(psi / (2 * np.pi))
    return np.asarray(
        2 * np.arctanh(np.clip(np.sqrt(near / far) * np.tan(psi / 2), -1 + 2**-53, 1 - 2**-53))
    )


def sector_area(start: Array, end: Array, near: Array, far: Array) -> Array:
    """Area between the centre and the wall from anomaly `start` to `end`, shape (m,)."""
    middle, half = (start + end) / 2, (end - start) / 2
    sum_, difference = 2 / near, 2 / far  # M + C, M − C
    bulge = 2 * np.sinh(middle / 2) ** 2 * np.sinh(half) + _sinh_less_argument(half)
    return np.asarray(
        ((sum_ + difference) / 2 * bulge + difference * half) / (sum_ * difference) ** 1.5
    )


def _sinh_less_argument(x: Array) -> Array:
    """Sinh x − x to full relative precision."""
    square, series = x * x, np.ones_like(x)
    for k in range(9, 0, -1):
        series = 1 + series * square / ((2 * k + 2) * (2 * k + 3))
    return np.where(np.abs(x) < 1, x * square / 6 * series, np.sinh(x) - x)
