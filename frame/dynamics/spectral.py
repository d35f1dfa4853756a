"""Responses of single modes to a record, R(t; λ) = ∫ exp(λ (t − s)) a(s) ds, by a recursion."""

from __future__ import annotations

import numpy as np

from alphacut.frame.dynamics.record_load import load_rule, parts_of
from alphacut.frame.structures.linear import Accelerogram
from alphacut.fuzzy.arrays import Array


def responses(rate: Array, ground: Accelerogram, step: float, steps: int) -> Array:
    """R at all nodes, shape (S, steps + 1, K), for λ (S, K).

    From node to node R is multiplied by exp(λ h), and what the record adds within the step is a sum
    over points (`LoadRule`): a recursion of order one in time.
    """
    from scipy.signal import lfilter  # which takes time to import

    flat = rate.ravel()
    fastest = float(np.abs(flat).max())
    rule = load_rule(ground, step, steps, parts_of(fastest, step))
    decay, added = np.exp(step * flat), rule.weight @ np.exp(rule.tau[:, None] * flat)
    out = np.zeros((steps + 1, len(flat)), complex)
    for k, d in enumerate(decay):
        out[1:, k] = lfilter([1.0], [1.0, -d], added[:, k])
    return np.moveaxis(out.reshape(-1, *rate.shape), 0, 1)
