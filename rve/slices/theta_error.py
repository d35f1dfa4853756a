"""Error of the rule in θ that slices are averaged by."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell.cell import AnyPhase
from alphacut.rve.result.bounds import mori_tanaka
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

DIGITS = 12  # radii equal to so many decimals are one slice
_FINE = 128  # points of a rule whose error is below rounding
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
    particles or an incompressible matrix make the modulus itself steep. Its weighted least-squares
    polynomials of several degrees are averaged by a rule of `_FINE` points; the error is the
    largest distance of these means from that by `rule`, with a safety factor.

    Args:
        radius_map: The map.
        rule: Its n nodes.
        radii: Radii solved, shape (m,): those of the nodes and the two extreme ones.
        moduli: C11 + C12, C11 − C12 and C33 at `radii`, shape (m, 3).
        phases: Matrix and inclusion first.
        thickness: Of an interphase; with it r is the outer radius.
    """
    nodes = np.searchsorted(radii, np.round(radius_map(rule.nodes), DIGITS))
    weights = np.maximum(np.bincount(nodes, rule.weights, minlength=radii.size), 1e-6)
    root = np.sqrt(weights)[:, None]
    fine = gauss_rule(radius_map.distribution, points=_FINE)
    fine_radii = radius_map(fine.nodes)
    scale = _mori_tanaka_moduli(fine_radii, phases)
    logarithm = np.log(moduli / _mori_tanaka_moduli(radii, phases))
    low, high, span = logarithm.min(axis=0), logarithm.max(axis=0), np.ptp(logarithm, axis=0)
    x, fine_x = (np.sqrt(1 - (r + thickness) ** 2) for r in (radii, fine_radii))
    middle, half_width = (x.min() + x.max()) / 2, max(np.ptp(x), 1e-12) / 2
    mean, distances = rule.weights @ moduli[nodes], []
    # up to the interpolating polynomial, from a degree with some freedom to spare on
    for degree in range(min(max(0, radii.size - 4), 9), min(radii.size, 15)):
        basis = chebvander((x - middle) / half_width, degree)
        coefficients = np.linalg.lstsq(basis * root, logarithm * root, rcond=1e-14)[0]
        fit = chebvander((fine_x - middle) / half_width, degree) @ coefficients
        fine_moduli = scale * np.exp(np.clip(fit, low - span, high + span))
        distances.append(fine.weights @ fine_moduli / mean - 1)
    return np.asarray(_SAFETY * np.abs(distances).max(axis=0) + _NOISE)


def _mori_tanaka_moduli(radii: Array, phases: Sequence[AnyPhase]) -> Array:
    """C11 + C12, C11 − C12 and C33 of matrix and inclusion at radii, shape (n, 3)."""
    return mori_tanaka(np.pi / 4 * radii**2, *phases[:2])
