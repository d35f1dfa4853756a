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
) -> Complex:
    """R, dR/dλ and d²R/dλ² of a mode at one node per point, shape (3, N), complex.

    What windows leave behind is carried from one to the next, and from a point to the next one of
    the same λ at a later node.

    Args:
        rate: λ, shape (N,), complex.
        node: Node of each point, shape (N,).
        middle: λ about which the series are.
        scale: Unit of the series' variable, in 1/s.
        moment: Coefficients at the nodes, shape (T, order), complex.
        ends: Last node of each window but the last, rising.
        time: Nodes, shape (T,), in s.
    """
    out = np.zeros((3, len(rate)), np.complex128)
    R, slope, curve, here, w = 0j, 0j, 0j, 0, 0
    for p in range(len(rate)):
        if p == 0 or rate[p] != rate[p - 1] or node[p] < node[p - 1]:
            R, slope, curve, here, w = 0j, 0j, 0j, 0, 0
        x = (rate[p] - middle) / scale
        while True:
            last = w == len(ends) or ends[w] >= node[p]
            end = node[p] if last else ends[w]
            tau = time[end] - time[here]
            f, g, h = 0j, 0j, 0j  # Horner's scheme, twice differentiated
            for i in range(moment.shape[1] - 1, -1, -1):
                h = h * x + g
                g = g * x + f
                f = f * x + moment[end, i]
            wave = np.exp(rate[p] * tau)
            f += wave * R
            g = g / scale + wave * (slope + tau * R)
            h = 2 * h / scale**2 + wave * (curve + 2 * tau * slope + tau * tau * R)
            if last:
                out[0, p], out[1, p], out[2, p] = f, g, h
                break
            R, slope, curve, here, w = f, g, h, end, w + 1
    return out
