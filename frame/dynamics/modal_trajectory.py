"""Trajectories of a linear structure and their derivatives by parameters, from its complex modes.

With A v_k = λ_k v_k the outputs are Re Σ_k C v_k (w_k·b) ρ(t; λ_k) over all modes of the state
matrix, w_k the rows of the inverse of the matrix of all v_k, b the start or the push of a load and
ρ = exp(λ t) or the Duhamel integral of the load. λ_k and v_k are smooth where eigenvalues are
apart, and their derivatives follow from those of A (Stewart, Sun 1990); ρ has its own by λ.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, inverse
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.structures.loads import History

MIN_DISTANCE = 1e-4
"""Relative distance of two eigenvalues below which second derivatives of their modes lose more than
eight digits."""
ROUND_OFF = 1e-7
"""The same over the largest eigenvalue: double ones at 0 part by the root of rounding."""


def modal_trajectory(
    state_matrix: Jet, columns: Jet, rows: Jet, loads: Sequence[History], time: Array
) -> Jet | None:
    """Return outputs at nodes with two derivatives, shape (S, T, m); None where modes are too near.

    A is the state matrix (S, N, N), C are the rows (S, m, N), and columns (S, N, 1 + L) the initial
    state and what a unit of each of L loads pushes.
    """
    modes = _modes(state_matrix)
    if modes is None:
        return None
    rate, shapes, adjoint = modes
    # one of each conjugate pair, which stand first, twice
    weight = 1.0 + np.sign(rate.value.imag)
    count = int((weight > 0).sum(1).max())
    rate, weight = rate[:, :count], weight[:, :count]
    read, moved = (rows @ shapes)[..., :count], (adjoint @ columns)[:, :count]
    free = np.exp(rate.value[..., None] * time)
    # ρ with two derivatives, (S, 3, n, T) each
    waves = [np.stack([free, time * free, time**2 * free], 1)]
    for load in loads:
        try:
            found, _ = responses_at_nodes(rate.value.ravel(), load, time, 2)
        except UnprovedError:  # a motion grows, or turns, out of the range of the recursion
            return None
        waves.append(found.reshape(3, len(time), *rate.value.shape).transpose(2, 0, 3, 1))
    amplitudes = [
        read * moved[:, None, :, source] * weight[:, None] for source in range(1 + len(loads))
    ]
    table = np.concatenate(waves, 1).reshape(len(weight), -1, len(time))
    table = np.concatenate([table.real, -table.imag], -2)
    derivatives = list[Array]()
    for factors in zip(*(_chain(x, rate[:, None]) for x in amplitudes), strict=True):
        factor = np.concatenate(factors, -1)
        motion = np.concatenate([factor.real, factor.imag], -1) @ table  # its real part
        derivatives.append(np.asarray(motion.swapaxes(-1, -2)))
    return Jet(*derivatives)


def _chain(a: Jet, rate: Jet) -> list[Array]:
    """Factors of ρ, ρ′ and ρ″ in a ρ(λ) and its derivatives, (…, S, m, 3 n), for a (S, m, n)."""
    slope, zero = rate.first, 0.0 * a.value
    first = a.first, a.value * slope, 0.0 * a.first
    cross = a.first[:, None] * slope
    mixed = cross + cross.swapaxes(0, 1) + a.value * rate.second
    second = a.second, mixed, a.value * slope[:, None] * slope
    return [np.concatenate(x, -1) for x in ((a.value, zero, zero), first, second)]


def _modes(A: Jet) -> tuple[Jet, Jet, Jet] | None:
    """Eigenvalues (S, N), modes as columns and the inverse of their matrix, (S, N, N), with jets.

    Eigenvalues fall with their imaginary part. A mode's derivatives have no part of the mode
    itself. None where two eigenvalues are nearer than `MIN_DISTANCE`.
    """
    values, vectors = np.linalg.eig(A.value)
    order = np.argsort(-values.imag, axis=-1, kind="stable")
    values = np.take_along_axis(values, order, -1)
    V = np.take_along_axis(vectors, order[:, None], -1).astype(complex)
    gaps = values[:, None] - values[:, :, None]  # λ_k − λ_l in row l, column k
    same = np.eye(values.shape[-1], dtype=bool)
    size = np.abs(values[:, None])
    least_gap = MIN_DISTANCE * size + ROUND_OFF * size.max(-1, keepdims=True)
    if (np.abs(gaps) < least_gap)[:, ~same].any():
        return None
    quotient = np.where(same, 0.0, 1 / np.where(same, 1.0, gaps))
    W = np.linalg.inv(V)
    B, bend = W @ A.first @ V, W @ A.second @ V
    slope = np.diagonal(B, axis1=-2, axis2=-1)
    U = B * quotient
    cross = B[:, None] @ U - U * slope[:, None, :, None, :]
    bend = bend + cross + cross.swapaxes(0, 1)
    curve = np.diagonal(bend, axis1=-2, axis2=-1)
    shapes = Jet(V, V @ U, V @ (bend * quotient))
    return Jet(values, slope, curve), shapes, inverse(shapes)
