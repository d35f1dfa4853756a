"""Bounds of a mode's motion over time: exp(λ t), and R(t; λ) under the ground's motion.

A part of a modal model is 2 Re Σ_k C_k(p) w(t; λ_k(p)) with w = exp(λ t) or w = R = ∫ exp(λ (t −
s)) a(s) ds; its r-th derivative by λ is bounded by t^r exp(g t), or by ∫ τ^r exp(g τ) |a(t − τ)|
dτ, with g a bound of Re λ.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.dynamics.record_load import Segments
from alphacut.frame.modal.model import ModalModel

ROUNDING = 1e-13
"""Error of a convolution by Fourier transforms over the norms of its factors; some ε log₂ N."""


@dataclass(frozen=True, eq=False)
class Part:
    """The free or the forced part of a modal model.

    Args:
        share: C_k, n m polynomials.
        waves: Bounds of the derivatives of w by λ, orders 0 to 3, shape (4, T, n).
        elapsed: Bounds of ∫ |w| from 0 to t, shape (T, n).
        push: What the part has been set off with up to t: 1, or a bound of ∫ |a| in m/s, shape
            (T,).
        left_out: Share of waves[0] by which the model's w may be wrong, shape (n,).
        forced: Whether it is the forced part.
    """

    share: Polynomial
    waves: Array
    elapsed: Array
    push: Array
    left_out: Array
    forced: bool = False


def parts(model: ModalModel, growth: Array) -> list[Part]:
    """Free part of a model, and the forced one under a load; `growth` bounds Re λ_k, (n,)."""
    time = model.time[:, None]
    powers = time ** np.arange(4)[:, None, None]
    elapsed = np.where(
        growth == 0, time, np.expm1(growth * time) / np.where(growth == 0, 1.0, growth)
    )
    free = [
        Part(
            model.coefficient,
            powers * np.exp(growth * time),
            elapsed,
            np.ones(len(time)),
            np.zeros(model.count),
        )
    ]
    ground = model.flow.system.ground
    if model.load is None or ground is None:
        return free
    steps = len(model.time) - 1
    parts = ceil(model.flow.step / ground.step - 1e-9)
    h, count = model.flow.step / parts, parts * steps
    kernels = [_largest(growth, h, count, power) for power in range(4)]
    # ∫ exp(g s) ds to the end of each interval, at most
    swell = np.cumsum(kernels[0], axis=0) * h
    size = Segments.of(ground, h, count).magnitudes(count)
    waves, elapsed, push = (
        _convolved(kernel, size)[..., ::parts, :]
        for kernel in (np.stack(kernels), swell, np.ones((count, 1)))
    )
    return [
        *free,
        Part(model.load.share, waves, elapsed, push[:, 0], model.load.truncation, forced=True),
    ]


def _largest(growth: Array, step: float, count: int, power: int) -> Array:
    """Largest τ^power exp(g τ) in each of `count` intervals, shape (count, n)."""
    ends = (np.arange(count + 1) * step)[:, None]
    value = ends**power * np.exp(growth * ends)
    peak = -power / np.where(growth < 0, growth, -1e-300)
    inside = (peak > ends[:-1]) & (peak < ends[1:])
    summit = np.where(inside, peak, 0.0) ** power * np.exp(-float(power))
    return np.asarray(np.maximum(np.maximum(value[:-1], value[1:]), np.where(inside, summit, 0.0)))


def _convolved(kernel: Array, size: Array) -> Array:
    """Upper sums of ∫ kernel(τ) |a(t − τ)| dτ at the ends of all intervals, (…, J + 1, n).

    Args:
        kernel: Its maxima over the intervals, shape (…, J, n).
        size: ∫ |a| over them, shape (J,).
    """
    from scipy.signal import oaconvolve  # which takes time to import

    count = len(size)
    record = size.reshape((1,) * (kernel.ndim - 2) + (-1, 1))
    whole = oaconvolve(kernel, record, axes=-2)[..., :count, :]
    # what rounding of the Fourier transforms may take off, per row
    rounding = ROUNDING * np.sqrt((kernel**2).sum(-2, keepdims=True) * (size**2).sum())
    start = np.zeros((*whole.shape[:-2], 1, whole.shape[-1]))
    return np.concatenate([start, np.maximum(whole, 0.0) + rounding], axis=-2)
