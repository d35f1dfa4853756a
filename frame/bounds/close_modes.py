"""Bounds of the squared combined peak of a group of close modes, by what does not turn with them.

Let r_k be the peaks of p modes, s = Σ r_k, and w a bound of W = Σ |r_k|. The square of the combined
peak is s² − Σ_{i≠j} d_ij r_i r_j with d_ij = 1 − ρ_ij; SRSS has d_ij = 1.

`by_signs` uses 0 ≤ d_ij ≤ d alone. The positive peaks sum up to (W + s)/2 and the negative ones to
(W − s)/2 in magnitude, and Σ r_k² ≥ W²/p. Hence

    Σ_{i≠j} d_ij r_i r_j ≥ −d (W² − s²)/2           by pairs of opposite signs,
    Σ_{i≠j} d_ij r_i r_j ≤ d ((W² + s²)/2 − W²/p)   by pairs of equal signs,

and with w in the place of W for p ≥ 2.

`by_fit` uses d_ij = κ (y_i − y_j)² ± e with y = T²/midpoint − 1. Then

    Σ_{i≠j} d_ij r_i r_j = 2 κ (s Σ y_k² r_k − (Σ y_k r_k)²) ± e (w² − w²/p),

whose sums are functions of the eigenvalues in the subspace of the modes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.mode_groups import Subspace
from alphacut.frame.spectra.modal_combination import QuadraticFit


class Squares(NamedTuple):
    """Taylor models that are nowhere above and nowhere below the squared combined peaks, (m,)."""

    lower: TaylorModel
    upper: TaylorModel

    @property
    def width(self) -> Array:
        """Distance of both bounds over the box, shape (m,)."""
        return np.asarray(self.upper.bounds()[1] - self.lower.bounds()[0])


class Moments(NamedTuple):
    """Sums of the peaks of a group of modes with powers of y = T²/midpoint − 1, shape (m,) each."""

    first: TaylorModel  # Σ y r
    second: TaylorModel  # Σ y² r


def by_signs(total: TaylorModel, magnitudes: TaylorModel, *, modes: int, d: float) -> Squares:
    """Return bounds of the squares by 0 ≤ d_ij ≤ d.

    Args:
        total: s, shape (m,).
        magnitudes: w², shape (m,).
        modes: Number p of the modes, 2 or more.
        d: Largest d_ij.
    """
    square = total * total
    half = d / 2
    return Squares(
        square * (1 - half) - magnitudes * (half * (1 - 2 / modes)),
        square * (1 - half) + magnitudes * half,
    )


def by_fit(
    total: TaylorModel,
    moments: Moments,
    magnitudes: TaylorModel,
    *,
    modes: int,
    fit: QuadraticFit,
) -> Squares:
    """Return bounds of the squares by d_ij = κ (y_i − y_j)² ± e.

    Args:
        total: s, shape (m,).
        moments: Σ y r and Σ y² r.
        magnitudes: w², shape (m,).
        modes: Number p of the modes, 2 or more.
        fit: κ and e.
    """
    spread = total * moments.second - moments.first * moments.first
    error = fit.error * (1 - 1 / modes) * magnitudes.magnitude()
    centre = total * total - spread * (2 * fit.factor)
    return Squares(centre.widened(error), centre.widened(error))


def moments_of(
    subspace: Subspace,
    midpoint: float,
    displacement: tuple[float, float],
    *,
    magnitude: Array,
    largest: float,
) -> Moments:
    """Return Σ y r and Σ y² r over the modes of a subspace, for m outputs.

    Args:
        subspace: That of the modes.
        midpoint: The midpoint in y = T²/midpoint − 1, in s².
        displacement: Smallest and largest spectral displacement of the modes, in m.
        magnitude: Bound of Σ |r_k| of peaks under a unit displacement, shape (m,).
        largest: Bound of |y|.
    """
    p = len(subspace.participation.remainder)
    # y of the subspace, from T² = 4 π²/λ
    y = subspace.inverse_eigenvalues * (4 * np.pi**2 / midpoint) - np.eye(p)
    weighted = y @ subspace.participation[:, None]
    low, high = displacement
    middle = (low + high) / 2
    # Peaks are those under the middle of the displacements, and differ by their radius at most.
    error = (high - low) / 2 * magnitude
    outputs = subspace.output_modes.T
    first = (outputs @ weighted)[:, 0] * middle
    second = (outputs @ (y @ weighted))[:, 0] * middle
    return Moments(first.widened(error * largest), second.widened(error * largest**2))
