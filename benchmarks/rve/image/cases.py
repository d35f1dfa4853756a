"""Images for the measurements: discs that do not touch, smooth noise, moduli of their phases."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.side import DISPLACEMENT, STRESS, solve_side
from alphacut.rve.image.moduli import PlaneModuli
from alphacut.rve.image.windows import Tiling

Array = NDArray[np.float64]


def discs(
    size: int, *, number: int = 24, radius: float = 0.055, gap: float = 0.01, seed: int = 0
) -> NDArray[np.bool_]:
    """Periodic image of discs drawn one after another, shape (size, size); lengths per side."""
    rng = np.random.default_rng(seed)
    centres: list[Array] = []
    while len(centres) < number:
        place = rng.random(2)
        if all(np.hypot(*_between(place, c)) > 2 * radius + gap for c in centres):
            centres.append(place)
    places = (np.arange(size) + 0.5) / size
    mask = np.zeros((size, size), bool)
    for x, y in centres:
        mask |= _between(places, x) ** 2 + _between(places, y)[:, None] ** 2 < radius**2
    return mask


def _between(first: Array, second: Array | float) -> Array:
    """The shortest way between places on a circle of length 1."""
    return np.asarray((first - second + 0.5) % 1 - 0.5)


def noise(size: int, *, waves: float = 12.0, seed: int = 0) -> Array:
    """Smooth periodic noise, normal with mean 0 and variance 1, shape (size, size)."""
    rng = np.random.default_rng(seed)
    along, across = np.fft.fftfreq(size) * size, np.fft.rfftfreq(size) * size
    damping = np.exp(-((np.hypot(along[:, None], across) / waves) ** 2))
    values = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(size, size))) * damping, s=(size, size))
    return np.asarray((values - values.mean()) / values.std())


def phases_of(contrast: float, *, modulus: float = 20.0, poisson: float = 0.3) -> list[PlaneModuli]:
    """Matrix and particle of one Poisson's ratio."""
    return [PlaneModuli.of_young(e, poisson) for e in (modulus, contrast * modulus)]


def moduli_of(mask: Array | NDArray[np.bool_], phases: list[PlaneModuli]) -> tuple[Array, Array]:
    """K + G/3 and G of each pixel; the mask tells the second phase."""
    matrix, particle = phases
    return (
        np.where(mask, particle.bulk, matrix.bulk),
        np.where(mask, particle.shear, matrix.shear),
    )


def solve_tiles(bulk: Array, shear: Array) -> Tiling:
    """Bounds of tiles of moduli, shape (tiles, rows, columns), under either uniform condition."""
    stiffness, compliance = (
        solve_side(side, bulk, shear, solver=ConjugateGradient(), clamped=True).energy.upper
        for side in (DISPLACEMENT, STRESS)
    )
    return Tiling(stiffness, compliance)
