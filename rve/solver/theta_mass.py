"""Mass matrices along θ, weighted with f_Θ: hats on the levels, bubbles between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array, TruncatedNormal


@dataclass(frozen=True)
class ThetaMass:
    """Inverse mass matrices of the two one-dimensional spaces inside a serendipity wedge.

    Edge midpoints carry piecewise linear functions of θ, vertices piecewise quadratic ones.

    Args:
        linear: Inverse mass matrix of the hats, shape (layers + 1, layers + 1).
        excess: Inverse mass matrix of hats and bubbles less `linear` padded with zeros, positive
            semidefinite, shape (2·layers + 1, 2·layers + 1), hats before bubbles.
    """

    linear: Array
    excess: Array


def theta_mass(law: TruncatedNormal, levels: Array) -> ThetaMass:
    """The mass matrices on the given levels, shape (layers + 1,)."""
    layers = len(levels) - 1
    abscissae, double = np.polynomial.legendre.leggauss(3)  # as the stiffness is integrated
    t, w = (abscissae + 1) / 2, double / 2
    shapes = np.array([1 - t, t, 4 * t * (1 - t)])
    theta = levels[:-1, None] + np.diff(levels)[:, None] * t
    local = np.einsum(
        "lq,iq,jq->lij", w * np.diff(levels)[:, None] * law.pdf(theta), shapes, shapes
    )
    number = np.stack(
        [np.arange(layers), np.arange(1, layers + 1), layers + 1 + np.arange(layers)], axis=1
    )
    mass = np.zeros((2 * layers + 1, 2 * layers + 1))
    np.add.at(mass, (number[:, :, None], number[:, None, :]), local)
    linear = np.linalg.inv(mass[: layers + 1, : layers + 1])
    excess = np.linalg.inv(mass)
    excess[: layers + 1, : layers + 1] -= linear
    return ThetaMass(linear, (excess + excess.T) / 2)
