"""The rule in θ of the models that solve slice by slice, fit for maps that jump."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rve.result import StressCurve, effective_modulus
from stochastic import RadiusMap, ThetaRule, gauss_rule
from stochastic.truncated_normal import Array

_SAMPLES = 2049
_LEAST_JUMP = 1e-3  # in radii
_FINE = 128
_MOST_POINTS = 800
DIGITS = 12  # radii equal to so many decimals are one slice


class RuleError(RuntimeError):
    """No rule in θ reaches the wanted accuracy."""


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


def settle_rule(
    radius_map: RadiusMap, curves_at: Callable[[ThetaRule], list[StressCurve]], *, points: int | None, accuracy: float
) -> tuple[list[StressCurve], list[float]]:
    """Curves by a rule whose nodes are doubled until E of all of them settles within `accuracy`, and the last change of each.

    Args:
        radius_map: The map.
        curves_at: Stress curves at the nodes of a rule; cheap.
        points: Nodes, or None to have them found.
        accuracy: Relative change of E that counts as settled.

    Raises:
        RuleError: No rule in reach settles.
    """
    count = points or 12
    coarse, coarse_count = curves_at(theta_rule(radius_map, points=-(-3 * count // 4))), -(-3 * count // 4)
    while True:
        fine = curves_at(theta_rule(radius_map, points=count))
        gaps = [abs(effective_modulus(*a.mean)[0] / effective_modulus(*b.mean)[0] - 1) for a, b in zip(coarse, fine, strict=True)]
        if points or max(gaps) <= accuracy:
            return fine, gaps
        if count >= _MOST_POINTS:
            raise RuleError(
                f"rules of {coarse_count} and {count} nodes in θ leave E {max(gaps):.1e} apart and {accuracy:.1e} is wanted: "
                f"the radius map is not smooth; allow a larger error, or give the number of nodes"
            )
        coarse, coarse_count, count = fine, count, 2 * count


def extreme_radii(radius_map: RadiusMap) -> Array:
    """Least and greatest radius that a fine rule in θ meets, shape (2,)."""
    law = radius_map.distribution
    radii = radius_map(np.concatenate([[law.lower, law.upper], theta_rule(radius_map, points=_FINE).nodes]))
    return np.array([radii.min(), radii.max()])


def theta_error(radius_map: RadiusMap, rule: ThetaRule, *, radii: Array, stress: Array) -> float:
    """Estimated relative error of E by `rule`, from slices already solved.

    Stress is smoother in r² than in θ: polynomials in r² through the slices at the nodes and at the extreme radii are averaged by a
    rule so fine that it leaves nothing out, and compared with the average over the nodes. The largest gap of three degrees, doubled.

    Args:
        radius_map: The map.
        rule: Its n nodes.
        radii: Radii solved, shape (m,): those of the nodes and the two extreme ones.
        stress: σ11 of load 1 and σ12 of load 2 at `radii`, shape (m, 2).
    """
    square, places = radii**2, np.searchsorted(radii, np.round(radius_map(rule.nodes), DIGITS))
    weights = np.maximum(np.bincount(places, rule.weights, minlength=radii.size), 1e-6)
    fine = theta_rule(radius_map, points=_FINE)
    target = radius_map(fine.nodes) ** 2
    own = effective_modulus(*(rule.weights @ stress[places]))[0]
    gaps = []
    for degree in range(max(0, radii.size - 3), radii.size):
        basis, carried = (_chebyshev(x, square.min(), square.max(), degree) for x in (square, target))
        root = np.sqrt(weights)[:, None]
        coefficients = np.linalg.lstsq(basis * root, stress * root, rcond=1e-14)[0]
        gaps.append(effective_modulus(*(fine.weights @ (carried @ coefficients)))[0] / own - 1)
    return float(2 * np.abs(gaps).max())


def _chebyshev(x: Array, low: float, high: float, degree: int) -> Array:
    """Chebyshev polynomials of [low, high] up to `degree` at `x`."""
    return np.polynomial.chebyshev.chebvander((2 * x - low - high) / max(high - low, 1e-12), degree)
