"""Classical damping: a real symmetric eigenproblem of half the size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.structures.linear import Matrices

COUPLED = 1e-11
"""Largest entry that couples two undamped modes through the damping, over the largest that does
not, taken for round-off.
"""


@dataclass(frozen=True, eq=False)
class ClassicalModes:
    """Outputs Re Σ_k C_k w_k(t), w_k = exp(λ_k t) or its convolution with the load.

    Args:
        rate: λ_k with Im λ_k > 0, shape (S, n), in 1/s.
        start: C_k of the initial state, shape (S, n, m).
        load: C_k of the ground's acceleration, shape (S, n, m).
    """

    rate: Array
    start: Array
    load: Array


def classical_modes(matrices: Matrices, rows: Jet) -> ClassicalModes | None:
    """Modes at S parameter sets, values alone; None where damping couples them.

    Args:
        matrices: The structure.
        rows: Observation rows, V = (S, m, 2n).
    """
    M, D, K = matrices.mass.value, matrices.damping.value, matrices.stiffness.value
    below = np.linalg.inv(np.linalg.cholesky(M))
    above = below.swapaxes(-1, -2)
    squared, U = np.linalg.eigh(below @ K @ above)
    shape = above @ U  # Φ with Φᵀ M Φ = I
    damping = shape.swapaxes(-1, -2) @ D @ shape
    own = np.einsum("skk->sk", damping)
    coupled = np.abs(damping - own[:, None] * np.eye(own.shape[-1])).max()
    oscillation = squared - own**2 / 4
    if coupled > COUPLED * np.abs(own).max() or not (oscillation > 1e-6 * np.abs(squared)).all():
        return None
    fall, turn = -own / 2, np.sqrt(oscillation)
    rate = fall + 1j * turn
    n = squared.shape[-1]
    seen = ((rows.value[..., :n] @ shape) + (rows.value[..., n:] @ shape) * rate[:, None]).swapaxes(
        -1, -2
    )
    onto = shape.swapaxes(-1, -2) @ M
    x, v = (onto @ matrices.q0.value)[..., 0], (onto @ matrices.v0.value)[..., 0]
    start = seen * (x - 1j * (v - fall * x) / turn)[..., None]
    load = seen * (1j * (onto @ matrices.rigid)[..., 0] / turn)[..., None]  # −Γ_k Im(w_k) / ω_k
    return ClassicalModes(rate, start, load)
