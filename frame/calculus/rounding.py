"""Bounds of rounding: the unit roundoff u and γ_n (Higham 2002, section 3.1)."""

from __future__ import annotations

import numpy as np

UNIT_ROUNDOFF = float(np.finfo(float).eps) / 2
"""u, the largest relative error of one rounded operation."""


def gamma(count: int) -> float:
    """γ_n = n u / (1 − n u), bound of the relative error of n roundings, in any order of a sum."""
    return count * UNIT_ROUNDOFF / (1 - count * UNIT_ROUNDOFF)
