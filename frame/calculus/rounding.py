"""Bounds of rounding: the unit roundoff u and γ_n (Higham 2002, section 3.1)."""

from __future__ import annotations

import numpy as np

# u, the largest relative error of one rounded operation: half the distance of 1 and the next
# number.
UNIT_ROUNDOFF = float(np.finfo(float).eps) / 2
# Roundings that a product of complex numbers has beyond those of a real one. Its relative error is
# at most √2 γ_2 ≤ γ_3 (Higham 2002, lemma 3.5).
COMPLEX_ROUNDINGS = 2


def gamma(count: int) -> float:
    """Return γ_n = n u / (1 − n u) for n = `count`, which must be far below 1/u.

    It bounds the relative error of n rounded operations in turn, and of a sum of n + 1 numbers of
    one sign in any order.
    """
    return count * UNIT_ROUNDOFF / (1 - count * UNIT_ROUNDOFF)
