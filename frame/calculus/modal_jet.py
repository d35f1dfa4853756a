"""Values of modes with gradients and Hessians, composed of polynomials and waves."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from alphacut.frame.calculus.c_library import FUSED, address, c_library
from alphacut.frame.calculus.jet import Array
from alphacut.frame.calculus.polynomial import Polynomial

SOURCE = Path(__file__).with_name("modal_jet.c").read_text(encoding="utf-8")
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
    if not _compiled(parts, place, waves, out):
        _by_numpy(parts, place, waves, out)


def _compiled(parts: Parts, place: int, waves: Parts, out: Parts) -> bool:
    library = c_library(SOURCE, FUSED)
    if library is None:
        return False
    (count, d), n = out[1].shape, waves[0].shape[1]
    sizes = map(ctypes.c_int, (d, n, parts[0].shape[1], place * n))
    given = [np.ascontiguousarray(x).view(float) for x in (*parts, np.stack(waves))]
    library.modal_jet(ctypes.c_long(count), *sizes, *map(address, (*given, *out)))
    return True


def _by_numpy(parts: Parts, place: int, waves: Parts, out: Parts) -> None:
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


def packed(given: Polynomial) -> Array:
    """Coefficients of quadratics in planes, real and imaginary, (K, 2, 1 + d + d²)."""
    d, K = given.index.shape[1], given.coefficients.shape[1]
    bent = given.curve[:, :, 0].reshape(d * d, K)
    whole = np.concatenate([given.coefficients[:1], given.slope[:, 0], bent]).T
    return np.ascontiguousarray(np.stack([whole.real, whole.imag], 1))


def quadratics(given: Polynomial, planes: Array, unit: Array) -> tuple[Array, Array]:
    """Values (N, K) of complex polynomials of degree 2 or less, and their first derivatives.

    Args:
        given: The polynomials.
        planes: Their `packed` form.
        unit: Points, shape (N, d).

    Returns:
        Values, and first derivatives in planes, shape (N, K, 2, d), for compiled code alone.
    """
    library = c_library(SOURCE, FUSED)
    if library is None:
        return given.quadratic(unit)[0], np.empty(0)
    (count, d), K = unit.shape, len(planes)
    out, first = np.empty((count, K), complex), np.empty((count, K, 2, d))
    sizes = ctypes.c_long(count), ctypes.c_int(d), ctypes.c_int(K)
    points = np.ascontiguousarray(unit, float)
    library.quadratic_values(*sizes, *map(address, (points, planes, out.view(float), first)))
    return out, first


def composed_quadratics(
    unit: Array,
    rate: tuple[Polynomial, Array, Array],
    shares: tuple[Sequence[Polynomial], Array],
    output: Array,
    waves: Parts,
    out: Parts,
) -> None:
    """As `composed`, of polynomials of degree 2 or less.

    Args:
        unit: Points, shape (N, d).
        rate: λ_k, n polynomials, their `packed` form, and first derivatives as of `quadratics`.
        shares: C_k of each output, and their `packed` forms, shape (m, n, 2, 1 + d + d²).
        output: Which C_k, shape (N,).
        waves: w, w' and w'' at λ_k, each (N, n).
        out: What is added to.
    """
    library, (count, d), n = c_library(SOURCE, FUSED), unit.shape, waves[0].shape[1]
    if library is not None:
        points, which = (np.ascontiguousarray(x, float) for x in (unit, output))
        given = (points, rate[1], rate[2], shares[1], which, np.stack(waves).view(float), *out)
        sizes = ctypes.c_long(count), ctypes.c_int(d), ctypes.c_int(n)
        if library.quadratic_jet(*sizes, *map(address, given)):
            return
    _, slope, bent = rate[0].quadratic(unit)
    for o in np.unique(output):
        rows = np.flatnonzero(output == o)
        own = waves[0][rows], waves[1][rows], waves[2][rows]
        found = _quadratics_by_numpy(unit[rows], (slope[rows], bent), shares[0][o], own)
        for total, part in zip(out, found, strict=True):
            total[rows] += part


def _quadratics_by_numpy(
    unit: Array, slopes: tuple[Array, Array], own: Polynomial, waves: Parts
) -> Parts:
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
