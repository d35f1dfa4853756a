"""Values of modes with gradients and Hessians, composed of polynomials and waves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial

Parts = tuple[Array, Array, Array]


def composed(parts: Parts, place: int, waves: Parts, out: Parts) -> None:
    """Add 2 Re Σ_k C_k w(λ_k) with gradient and Hessian to `out`, (N,), (N, d) and (N, d, d).

    Args:
        parts: Values (N, K), first (N, d, K) and second derivatives (N, pairs i ≤ j, K) of
            polynomials: λ_k in the first n columns, C_k in the n from `place` · n on.
        place: Which C_k.
        waves: w, w' and w'' at λ_k, each (N, n).
        out: What is added to.
    """
    (w, dw, ddw), d = waves, out[1].shape[1]
    n = w.shape[1]
    (own, share, bent), (_, rate, turned) = (
        [x[..., k * n : (k + 1) * n] for x in parts] for k in (place, 0)
    )
    inner = own * dw
    out[0][:] += 2 * (own * w).real.sum(1)
    out[1][:] += 2 * (share * w[:, None] + inner[:, None] * rate).real.sum(2)
    first, second = np.triu_indices(d)
    crossed = share[:, first] * rate[:, second] + share[:, second] * rate[:, first]
    H = bent * w[:, None] + inner[:, None] * turned + dw[:, None] * crossed
    H = 2 * (H + (own * ddw)[:, None] * rate[:, first] * rate[:, second]).real.sum(2)
    out[2][:, first, second] += H
    out[2][:, second, first] = out[2][:, first, second]


def composed_quadratics(
    unit: Array,
    rate: Polynomial,
    shares: Sequence[Polynomial],
    output: Array,
    waves: Parts,
    out: Parts,
) -> None:
    """As `composed`, of polynomials of degree 2 or less.

    Args:
        unit: Points, shape (N, d).
        rate: λ_k, n polynomials.
        shares: C_k of each output.
        output: Which C_k, shape (N,).
        waves: w, w' and w'' at λ_k, each (N, n).
        out: What is added to.
    """
    _, slope, bent = rate.quadratic(unit)
    for o in np.unique(output):
        rows = np.flatnonzero(output == o)
        own = waves[0][rows], waves[1][rows], waves[2][rows]
        found = _quadratics(unit[rows], (slope[rows], bent), shares[o], own)
        for total, part in zip(out, found, strict=True):
            total[rows] += part


def _quadratics(unit: Array, slopes: tuple[Array, Array], own: Polynomial, waves: Parts) -> Parts:
    (slope, bent), (share, first, second), (w, dw, ddw) = slopes, own.quadratic(unit), waves
    f = 2 * (share * w).real.sum(1)
    g = 2 * (first * w[:, None] + slope * (share * dw)[:, None]).real.sum(2)
    crossed = first * dw[:, None] + slope * (share * ddw)[:, None] / 2
    H = 2 * _real_product(crossed, slope.swapaxes(1, 2))
    weight, all_bent = np.hstack([share * dw, w]), np.concatenate([bent, second], -1)
    curved = 2 * _real_product(weight, all_bent.reshape(-1, all_bent.shape[-1]).T)
    return f, g, H + H.swapaxes(1, 2) + curved.reshape(H.shape)


def _real_product(a: Array, b: Array) -> Array:
    """Real part of a @ b for complex arrays."""
    left, right = np.concatenate([a.real, -a.imag], -1), np.concatenate([b.real, b.imag], -2)
    return np.asarray(left @ right)
