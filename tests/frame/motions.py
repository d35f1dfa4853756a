"""Motions of a box, and what its bounds promise of them."""

import numpy as np

from alphacut.frame import Exact, LinearFlow


def random_points(inputs, count, rng, alpha=0.0):
    """Random points of a cut, every other one a corner, shape (count, d)."""
    low, high = np.array([number.cut(alpha) for number in inputs.values()]).T
    unit = rng.random((count, len(low)))
    unit[::2] = unit[::2].round()
    return low + unit * (high - low)


def exact_motions(model, points, inputs, duration, step):
    """Exact motions at points (S, d) of a linear model's inputs, shape (S, T, m)."""
    return LinearFlow(model, tuple(inputs), duration, step, Exact()).values(points)


def require_inside(values, found, level=0, slack=0.0):
    """Requires that motions lie within bounds and their error, if these are but estimated.

    `slack` allows for rounding, as a share of each output's largest value.
    """
    allowed = slack * np.abs(values).max((0, 1))
    if found.nature == "estimated":
        allowed = allowed + found.error[level]
    assert (values <= found.upper[level] + allowed).all()
    assert (values >= found.lower[level] - allowed).all()
