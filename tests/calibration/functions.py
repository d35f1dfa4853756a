"""Random functions of fuzzy inputs, and their least and greatest values by other means."""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.optimize import minimize
from scipy.stats import qmc

from alphacut.fuzzy import Triangular

GRID = 61
POLISHED = 8


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


class Exact:
    """A function of points, (n, d) or (d,), whose ends over a box of two corners are known."""

    def __init__(self, function, ends):
        self.function, self.ends = function, ends

    def __call__(self, x):
        return self.function(x)


def sines(rng, n):
    """Four sines of wave numbers up to 18."""
    height, phase = rng.normal(size=4), rng.uniform(0, 6, 4)
    waves = rng.uniform(-1, 1, (4, n)) * rng.choice([4, 8, 12, 18]) / 2
    return lambda x: np.sin(x @ waves.T + phase) @ height


def one_humped(rng, n):
    """A concave quadratic with its maximum inside (−1, 1), slightly bent."""
    centre, weight = rng.uniform(-0.6, 0.6, n), rng.uniform(0.5, 2, n)
    return lambda x: -((x - centre) ** 2) @ weight + 0.1 * np.sin(x.sum(-1) / 2)


def _separable(term):
    """Sum of the same term of each input, with the range of each over a fine grid."""

    def ends(lower, upper):
        values = term(np.linspace(lower, upper, 20001))
        return values.min(axis=0).sum(), values.max(axis=0).sum()

    return Exact(lambda x: term(x).sum(-1), ends)


def rastrigin(rng, n):
    """One to three cosine waves of each input on a parabola."""
    waves, centre = rng.uniform(0.5, 1.5, n), rng.uniform(-0.5, 0.5, n)
    return _separable(lambda x: (x - centre) ** 2 - np.cos(2 * np.pi * waves * (x - centre)))


def schwefel(rng, n):
    """The function of Schwefel over its usual range, shifted."""
    centre = rng.uniform(-0.2, 0.2, n)
    return _separable(lambda x: -(z := 400 * (x - centre)) * np.sin(np.sqrt(np.abs(z) + 1)) / 400)


def resonance(rng, n):
    """Amplitude of two oscillators under a harmonic force, over their parameters."""
    rates, shift = rng.normal(0, 0.3, (2, n)), rng.uniform(-0.3, 0.3, 2)
    damping = rng.uniform(0.02, 0.2, 2)

    def amplitude(x):
        ratio = np.exp(x @ rates.T + shift)
        return (1 / np.hypot(1 - ratio**2, 2 * damping * ratio)).sum(-1)

    return amplitude


def spike(rng, n):
    """A slope with a smooth spike whose basin covers 10 to 30 % of the box."""
    slope, centre = rng.normal(0, 0.3, n), rng.uniform(-0.6, 0.6, n)
    distances = np.linalg.norm(rng.uniform(-1, 1, (4000, n)) - centre, axis=1)
    radius, height = np.quantile(distances, rng.uniform(0.1, 0.3)), rng.choice([-1, 1]) * 3

    def function(x):
        share = ((x - centre) ** 2).sum(-1) / radius**2
        return x @ slope + height * np.maximum(1 - share, 0) ** 2

    return function


def rising(rng, n):
    """A function that is monotone in every input."""
    return monotone(rng, n)[0]


SINGLE = [rising, one_humped]
SEVERAL = [smooth, hills, sines, rastrigin, schwefel, resonance, kink, spike, jump]


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
    """Least and greatest value over a grid of a cut, or 40,000 points, polished from the best."""
    lower, upper = np.array([number.cut(alpha) for number in inputs.values()]).T
    if isinstance(function, Exact):
        return list(function.ends(lower, upper))
    points = spread(lower, upper)
    values, ends = function(points), []
    for sign in (1.0, -1.0):
        start = points[np.argsort(sign * values)[: POLISHED if len(lower) < 4 else 5 * POLISHED]]
        box = list(zip(lower, upper, strict=True))
        polished = [
            minimize(lambda x, s=sign: s * function(x), p, bounds=box, method="L-BFGS-B").fun
            for p in start
        ]
        ends.append(sign * min(*polished, (sign * values).min()))
    return ends


def spread(lower, upper):
    """A grid of a box of up to three inputs; corners and quasi-random points of a larger one."""
    if len(lower) < 4:
        axes = [np.linspace(*end, GRID) for end in zip(lower, upper, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(lower))
    corners = np.array(list(product((0.0, 1.0), repeat=len(lower))))
    sobol = qmc.Sobol(len(lower), rng=np.random.default_rng(0)).random(2**15)
    return lower + np.concatenate([corners, sobol]) * (upper - lower)
