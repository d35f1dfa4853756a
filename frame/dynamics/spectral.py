"""Exact propagator by eigenvalues: every mode runs on its own.

Each mode's answer to the ground is R(t; λ) = ∫ exp(λ (t − s)) a(s) ds, marched over the segments
between samples and nodes, in which the record is linear. Powers of the whole transfer matrix are
never formed, and overdamped modes are as good as others: all 2n eigenvalues are kept.
"""

from __future__ import annotations

from functools import lru_cache
from math import factorial

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.dynamics.record_load import SAME, Segments
from alphacut.frame.structures import modes as natural
from alphacut.frame.structures.linear import Accelerogram, Matrices

LARGE = 40
"""States from which on eigenvalues are cheaper than powers of the transfer matrix."""
CONDITION = 1e9
"""Condition of the eigenvectors above which the modes are too near to critical damping to stand for
the structure.
"""


KEPT = 64
"""Lengths of segments whose exponentials are kept; commensurate steps have few."""


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
    undamped = None if deep else natural.classical_modes(matrices, rows)
    if undamped is not None:
        return _superposed(undamped, ground=ground, step=step, steps=steps)
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


def _superposed(
    modes: natural.ClassicalModes, *, ground: Accelerogram | None, step: float, steps: int
) -> Jet:
    """As `spectral_trajectory`, from modes that damping does not couple."""
    out = np.zeros((len(modes.rate), steps + 1, modes.start.shape[-1]))
    if modes.start.any():
        time = np.arange(steps + 1) * step
        out += (np.exp(modes.rate[:, None, :] * time[:, None]) @ modes.start).real
    if ground is not None:
        out += (responses(modes.rate, ground, step, steps)[0] @ modes.load).real
    return Jet.constant(out, 0)


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
    """R and its derivatives by λ at all nodes, each shape (S, steps + 1, K), for λ (S, K)."""
    cut = Segments.of(ground, step, steps)
    lengths, alike = _alike(cut.length, step)
    cached = lru_cache(maxsize=KEPT)(lambda i: _advance(rate, float(lengths[i]), derivatives))
    orders = 3 if derivatives else 1
    out: list[Array] = [
        np.zeros((len(rate), steps + 1, rate.shape[1]), complex) for _ in range(orders)
    ]
    now = [np.zeros(rate.shape, complex) for _ in range(orders)]
    for j, index, first, last in zip(cut.step, alike, cut.first, cut.last, strict=True):
        h, (E, old, new) = lengths[index], cached(index)
        moved = [E * now[0]]
        if derivatives:
            moved += [E * (now[1] + h * now[0]), E * (now[2] + 2 * h * now[1] + h**2 * now[0])]
        now = [x + first * a + last * b for x, a, b in zip(moved, old, new, strict=True)]
        for whole, x in zip(out, now, strict=True):
            whole[:, j + 1] = x  # the last segment of the step remains
    return out


def _alike(length: Array, step: float) -> tuple[Array, Array]:
    """Means of lengths that differ by rounding alone, and which of them each one is."""
    order = np.argsort(length)
    group = np.cumsum(np.diff(length[order], prepend=length[order[0]]) > SAME * step)
    index = np.empty(len(length), int)
    index[order] = group
    return np.bincount(index, length) / np.bincount(index), index


def _advance(rate: Array, step: float, derivatives: bool) -> tuple[Array, list[Array], list[Array]]:
    """exp(λ h), and what accelerations at both ends of a segment add to R and its derivatives."""
    f = phi(rate * step, 4 if derivatives else 2)
    slopes = [[f[k]] for k in (1, 2)]
    if derivatives:
        for k, row in zip((1, 2), slopes, strict=True):
            row.append(step * (f[k] - k * f[k + 1]))
            row.append(step**2 * (f[k] - 2 * k * f[k + 1] + k * (k + 1) * f[k + 2]))
    old = [step * (a - b) for a, b in zip(*slopes, strict=True)]
    return f[0], old, [step * b for b in slopes[1]]


def phi(z: Array, top: int) -> list[Array]:
    """φ_0 … φ_top of exponential integrators to round-off."""
    z = np.asarray(z, complex)
    small = np.abs(z) < 1
    inner, outer = np.where(small, z, 0), np.where(small, 1, z)
    series = np.zeros_like(z)
    for j in range(20, -1, -1):  # Horner; 1/24! is below round-off
        series = series * inner + 1 / factorial(j + top)
    near, far = [series], [np.exp(outer)]
    for k in range(top - 1, -1, -1):
        near.insert(0, near[0] * inner + 1 / factorial(k))
    for k in range(top):
        far.append((far[-1] - 1 / factorial(k)) / outer)
    return [np.where(small, a, b) for a, b in zip(near, far, strict=True)]
