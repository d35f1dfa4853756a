"""Responses of single modes to a record, R(t; λ) = ∫ exp(λ (t − s)) a(s) ds, by a recursion."""

from __future__ import annotations

import numpy as np

from alphacut.frame.dynamics.record_load import load_rule, parts_of
from alphacut.frame.structures.linear import Accelerogram
from alphacut.fuzzy.arrays import Array


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
