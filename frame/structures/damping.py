"""Modal damping: D = M Φ diag(2 ζ_k ω_k) Φᵀ M, for modes Φ of M and K with Φᵀ M Φ = I.

D follows the parameters through the modes, with first and second derivatives; it is not frozen at
their modal values. With one ratio for all modes D = 2 ζ M √(M⁻¹K), which is smooth however the
frequencies lie. With a ratio for each mode D is smooth only while modes of different ratio keep
their frequencies apart.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, inverse
from alphacut.frame.structures.modes import eigenvectors
from alphacut.fuzzy.refused import RefusedError

APART = 1e-6
"""Least relative distance of the squared frequencies of modes with different ratios."""


def modal_damping(mass: Jet, stiffness: Jet, ratios: Sequence[Jet]) -> Jet:
    """D at S parameter sets, V = (S, n, n), in N s/m.

    Args:
        mass: M, symmetric and positive definite, V = (S, n, n), in kg.
        stiffness: K, symmetric and positive definite, V = (S, n, n), in N/m.
        ratios: ζ_k, each V = (S,): one for all modes, or n of them, for the modes by rising
            frequency.

    Raises:
        RefusedError: A stiffness is not positive definite, or two modes of different ratios have
            the same frequency.
    """
    operator = inverse(mass) @ stiffness
    if len(ratios) == 1:
        return 2.0 * ratios[0][:, None, None] * (mass @ square_root(operator, mass.value))
    squared, X, Y = eigenvectors(operator)
    _check(squared.value, np.stack([zeta.value for zeta in ratios], -1))
    omega = squared**0.5
    parts = [
        2.0 * (zeta * omega[:, k])[:, None, None] * (X[:, :, k : k + 1] @ Y[:, k : k + 1, :])
        for k, zeta in enumerate(ratios)
    ]
    return mass @ sum(parts[1:], parts[0])


def square_root(operator: Jet, mass: Array) -> Jet:
    """R with R R = A for A = M⁻¹K, V = (S, n, n), and its derivatives.

    Args:
        operator: A, self-adjoint and positive definite in the scalar product of M.
        mass: M, shape (S, n, n).

    Raises:
        RefusedError: A is not positive definite.
    """
    lower = np.linalg.cholesky(mass)
    below = np.linalg.inv(lower)
    squared, U = np.linalg.eigh(below @ (mass @ operator.value) @ below.swapaxes(-1, -2))
    _check(squared, np.zeros_like(squared))
    omega = np.sqrt(squared)
    X = below.swapaxes(-1, -2) @ U
    Y = U.swapaxes(-1, -2) @ lower.swapaxes(-1, -2)
    total = omega[:, :, None] + omega[:, None, :]

    def solved(right: Array) -> Array:
        return np.asarray(X @ ((Y @ right @ X) / total) @ Y)

    first, value = solved(operator.first), (X * omega[:, None, :]) @ Y
    if not len(operator.second):
        return Jet(value, first, np.zeros((0, 0, *value.shape)))
    pair = first[:, None] @ first[None, :]
    return Jet(value, first, solved(operator.second - pair - pair.swapaxes(0, 1)))


def _check(squared: Array, ratios: Array) -> None:
    if not (share := (squared / abs(squared).max(-1, keepdims=True)).min()) > 1e-12:
        cure = "give dampers, or join storeys that are too stiff"
        what = f"{share:.1e} of the greatest"
        raise RefusedError(
            "squared frequency of a damped mode", what, "above rounding, 1e-12", cure
        )
    close = (np.diff(squared) < APART * squared[:, 1:]) & (np.diff(ratios) != 0)
    if close.any():
        k = int(np.flatnonzero(close.any(0))[0]) + 1
        what = f"different for modes {k} and {k + 1}, which have the same frequency"
        raise RefusedError("damping ratio", what, "one ratio for both")
