"""Error of the rule in θ that slices are averaged by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.fuzzy.arrays import Array
from alphacut.rve.bounds import mori_tanaka
from alphacut.rve.cell import AnyPhase
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

DIGITS = 12  # radii equal to so many decimals are one slice
_FINE = 128
_SAFETY = 1.6
_NOISE = 1e-13  # of a declared error: what rounding leaves


def theta_error(
    radius_map: RadiusMap,
    rule: ThetaRule,
    *,
    radii: Array,
    moduli: Array,
    phases: Sequence[AnyPhase],
    thickness: float = 0.0,
) -> Array:
    """Declared relative errors of the mean C11 + C12, C11 − C12 and C33 by `rule`, shape (3,).

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
        phases: Matrix and inclusion first.
        thickness: Of an interphase, which rings that nearly touch add to their radii.
    """
    places = np.searchsorted(radii, np.round(radius_map(rule.nodes), DIGITS))
    weights = np.maximum(np.bincount(places, rule.weights, minlength=radii.size), 1e-6)
    root = np.sqrt(weights)[:, None]
    fine = gauss_rule(radius_map.distribution, points=_FINE)
    between = radius_map(fine.nodes)
    scale, logarithm = _dilute(between, phases), np.log(moduli / _dilute(radii, phases))
    low, high, span = logarithm.min(axis=0), logarithm.max(axis=0), np.ptp(logarithm, axis=0)
    touch, target = np.sqrt(1 - (radii + thickness) ** 2), np.sqrt(1 - (between + thickness) ** 2)
    ends, width = touch.min() + touch.max(), max(np.ptp(touch), 1e-12)
    mean, gaps = rule.weights @ moduli[places], []
    for degree in range(min(max(0, radii.size - 4), 9), min(radii.size, 15)):
        basis, carried = (chebvander((2 * x - ends) / width, degree) for x in (touch, target))
        coefficients = np.linalg.lstsq(basis * root, logarithm * root, rcond=1e-14)[0]
        refined = scale * np.exp(np.clip(carried @ coefficients, low - span, high + span))
        gaps.append(fine.weights @ refined / mean - 1)
    return np.asarray(_SAFETY * np.abs(gaps).max(axis=0) + _NOISE)


def _dilute(radii: Array, phases: Sequence[AnyPhase]) -> Array:
    """The moduli of Mori and Tanaka of matrix and inclusion at radii, shape (n, 3)."""
    return mori_tanaka(np.pi / 4 * radii**2, *phases[:2])
