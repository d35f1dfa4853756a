"""The rule in θ of the models that solve slice by slice, fit for maps that jump or bend."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable
from functools import lru_cache
from typing import TypeGuard

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.rve.bounds import mori_tanaka
from alphacut.rve.cell import AnyPhase, square_moduli
from alphacut.rve.result import StressCurve
from alphacut.rve.slices.curve import curve_of
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule, require_map

_SAMPLES = 2049
_LEAST_JUMP, _LEAST_BEND = 1e-3, 1e-8  # in radii, over one or two steps of the sampling
_FINE = 128
_MOST_POINTS = 1200
SAFETY = 1.6  # of the estimates in θ
_NOISE = 1e-13  # of a declared error: what rounding leaves
DIGITS = 12  # radii equal to so many decimals are one slice

_kept_rule = lru_cache(maxsize=256)(gauss_rule)


def can_hash(of: object) -> TypeGuard[Hashable]:
    """True if what is known of an object can be kept under it."""
    try:
        hash(of)
    except TypeError:
        return False
    return True


class RuleError(FailedError):
    """No rule in θ reaches the wanted accuracy."""


def breaks(radius_map: RadiusMap) -> Array:
    """The θ at which the map jumps or its slope does, rising; by sampling and bisection.

    What is narrower than a two-thousandth of the support falls between the samples and is not seen.
    """
    law = radius_map.distribution
    theta = np.linspace(law.lower, law.upper, _SAMPLES)
    radius = radius_map(theta)
    change = np.abs(np.diff(radius))
    suspects = np.flatnonzero(change > np.maximum(_LEAST_JUMP, 4 * np.median(change)))
    jumps = [
        x for k in suspects if (x := _bisect_jump(radius_map, theta[k], theta[k + 1])) is not None
    ]
    bend = np.abs(np.diff(radius, 2))
    bent = np.flatnonzero(bend > np.maximum(_LEAST_BEND, 20 * np.median(bend)))
    bends = [_bisect_bend(radius_map, theta[k], theta[k + 2]) for k in bent]
    step = theta[1] - theta[0]
    kinks = [x for x in bends if all(abs(x - jump) > 3 * step for jump in jumps)]
    every = np.sort(np.array(jumps + kinks))
    return every[np.append(True, np.diff(every) > step)] if every.size else every


_kept_breaks = lru_cache(maxsize=64)(breaks)


def _bisect_jump(radius_map: RadiusMap, low: float, high: float) -> float | None:
    """Jump inside [low, high], or None where halving shows the map continuous."""
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


def _bisect_bend(radius_map: RadiusMap, low: float, high: float) -> float:
    """Sharpest bend of the map inside [low, high], to 1e-9."""
    while high - low > 1e-9:
        theta = np.linspace(low, high, 9)
        most = int(np.argmax(np.abs(np.convolve(radius_map(theta), [1, 0, -2, 0, 1], "valid"))))
        low, high = theta[most], theta[most + 4]
    return (low + high) / 2


def theta_rule(radius_map: RadiusMap, *, points: int) -> ThetaRule:
    """Gauss rule of f_Θ with `points` nodes in each smooth piece of the map."""
    law = radius_map.distribution
    cuts = _kept_breaks(radius_map) if can_hash(radius_map) else breaks(radius_map)
    if cuts.size == 0:
        if can_hash(law):
            return _kept_rule(law, points=points)
        return gauss_rule(law, points=points)
    edges = [law.lower, *(float(cut) for cut in cuts), law.upper]
    shares = np.diff(law.cdf(edges))
    pieces = [
        (share, gauss_rule(law, points=points, between=ends))
        for share, ends in zip(shares, itertools.pairwise(edges), strict=True)
        if share > 0
    ]
    nodes = np.concatenate([rule.nodes for _, rule in pieces])
    weights = np.concatenate([share * rule.weights for share, rule in pieces])
    return ThetaRule(nodes, weights / weights.sum())


def settle_rule(
    radius_map: RadiusMap,
    stiffness_at: Callable[[Array], Array],
    *,
    points: int | None,
    accuracy: float,
    moduli: Callable[[Array], Array] = square_moduli,
) -> tuple[list[StressCurve], list[Array], list[StressCurve]]:
    """Curves whose nodes are added until the mean moduli settle, and their declared errors.

    Two finer rules tell how large the error of a rule is: its distance from them, with a margin.

    Args:
        radius_map: The map.
        stiffness_at: Stiffness at n radii for m inclusions, shape (n, m, 3, 3) or (n, m, 6, 6);
            cheap.
        points: Nodes, or None for as many as settle.
        accuracy: Relative error of every mean modulus that counts as settled.
        moduli: The three moduli of a stiffness.

    Returns:
        For each inclusion its curve, the errors of `moduli` of the mean stiffness, and the finest
        curve, by which they are judged: what it is off by is in no error yet.

    Raises:
        RuleError: No rule in reach settles.
        ValueError: The map gives radii outside (0, 1), or its law of θ is none.
    """
    require_map(radius_map)
    count = points or max(6, int(np.ceil(1 - 0.75 * np.log10(accuracy))))
    known: dict[int, list[StressCurve]] = {}
    settled: dict[int, tuple[StressCurve, Array, StressCurve]] = {}
    while True:
        counts = [count, _finer(count), _finer(_finer(count))]
        _add_curves(known, [n for n in counts if n not in known], radius_map, stiffness_at)
        gaps = [
            _gap(*(moduli(np.tensordot(c.weights, np.asarray(c.stiffness), axes=1)) for c in three))
            for three in zip(*(known[n] for n in counts), strict=True)
        ]
        for k, (curve, gap) in enumerate(zip(known[count], gaps, strict=True)):
            if k not in settled and (points or gap.max() <= accuracy):
                # each inclusion by itself, whatever its companions need
                settled[k] = curve, gap, known[counts[-1]][k]
        if len(settled) == len(gaps):
            curves, errors, finest = zip(*(settled[k] for k in range(len(gaps))), strict=True)
            return list(curves), list(errors), list(finest)
        if counts[-1] >= _MOST_POINTS:
            raise RuleError(
                f"the rule of {count} nodes in θ leaves a relative error of {np.max(gaps):.1e};"
                f" {accuracy:.1e} is allowed: the radius map is not smooth",
                "allow a larger error, or give the number of nodes",
            )
        count = counts[1]


def _add_curves(
    known: dict[int, list[StressCurve]],
    counts: list[int],
    radius_map: RadiusMap,
    stiffness_at: Callable[[Array], Array],
) -> None:
    """Curves by the rules of `counts` nodes, all their radii solved in one go."""
    rules = [theta_rule(radius_map, points=n) for n in counts]
    stiffness = stiffness_at(np.concatenate([radius_map(rule.nodes) for rule in rules]))
    parts = np.split(stiffness, np.cumsum([rule.nodes.size for rule in rules])[:-1])
    for count, rule, part in zip(counts, rules, parts, strict=True):
        known[count] = [curve_of(rule, part[:, k]) for k in range(part.shape[1])]


def _finer(count: int) -> int:
    """Nodes of the next finer rule: a third more."""
    return count + max(2, count // 3)


def _gap(value: Array, finer: Array, finest: Array) -> Array:
    """Declared relative errors of `value`, from two finer ones."""
    gap = np.maximum(abs(finer - value), abs(finest - value)) / finest
    return np.asarray(SAFETY * gap + _NOISE)


def extreme_radii(radius_map: RadiusMap) -> Array:
    """Bounds of the radius on the support, shape (2,).

    Raises:
        ValueError: The map gives radii outside (0, 1), or its law of θ is none.
    """
    require_map(radius_map)
    law = radius_map.distribution
    theta = np.linspace(law.lower, law.upper, _SAMPLES)
    radii = radius_map(theta)
    ends = np.sort(radii[[0, -1]])
    for k in (int(radii.argmin()), int(radii.argmax())):  # the extreme may lie between samples
        first, last = theta[max(k - 1, 0)], theta[min(k + 1, _SAMPLES - 1)]
        radii = np.append(radii, radius_map(np.linspace(first, last, _SAMPLES)))
    slack = 1e-3 * (radii.max() - radii.min())
    low = ends[0] if radii.min() >= ends[0] else max(radii.min() - slack, 0.9 * radii.min())
    high = ends[1] if radii.max() <= ends[1] else radii.max() + min(slack, 0.1 * (1 - radii.max()))
    return np.array([low, high])


def theta_error(
    radius_map: RadiusMap,
    rule: ThetaRule,
    *,
    radii: Array,
    moduli: Array,
    phases: tuple[AnyPhase, AnyPhase],
) -> Array:
    """Declared relative errors by `rule`, shape (3,), from slices solved.

    Of the mean C11 + C12, C11 − C12 and C33.

    The logarithm of a modulus over that of Mori and Tanaka is smooth in √(1 − r²), also where soft
    particles or an incompressible matrix make the modulus itself steep: polynomials through the
    slices at the nodes and at the extreme radii are averaged by a rule so fine that it leaves
    nothing out, and compared with the average over the nodes. The largest gap of several degrees,
    with a margin.

    Args:
        radius_map: The map.
        rule: Its n nodes.
        radii: Radii solved, shape (m,): those of the nodes and the two extreme ones.
        moduli: C11 + C12, C11 − C12 and C33 at `radii`, shape (m, 3).
        phases: Matrix and inclusion.
    """
    places = np.searchsorted(radii, np.round(radius_map(rule.nodes), DIGITS))
    weights = np.maximum(np.bincount(places, rule.weights, minlength=radii.size), 1e-6)
    root = np.sqrt(weights)[:, None]
    fine = theta_rule(radius_map, points=_FINE)
    between = radius_map(fine.nodes)
    scale, logarithm = _dilute(between, phases), np.log(moduli / _dilute(radii, phases))
    low, high, span = logarithm.min(axis=0), logarithm.max(axis=0), np.ptp(logarithm, axis=0)
    touch, target = np.sqrt(1 - radii**2), np.sqrt(1 - between**2)
    ends, width = touch.min() + touch.max(), max(np.ptp(touch), 1e-12)
    own, gaps = rule.weights @ moduli[places], []
    for degree in range(min(max(0, radii.size - 4), 9), min(radii.size, 15)):
        basis, carried = (chebvander((2 * x - ends) / width, degree) for x in (touch, target))
        coefficients = np.linalg.lstsq(basis * root, logarithm * root, rcond=1e-14)[0]
        refined = scale * np.exp(np.clip(carried @ coefficients, low - span, high + span))
        gaps.append(fine.weights @ refined / own - 1)
    return np.asarray(SAFETY * np.abs(gaps).max(axis=0) + _NOISE)


def _dilute(radii: Array, phases: tuple[AnyPhase, AnyPhase]) -> Array:
    """The moduli of Mori and Tanaka at radii, shape (n, 3)."""
    return mori_tanaka(np.pi / 4 * radii**2, *phases)
