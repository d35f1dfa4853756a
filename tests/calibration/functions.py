"""Random functions of fuzzy inputs, and their least and greatest values by other means."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from alphacut.fuzzy import Triangular

GRID = 41
POLISHED = 3


def smooth(rng, n):
    """A quadratic, a wave and a slope."""
    slope, wave = rng.normal(0, 2, n), rng.normal(0, 2, n)
    matrix, size = rng.normal(0, 1, (n, n)), rng.normal(0, 0.5)
    return lambda x: x @ slope + ((x @ matrix) * x).sum(-1) / 2 + size * np.sin(x @ wave)


def hills(rng, n):
    """Five bells, some narrow."""
    centres, heights = rng.uniform(-1, 1, (5, n)), rng.normal(0, 1, 5)
    widths = rng.uniform(0.3, 1.2, 5)
    return lambda x: sum(
        h * np.exp(-(((x - c) / w) ** 2).sum(-1))
        for h, c, w in zip(heights, centres, widths, strict=True)
    )


def jump(rng, n):
    """A slope with a step across a plane."""
    slope, normal, offset = rng.normal(0, 1, n), rng.normal(0, 1, n), rng.uniform(-0.5, 0.5)
    height = rng.normal(0, 2)
    return lambda x: x @ slope + height * (x @ normal > offset)


def kink(rng, n):
    """The greatest of four slopes."""
    slopes, offsets = rng.normal(0, 1, (4, n)), rng.normal(0, 0.3, 4)
    return lambda x: (x @ slopes.T + offsets).max(-1)


FAMILIES = [smooth, hills, jump, kink]


def monotone(rng, n):
    """A function of signs that are stated beside it, some of whose effects are small."""
    signs = rng.choice([-1, 1], n)
    sizes, bends = 10.0 ** rng.uniform(-6, 0, n), rng.uniform(0.2, 2, n)
    product = rng.uniform(0, 1) * sizes.min()

    def function(x):
        rising = np.expm1(bends * signs * x)
        return rising @ sizes + product * np.exp((signs * x).sum(-1))

    return function, {f"x{i}": int(sign) for i, sign in enumerate(signs)}


def numbers(rng, n):
    """Triangular inputs within (−1, 1)."""
    corners = np.sort(rng.uniform(-1, 1, (n, 3)), axis=1)
    return {f"x{i}": Triangular(*corners[i]) for i in range(n)}


def named(function):
    """The function of the last axis as one of inputs by name."""
    return lambda **x: function(np.stack(list(x.values()), -1))


def true_ends(function, inputs, alpha):
    """Least and greatest value over a grid of a cut, polished from its best points."""
    ends = np.array([number.cut(alpha) for number in inputs.values()])
    axes = [np.linspace(*end, GRID) for end in ends]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(ends))
    values, best = function(grid), []
    for sign in (1.0, -1.0):
        place = grid[np.argsort(sign * values)[:POLISHED]]
        polished = [
            minimize(lambda x, s=sign: s * function(x), p, bounds=ends, method="L-BFGS-B").fun
            for p in place
        ]
        best.append(sign * min(*polished, (sign * values).min()))
    return best
