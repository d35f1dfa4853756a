"""Slow light of a micrograph: surfaces that the grey values of both phases follow over the image.

Grey values are L(x, y) + m C(x, y), where m is 1 in the bright phase and 0 in the other. The
polynomials L and C are fitted to pixels away from the phases' edges, and the phases are parted anew
half-way between both, in turns, first with few terms, which a wrong first guess bends little.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from alphacut.stochastic.theta.law import Array

Mask = NDArray[np.bool_]
DEGREES = (2, 4, 6, 8)  # of the light, one after the other, `ROUNDS` of each
SLOPES = 2  # degree of the contrast over the image
ROUNDS = 6
PIXELS = 30_000  # that a fit takes
STILL = 1e-4  # share of the pixels that may change phase in the last round
LEAST_PHASE = 0.02  # share of the image; less is no phase, and nothing is evened
LEAST_CONTRAST = 0.2  # of its median, where it is extrapolated
TAIL = 0.005  # share of the pixels at either end that the range of the light leaves out


def evened(smooth: Array, bright: Mask, core: Callable[[Mask], Mask]) -> tuple[Array, float]:
    """Image from 0 (dark phase) to 1 (bright) without light; the light over the contrast, or 0.

    `bright` is a first guess, `core` gives the pixels of a phase away from its edge.
    """
    flat, light = smooth, 0.0
    slopes = _terms(smooth.shape, SLOPES)
    for degree in DEGREES:
        terms = _terms(smooth.shape, degree)
        for _ in range(ROUNDS):
            if not LEAST_PHASE < bright.mean() < 1 - LEAST_PHASE:
                return smooth, 0.0
            flat, light = _without_light(smooth, core(bright), core(~bright), terms, slopes)
            before, bright = bright, flat > 0.5
            if (before != bright).mean() < STILL:
                break
    return flat, light


def _terms(shape: tuple[int, ...], degree: int) -> Array:
    """Products of Legendre polynomials up to a total degree, shape (terms, rows, columns)."""
    rows, columns = (legvander(np.linspace(-1, 1, count), degree) for count in shape)
    powers = [(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]
    return np.array([np.outer(rows[:, i], columns[:, j]) for i, j in powers])


def _without_light(
    smooth: Array, bright: Mask, dark: Mask, terms: Array, slopes: Array
) -> tuple[Array, float]:
    """Least squares over the cores of both phases."""
    taken = np.flatnonzero(bright | dark)
    taken = taken[:: len(taken) // PIXELS + 1]
    light, slope = (each.reshape(len(each), -1)[:, taken] for each in (terms, slopes))
    rows = np.concatenate([light, slope * bright.flat[taken]])
    found = np.linalg.lstsq(rows.T, smooth.flat[taken], rcond=None)[0]
    surface = np.tensordot(found[: len(terms)], terms, 1)
    contrast = np.tensordot(found[len(terms) :], slopes, 1)
    middle = float(np.median(contrast))
    low, high = np.quantile(surface.flat[taken], (TAIL, 1 - TAIL))
    return (smooth - surface) / np.maximum(contrast, LEAST_CONTRAST * middle), (high - low) / middle
