"""Sums of a load table's series over its windows, compiled by Numba."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from alphacut.fuzzy.arrays import Array, Rows

Complex = NDArray[np.complex128]


@njit(cache=True, nogil=True, error_model="numpy")
def window_series(
    rate: Complex,
    node: Rows,
    middle: complex,
    scale: float,
    moment: Complex,
    ends: Rows,
    time: Array,
    fade: float,
) -> Complex:
    """R, dR/dλ and d²R/dλ² of a mode at one node per point, shape (3, N), complex.

    Args:
        rate: λ, shape (N,), complex.
        node: Node of each point, shape (N,).
        middle: λ about which the series are.
        scale: Unit of the series' variable, in 1/s.
        moment: Coefficients at the nodes, shape (T, order), complex.
        ends: Last node of each window but the last, rising.
        time: Nodes, shape (T,), in s.
        fade: Time after which nothing is left of a window, in s.
    """
    out = np.zeros((3, len(rate)), np.complex128)
    for p in range(len(rate)):
        x = (rate[p] - middle) / scale
        for w in range(-1, len(ends)):
            end = node[p] if w < 0 else ends[w]
            tau = time[node[p]] - time[end]
            if w >= 0 and tau <= 0:
                break
            if tau >= fade:
                continue
            f, g, h = 0j, 0j, 0j  # Horner's scheme, twice differentiated
            for i in range(moment.shape[1] - 1, -1, -1):
                h = h * x + g
                g = g * x + f
                f = f * x + moment[end, i]
            g, h = g / scale, 2 * h / scale**2
            wave = np.exp(rate[p] * tau)
            out[0, p] += wave * f
            out[1, p] += wave * (g + tau * f)
            out[2, p] += wave * (h + 2 * tau * g + tau * tau * f)
    return out
