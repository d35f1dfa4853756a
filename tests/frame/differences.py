"""Derivatives of jets beside quotients of differences."""

import numpy as np


def require_derivatives(taylor, point, shares, within):
    """Requires that derivatives of a jet at a point (d,) are those of its values and slopes.

    `taylor` gives a jet at one point (1, d). Differences are over `shares` of the parameters, and
    `within` are those by which first and second derivatives may be off, of one parameter's largest.
    """
    jet = taylor(point[None]).rescaled(point)
    for i, move in enumerate(np.diag(shares * point)):
        moved = [taylor((point + k * move)[None]).rescaled(point) for k in (-2, -1, 1, 2)]
        for order, found in enumerate((jet.first[i], jet.second[i])):
            a, b, c, d = ((x.value, x.first)[order] for x in moved)
            quotient = (a - 8 * b + 8 * c - d) / (12 * shares[i])
            assert np.abs(found - quotient).max() <= within[order] * np.abs(quotient).max()
