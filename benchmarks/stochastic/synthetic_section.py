"""Sections with touching and overlapping discs, and the grey images of them in a microscope."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from alphacut.stochastic.theta.truncated_normal import Array

TRIES = 4000
ATTACHED = 0.3  # share of the tries that put a disc against another one
SUPERSAMPLED = 3  # points along each side of a pixel


@dataclass(frozen=True)
class Section:
    """Discs of a square that repeats itself.

    Args:
        centres: shape (n, 2), in sides of the square.
        radii: shape (n,), in sides of the square.
    """

    centres: Array
    radii: Array

    def mask(self, size: int) -> NDArray[np.bool_]:
        """Points inside a disc at the middles of size × size pixels, row 0 at y = 0."""
        inside = np.zeros((size, size), bool)
        for (x, y), radius in zip(self.centres, self.radii, strict=True):
            reach = int(radius * size) + 2
            rows, columns = (round(at * size) + np.arange(-reach, reach + 1) for at in (y, x))
            far = ((columns + 0.5) / size - x) ** 2 + ((rows + 0.5) / size - y)[:, None] ** 2
            inside[np.ix_(rows % size, columns % size)] |= far < radius**2
        return inside

    def share(self, size: int) -> Array:
        """Share of each pixel that discs cover, shape (size, size), row 0 at y = 0."""
        fine = self.mask(SUPERSAMPLED * size)
        return np.asarray(
            fine.reshape(size, SUPERSAMPLED, size, SUPERSAMPLED).mean((1, 3), dtype=float)
        )


def overlapping_discs(
    generator: np.random.Generator, count: int, fraction: float, *, overlap: float, spread: float
) -> Section:
    """Discs put one after another, the largest first, at random or against one that is there.

    Args:
        generator: Source of chance.
        count: Number of discs.
        fraction: Sum of their areas.
        overlap: Greatest overlap of two, over the smaller radius.
        spread: Standard deviation of the logarithm of the radii.

    Raises:
        RuntimeError: A disc finds no place.
    """
    radii = np.sort(np.exp(spread * generator.standard_normal(count)))[::-1]
    radii *= np.sqrt(fraction / np.pi / (radii**2).sum())
    centres: Array = np.zeros((0, 2))
    for radius in radii:
        there = radii[: len(centres)]
        for _ in range(TRIES):
            place = _place(generator, centres, there, radius, overlap)
            apart = np.hypot(*_across(centres - place).T) - there - radius
            if (apart >= -(overlap + 1e-9) * np.minimum(there, radius)).all():
                centres = np.vstack([centres, place])
                break
        else:
            raise RuntimeError(f"disc {len(centres) + 1} of {count} found no place")
    return Section(centres, radii)


def _place(
    generator: np.random.Generator, centres: Array, radii: Array, radius: float, overlap: float
) -> Array:
    if len(centres) == 0 or generator.random() > ATTACHED:
        return generator.random(2)
    other, angle = generator.integers(len(centres)), generator.uniform(0, 2 * np.pi)
    shared = overlap * generator.random() * min(radii[other], radius)
    away = (radii[other] + radius - shared) * np.array([np.cos(angle), np.sin(angle)])
    return np.asarray((centres[other] + away) % 1)


def _across(step: Array) -> Array:
    """The shortest way, across the sides where that is shorter."""
    return np.asarray((step + 0.5) % 1 - 0.5)


def micrograph(
    share: Array,
    generator: np.random.Generator,
    *,
    dark: bool,
    blur: float,
    noise: float,
) -> NDArray[np.uint8]:
    """8-bit image of a section, row 0 at the top.

    Args:
        share: Share of each pixel that particles cover, row 0 at the bottom.
        generator: Source of chance.
        dark: Whether the particles are the dark phase.
        blur: Standard deviation of the optics, in pixels.
        noise: Standard deviation of the grey value over the contrast.
    """
    from scipy import ndimage

    grey = ndimage.gaussian_filter(1 - share if dark else share, blur, mode="wrap")
    grey = grey + noise * generator.standard_normal(grey.shape)
    return np.asarray(np.clip(np.rint(70 + 110 * grey), 0, 255)[::-1], np.uint8)
