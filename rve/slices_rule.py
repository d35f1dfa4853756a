"""The rule in θ of the models that solve slice by slice, fit for maps that jump."""

from __future__ import annotations

import numpy as np

from stochastic import RadiusMap, ThetaRule, gauss_rule
from stochastic.truncated_normal import Array

_SAMPLES = 2049
_LEAST_JUMP = 1e-3  # in radii


def jumps(radius_map: RadiusMap) -> Array:
    """The θ at which the map jumps, rising; found by sampling and bisection.

    A jump is where halving an interval of θ leaves the change of r over it as it was.
    """
    law = radius_map.distribution
    theta = np.linspace(law.lower, law.upper, _SAMPLES)
    change = np.abs(np.diff(radius_map(theta)))
    suspects = np.flatnonzero(change > np.maximum(_LEAST_JUMP, 4 * np.median(change)))
    found = [_bisect(radius_map, theta[k], theta[k + 1]) for k in suspects]
    return np.array([x for x in found if x is not None])


def _bisect(radius_map: RadiusMap, low: float, high: float) -> float | None:
    """The jump inside [low, high], or None if the map is continuous there."""
    before, after = radius_map([low, high])
    size = abs(after - before)
    for _ in range(48):
        middle = (low + high) / 2
        value = float(radius_map([middle])[0])
        if abs(value - before) > abs(value - after):
            high, after = middle, value
        else:
            low, before = middle, value
    return high if abs(after - before) > size / 4 else None


def theta_rule(radius_map: RadiusMap, *, points: int) -> ThetaRule:
    """Gauss rule of f_Θ with `points` nodes; where the map jumps, Gauss–Legendre with as many in each smooth piece."""
    law = radius_map.distribution
    breaks = jumps(radius_map)
    if breaks.size == 0:
        return gauss_rule(law, points=points)
    x, w = np.polynomial.legendre.leggauss(points)
    edges = np.concatenate([[law.lower], breaks, [law.upper]])
    half = np.diff(edges)[:, None] / 2
    nodes = (edges[:-1, None] + half * (1 + x)).ravel()
    weights = (half * w).ravel() * law.pdf(nodes)
    return ThetaRule(nodes, weights / weights.sum())
