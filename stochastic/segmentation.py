"""Judgement of a segmentation: how far noise and uneven light leave it open.

A pixel's grey value is modelled as the level of its class, plus a light that changes slowly over
the image (a polynomial of degree two), plus noise. The model is fitted to the segmented image and
its classes are assigned anew until nothing changes. A pixel may belong to either side of a
threshold where its grey value is nearer to it than `CONFIDENT` deviations of the noise and the
light there. Texture of the phases counts as noise.

Smoothing is that of non-local means (Buades, Coll, Morel 2005), which keeps edges. What a second
pass would change once more, the first may have moved: that is in doubt besides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.fuzzy.refused import RefusedError

CONFIDENT = 3.0  # deviations of the noise
MOST_OPEN = 0.15  # area that may be open, over that of the smallest class
_TURNS = 20
_OF_NORMAL = 1.4826  # deviation of a normal law over the median of its magnitude
_NEAR = 3.0  # deviations within which a pixel helps to fit levels and light
_BORDER = 3  # pixels from a border that do not help, if
_ENOUGH = 0.1  # of each class is farther from it
_MOST = 0.9  # of the pixels, whose rest is noise: of rounded grey values half may have none
_EXACT = 1e-9  # of the grey values: noise that is rounding
_PATCH, _REACH = 5, 7  # pixels of a neighbourhood, and to those that it is compared with
_STRENGTH = 0.8  # of the smoothing, over the noise


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Grey classes of an image, and where they are in doubt.

    Args:
        grey: Grey values that are segmented, shape (rows, columns).
        thresholds: Values that part the classes, rising; a pixel is of class k if k of them are at
            or below its grey value.
        levels: Grey value of each class under mean light.
        light: What the light adds to each pixel, of mean zero, shape (rows, columns).
        noise: Standard deviation of the rest, in grey values.
        moved: What smoothing may have moved each grey value by.
    """

    grey: Array
    thresholds: tuple[float, ...]
    levels: Array
    light: Array
    noise: float
    moved: Array | float = 0.0

    @property
    def drift(self) -> float:
        """Range of the light over the image, in grey values."""
        return float(np.ptp(self.light))

    @property
    def separation(self) -> float:
        """Least distance of a class's level from a threshold, over the noise."""
        distance = np.abs(self.levels[:, None] - np.array(self.thresholds)).min()
        return float(distance / self.noise) if self.noise else np.inf

    @property
    def middles(self) -> tuple[float, ...]:
        """Grey values half-way between the levels of neighbouring classes."""
        return tuple(float(value) for value in (self.levels[1:] + self.levels[:-1]) / 2)

    @property
    def fractions(self) -> Array:
        """Share of each class in the area, at the thresholds."""
        labels = np.searchsorted(self.thresholds, self.grey, side="right")
        return np.bincount(labels.ravel(), minlength=self.levels.size) / labels.size

    @property
    def open(self) -> float:
        """Share of the area that may be of another class."""
        first, last = self.ranges()
        return float(np.mean(first < last))

    def ranges(self) -> tuple[Rows, Rows]:
        """Least and greatest class that each pixel may be of, shape (rows, columns) each."""
        doubt = CONFIDENT * self.noise + np.abs(self.light) + self.moved
        first, last = (
            np.searchsorted(self.thresholds, self.grey + sign * doubt, side="right")
            for sign in (-1, 1)
        )
        return first, last

    def require(self, most: float = MOST_OPEN) -> None:
        """Refuses a segmentation whose fractions depend too much on where the threshold lies.

        Raises:
            RefusedError: More is open than `most` of the smallest class's area.
        """
        share = self.open / float(self.fractions.min())
        if share > most:
            raise RefusedError(
                "threshold",
                f"in doubt on {share:.1%} of the smallest phase, by noise of {self.noise:.3g} and"
                f" drift of light of {self.drift:.3g} grey levels",
                f"up to {most:.0%}",
                "smooth the image, level its light, or take a better one",
            )


def segmented(
    grey: Array, thresholds: Sequence[float], *, smooth: bool = False, level: bool = False
) -> Segmentation:
    """The classes of an image.

    Args:
        grey: Grey values, shape (rows, columns).
        thresholds: Values that part the classes, rising.
        smooth: Take the noise away first.
        level: Take the light's drift away first; the thresholds, which were read off the uneven
            image, then give way to the `middles` of the even one.

    Raises:
        RefusedError: A class has no pixel.
    """
    values, borders = np.asarray(grey, float), tuple(map(float, thresholds))
    moved: Array | float = 0.0
    if level:
        values = values - _judged(values, borders).light
        borders = _judged(values, borders).middles
    if smooth and (noise := _judged(values, borders).noise):
        values = _smoothed(values, noise)
        moved = np.abs(values - _smoothed(values, noise))
    judged = _judged(values, borders)
    return Segmentation(values, borders, judged.levels, judged.light, judged.noise, moved)


def _judged(values: Array, borders: tuple[float, ...]) -> Segmentation:
    """The image as it is."""
    shapes, light, before = _polynomials(values.shape), np.zeros_like(values), None
    for _ in range(_TURNS):
        labels = np.searchsorted(borders, values - light, side="right")
        if before is not None and np.array_equal(labels, before):
            break
        levels, light, noise = _fitted(values, labels, shapes, len(borders) + 1)
        before = labels
    return Segmentation(values, borders, levels, light, noise)


def _smoothed(grey: Array, noise: float) -> Array:
    """The image by non-local means, as if it repeated itself."""
    from skimage import restoration

    edge = _PATCH + _REACH
    around = np.pad(grey, edge, mode="wrap")
    whole = restoration.denoise_nl_means(
        around, patch_size=_PATCH, patch_distance=_REACH, h=_STRENGTH * noise, sigma=noise
    )
    return np.asarray(whole[edge:-edge, edge:-edge])


def _polynomials(shape: tuple[int, ...]) -> Array:
    """x, y, x², xy and y² of mean zero on the pixels, shape (pixels, 5)."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, count) for count in shape), indexing="ij")
    columns = np.stack([x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 5)
    return np.asarray(columns - columns.mean(axis=0))


def _fitted(values: Array, labels: Rows, shapes: Array, classes: int) -> tuple[Array, Array, float]:
    """Levels of the classes, light and noise, from pixels away from the borders."""
    inner = _inner(labels, classes).ravel()
    whole = np.hstack([labels.reshape(-1, 1) == np.arange(classes), shapes])
    flat, kept = values.ravel(), inner
    rounding = _EXACT * float(np.abs(flat).max())
    for _ in range(3):
        fit = np.linalg.lstsq(whole[kept], flat[kept], rcond=None)[0]
        rest = np.abs(flat - whole @ fit)
        middle, most = np.quantile(rest[inner], (0.5, _MOST))
        kept = inner & (rest <= max(_NEAR * _OF_NORMAL * float(middle), float(most), rounding))
    noise, light = float(np.sqrt(np.mean(rest[kept] ** 2))), shapes @ fit[classes:]
    light[np.abs(light) < rounding] = 0.0
    return fit[:classes], light.reshape(values.shape), noise if noise > rounding else 0.0


def _inner(labels: Rows, classes: int) -> Mask:
    """Pixels with none of another class near, as far as each class has some.

    Raises:
        RefusedError: A class has no pixel.
    """
    counts = np.bincount(labels.ravel(), minlength=classes)
    if not counts.all():
        allowed = "values that leave each class some pixels"
        raise RefusedError("threshold", "beyond the grey values of a class", allowed)
    for reach in range(_BORDER, 0, -1):
        low, high = (
            f(labels, 2 * reach + 1, mode="wrap") for f in (minimum_filter, maximum_filter)
        )
        inner = low == high
        if (np.bincount(labels[inner], minlength=classes) >= _ENOUGH * counts).all():
            return np.asarray(inner)
    return np.ones(labels.shape, bool)
