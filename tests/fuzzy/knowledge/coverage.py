"""Share of repeated samples whose cut holds the truth, for laws with known truths."""

from __future__ import annotations

import numpy as np
from scipy import stats

from alphacut.fuzzy import from_data

ALPHA = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 0.9])
FAR = 1e300
LAWS = {
    "normal": (stats.norm(3, 2), (-FAR, FAR)),
    "log-normal": (stats.lognorm(0.8), (0.0, FAR)),
    "Cauchy": (stats.cauchy(), (-FAR, FAR)),
    "Pareto 1.1": (stats.pareto(1.1), (0.0, FAR)),
    "uniform": (stats.uniform(), (0.0, 1.0)),
    "arcsine": (stats.beta(0.5, 0.5), (0.0, 1.0)),
    "skewed beta": (stats.beta(0.3, 6), (0.0, 1.0)),
    "Poisson 2": (stats.poisson(2), (0.0, FAR)),
    "coin 0.1": (stats.bernoulli(0.1), (0.0, 1.0)),
}


def truth_of(law, claim, rng, count):
    """What the cuts of `count` samples should hold."""
    if claim == "next value":
        return law.rvs(size=count, random_state=rng).astype(float)
    if claim == "mean":
        return np.full(count, law.mean())
    return np.full(count, law.ppf(0.5 if claim == "median" else float(claim.split()[1])))


def held(name, claim, n, count, rng, *, named=None, make=from_data):
    """Share of samples of n values whose cut holds the truth, less 1 − α, over its standard error.

    Returns:
        Two arrays over `ALPHA`: the score, and the share less 1 − α.
    """
    law, bounds = LAWS[name]
    values = law.rvs(size=(count, n), random_state=rng).astype(float)
    numbers = [make(row, claim, bounds=bounds, law=named) for row in values]
    cuts = np.array([[number.cut(alpha) for alpha in ALPHA] for number in numbers])
    truth = truth_of(law, claim, rng, count)[:, None]
    excess = ((cuts[..., 0] <= truth) & (truth <= cuts[..., 1])).mean(0) - (1 - ALPHA)
    return excess / np.sqrt(ALPHA * (1 - ALPHA) / count), excess
