"""Values of modes with gradients and Hessians, composed of polynomials and waves."""

from __future__ import annotations

import ctypes
from pathlib import Path

import numpy as np

from alphacut.frame.calculus.c_library import address, c_library
from alphacut.frame.calculus.jet import Array

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
    library = c_library(SOURCE)
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
