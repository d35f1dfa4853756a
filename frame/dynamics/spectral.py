"""Exact propagator by eigenvalues: every mode runs on its own.

Each mode's answer to the ground is R(t; λ) = ∫ exp(λ (t − s)) a(s) ds, a recursion in time. Powers
of the whole transfer matrix are never formed, and overdamped modes are as good as others: all 2n
eigenvalues are kept.
"""

from __future__ import annotations

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.dynamics.record_load import load_rule, parts_of
from alphacut.frame.structures import modes as natural
from alphacut.frame.structures.linear import Accelerogram, Matrices

LARGE = 40
"""States from which on eigenvalues are cheaper than powers of the transfer matrix."""
CONDITION = 1e9
"""Condition of the eigenvectors above which the modes are too near to critical damping to stand for
the structure.
"""


class NearlyCriticalError(RuntimeError):
    """Two eigenvectors nearly coincide."""


def spectral_trajectory(
    matrices: Matrices, rows: Jet, *, ground: Accelerogram | None, step: float, steps: int
) -> Jet:
    """Outputs at all nodes, V = (S, steps + 1, m).

    Args:
        matrices: The structure.
        rows: Observation rows, V = (S, m, 2n).
        ground: The ground's motion, or None.
        step: Distance of nodes, in s.
        steps: Number of steps.

    Raises:
        NearlyCriticalError: A pair of modes is so near to critical damping that its eigenvectors
            coincide.
    """
    deep = matrices.mass.directions > 0
    rate, right, left = natural.eigenvectors(natural.state_matrix(matrices))
    if (
        float((np.abs(right.value).sum(-2).max(-1) * np.abs(left.value).sum(-2).max(-1)).max())
        > CONDITION
    ):
        raise NearlyCriticalError("two modes nearly coincide at critical damping")
    seen = (rows @ right).map(lambda x: x.swapaxes(-1, -2))  # V = (S, 2n, m)
    start = concatenate([matrices.q0, matrices.v0], -2)
    parts = []
    if start.value.any() or start.first.any():
        time = np.arange(steps + 1) * step
        wave = np.exp(rate.value[:, None, :] * time[:, None])
        waves = [wave, time[:, None] * wave, time[:, None] ** 2 * wave] if deep else [wave]
        parts.append(_summed(rate, seen * (left @ start), waves))
    if ground is not None:
        kick = np.concatenate([np.zeros_like(matrices.rigid), -matrices.rigid])
        parts.append(
            _summed(
                rate,
                seen * (left @ kick),
                responses(rate.value, ground, step, steps, derivatives=deep),
            )
        )
    if not parts:
        return Jet.constant(
            np.zeros((len(seen.value), steps + 1, seen.value.shape[-1])), rate.directions
        )
    return parts[0] if len(parts) == 1 else parts[0] + parts[1]


def _summed(rate: Jet, share: Jet, waves: list[Array]) -> Jet:
    """Re Σ_k C_k w(λ_k) from w, w' and w'', each (S, T, K); C has V = (S, K, m)."""
    d, (samples, _, m) = rate.directions, share.value.shape
    if not d:
        return Jet.constant((waves[0] @ share.value).real, 0)
    slope = rate.first[..., None]  # (d, S, K, 1)
    pair = slope[:, None] * slope[None, :]
    mixed = share.first[:, None] * slope[None, :]
    nothing = np.zeros_like(share.value)
    bent = share.value * rate.second[..., None] + mixed + mixed.swapaxes(0, 1)
    columns = [  # what stands before w, w' and w'' in the value, the gradient and the Hessian
        [share.value, *share.first, *share.second.reshape(d * d, *share.value.shape)],
        [nothing, *(share.value * slope), *bent.reshape(d * d, *nothing.shape)],
        [nothing] * (1 + d) + [*(share.value * pair).reshape(d * d, *nothing.shape)],
    ]
    factors = np.concatenate([np.concatenate(row, -1) for row in columns], 1)
    both = np.concatenate(waves, -1)
    total = both.real @ factors.real - both.imag @ factors.imag
    out = np.moveaxis(total.reshape(samples, -1, 1 + d + d * d, m), 2, 0)
    return Jet(out[0], out[1 : d + 1], out[d + 1 :].reshape(d, d, *out.shape[1:]))


def responses(
    rate: Array, ground: Accelerogram, step: float, steps: int, *, derivatives: bool = False
) -> list[Array]:
    """R and its derivatives by λ at all nodes, each shape (S, steps + 1, K), for λ (S, K).

    From node to node R is multiplied by exp(λ h), and what the record adds within the step is a sum
    over points (`LoadRule`): a recursion of order one in time.
    """
    flat = rate.ravel()
    fastest = float(np.abs(flat).max())
    rule = load_rule(ground, step, steps, parts_of(fastest, step))
    wave, decay = np.exp(rule.tau[:, None] * flat), np.exp(step * flat)
    out = [_recursion(decay, rule.weight @ wave)]
    if derivatives:
        for order in (1, 2):
            before = [np.vstack([0 * x[:1], x[:-1]]) for x in out]
            carried = step * order * before[-1] + (order - 1) * step**2 * before[0]
            turned = rule.tau[:, None] ** order * wave
            out.append(_recursion(decay, rule.weight @ turned + decay * carried))
    shaped = [np.vstack([np.zeros_like(x[:1]), x]).reshape(-1, *rate.shape) for x in out]
    return [np.moveaxis(x, 0, 1) for x in shaped]


def _recursion(decay: Array, added: Array) -> Array:
    """x[j + 1] = decay x[j] + added[j] from rest, shape (steps, K)."""
    from scipy.signal import lfilter  # which takes time to import

    columns = [lfilter([1.0], [1.0, -d], x) for d, x in zip(decay, added.T, strict=True)]
    return np.stack(columns, 1)
