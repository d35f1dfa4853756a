"""Motions of a box, and what its bounds promise of them."""

import numpy as np

from alphacut.frame import Exact, LinearFlow
from alphacut.frame.verification.self_test import structures_at


def random_points(inputs, count, rng, alpha=0.0):
    """Random points of a cut, every other one a corner, shape (count, d)."""
    low, high = np.array([number.cut(alpha) for number in inputs.values()]).T
    unit = rng.random((count, len(low)))
    unit[::2] = unit[::2].round()
    return low + unit * (high - low)


def exact_motions(model, points, inputs, duration, step):
    """Exact motions at points (S, d) of a linear model's inputs, shape (S, T, m)."""
    return LinearFlow(model, tuple(inputs), duration, step, Exact()).values(points)


def judged_motions(model, points, inputs, times):
    """Motions at points (S, d) by the judge of proofs, shape (S, T, m)."""
    motions = structures_at(model, tuple(inputs), points)
    return np.stack([motion.outputs(times).values for motion in motions])


def off_chords(values, parts):
    """How far values at `parts` equal parts of each step lie off its chord, (steps, ...)."""
    nodes, x = values[::parts, None], np.arange(parts) / parts
    chord = nodes[:-1] + x.reshape(-1, *[1] * (values.ndim - 1)) * np.diff(nodes, axis=0)
    return np.abs(values[:-1].reshape(chord.shape) - chord).max(1)


def require_inside(values, found, level=0, slack=0.0):
    """Requires that motions lie within bounds and their error, if these are but estimated.

    `slack` allows for rounding, as a share of each output's largest value.
    """
    allowed = slack * np.abs(values).max((0, 1))
    if found.nature == "estimated":
        allowed = allowed + found.error[level]
    assert (values <= found.upper[level] + allowed).all()
    assert (values >= found.lower[level] - allowed).all()
