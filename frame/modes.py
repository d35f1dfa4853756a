"""Complex modes of linear structures with analytic first and second derivatives: q(t; p) = 2 Re Σ C_k(p) exp(λ_k(p) t)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from frame.integrators import state_matrix
from frame.jet import Jet, concatenate, inverse
from frame.linear import Matrices


class ModalError(RuntimeError):
    """The structure has no smooth set of oscillating modes over the box."""


@dataclass(frozen=True, eq=False)
class Modes:
    """Intervening variables of a structure (paper, section 7): smooth in the parameters, free of oscillation.

    Args:
        eigenvalue: λ_k with Im λ_k > 0, rising, complex jet, V = (S, n), in 1/s.
        coefficient: C_k, what the initial state puts into the outputs, V = (S, n, m).
        load: The same for a unit impulse of the ground's acceleration, V = (S, n, m).
    """

    eigenvalue: Jet
    coefficient: Jet
    load: Jet


def modes(matrices: Matrices, rows: Jet) -> Modes:
    """Eigen-analyses at S parameter sets.

    Args:
        matrices: The structure.
        rows: Observation rows, V = (S, m, 2n).

    Raises:
        ModalError: A mode does not oscillate (overdamped or free to drift).
    """
    values, X, Y = _eigen(state_matrix(matrices))
    n = values.value.shape[-1] // 2
    start = concatenate([matrices.q0, matrices.v0], -2)
    kick = np.zeros((2 * n, 1))
    kick[n:] = -matrices.rigid
    seen = (rows @ X)[..., :n]  # V = (S, m, n)

    def through(excitation: Jet) -> Jet:
        share = (Y @ excitation)[..., :n, 0][..., None, :]
        return (seen * share).map(lambda x: x.swapaxes(-1, -2))

    return Modes(values[..., :n], through(start), (seen * (Y @ kick)[..., :n, 0][..., None, :]).map(lambda x: x.swapaxes(-1, -2)))


def _eigen(A: Jet) -> tuple[Jet, Jet, Jet]:
    """Eigenvalues (upper half plane first, rising), right and left vectors of V = (S, 2n, 2n).

    With X(p) = X(p0) Z(p), Z(p0) = I and diag Z = I, second-order perturbation in the eigenbasis gives all derivatives.
    """
    values, X = np.linalg.eig(A.value)
    order = np.lexsort((values.imag, values.imag < 0), axis=-1)
    values, X = np.take_along_axis(values, order, -1), np.take_along_axis(X, order[:, None, :], -1)
    n = values.shape[-1] // 2
    if (values[:, :n].imag <= 1e-9 * np.abs(values[:, :n])).any() or (values[:, n:].imag >= 0).any():
        raise ModalError(
            "a mode does not oscillate: modal intervening variables need damping below critical in every mode; use graph-follower"
        )
    Y = np.linalg.inv(X)
    gap = values[:, None, :] - values[:, :, None]
    off = ~np.eye(2 * n, dtype=bool)
    weight = np.where(off, 1 / np.where(off & (gap != 0), gap, 1.0), 0.0)
    G1, G2 = Y @ A.first @ X, Y @ A.second @ X
    slope = np.einsum("...kk->...k", G1)
    Z1 = G1 * weight
    pair = G1[:, None] @ Z1[None, :] - Z1[:, None] * slope[None, :, :, None, :]
    second = G2 + pair + pair.swapaxes(0, 1)
    Z2 = second * weight
    eye = np.broadcast_to(np.eye(2 * n), Z1.shape[1:])
    right = X @ Jet(eye, Z1, Z2)
    return Jet(values, slope, np.einsum("...kk->...k", second)), right, inverse(right)
