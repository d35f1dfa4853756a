"""Segmentation of a grey image, and the pixels whose class noise and uneven light leave open.

A pixel's grey value is modelled as the level of its class, plus a light that changes slowly over
the image (a polynomial of degree two), plus noise. The model is fitted to the segmented image and
its classes are assigned anew until nothing changes. A pixel may belong to either side of a
threshold where its grey value is nearer to it than `CONFIDENT` deviations of the noise and the
light there. Texture of the phases counts as noise.

Grey values that are clipped hide noise and light, so that no judgement holds: an image is refused
where the values of a class pile up at an end, or one class is flat beside another one that is not.
Clipped until both are flat, an image looks like a clean one and is taken for it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, median_filter, minimum_filter, percentile_filter

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError, require

CONFIDENT = 3.0  # deviations of the noise
MAX_OPEN = 0.15  # area that may be open, over that of the smallest class
_MAX_ITERATIONS = 20
_OF_NORMAL = 1.4826  # deviation of a normal law over the median of its magnitude
_NEAR = 3.0  # deviations within which a pixel helps to fit levels and light
_BORDER = 3  # pixels from a border that do not help, if
_ENOUGH = 0.1  # of each class is farther from it
_NOISE_QUANTILE = 0.9  # of the residuals; rounding makes up to half of them zero
_EXACT = 1e-9  # of the grey values: noise that is rounding
_MIN_PILE, _STEEPEST = 0.01, 3.0  # share at an end, and over that of the next value, if clipped
_FLAT = 0.95  # of a class at one value; where particles meet, a blurred image has others
_MAX_FLAT, _FLAT_GAP = 3, 0.05  # greys of a clean class, and least gap over the contrast
MIN_IMPULSES = 0.01
"""Share of pixels that are impulses from which on they count; noise alone has 0.003."""
_AROUND = 7  # pixels around; a line has 7 of 49
_PERCENTILES_AROUND = 15, 85
_MIN_PIXELS = 50  # of a class whose grey values are checked for clipping
_MEDIAN = 5  # pixels of the median filter of the classes


@dataclass(frozen=True, eq=False)
class Segmentation:
    """Grey classes of an image, and which pixels may belong to another class.

    Args:
        grey: Grey values that are segmented, shape (rows, columns).
        thresholds: Grey values between the classes, rising; a pixel is of class k if k of them are
            at or below its grey value.
        levels: Grey value of each class under mean light.
        light: What the light adds to each pixel, of mean zero, shape (rows, columns).
        noise: Standard deviation of the residuals, in grey values.
        is_impulse: Pixels that are salt, pepper or scratches, which may be of any class.
    """

    grey: Array
    thresholds: tuple[float, ...]
    levels: Array
    light: Array
    noise: float
    is_impulse: Mask

    @property
    def drift(self) -> float:
        """Range of the light over the image, in grey values."""
        return float(np.ptp(self.light))

    @property
    def fractions(self) -> Array:
        """Area fraction of each class, shape (classes,)."""
        labels = np.searchsorted(self.thresholds, self.grey, side="right")
        return np.bincount(labels.ravel(), minlength=self.levels.size) / labels.size

    @property
    def open_fraction(self) -> float:
        """Fraction of the area whose pixels may be of another class."""
        first, last = self.ranges()
        return float(np.mean(first < last))

    def ranges(self) -> tuple[Ints, Ints]:
        """Least and greatest class that each pixel may be of, shape (rows, columns) each.

        The grey value is varied by `CONFIDENT` deviations of the noise and by the light.
        """
        uncertainty = CONFIDENT * self.noise + np.abs(self.light)
        uncertainty = np.where(self.is_impulse, np.inf, uncertainty)
        first = np.searchsorted(self.thresholds, self.grey - uncertainty, side="right")
        last = np.searchsorted(self.thresholds, self.grey + uncertainty, side="right")
        return first, last

    def require_certain(self, most: float = MAX_OPEN) -> None:
        """Refuse a segmentation whose open area is more than `most` times that of a class."""
        fraction = self.open_fraction / float(self.fractions.min())
        impulses = float(np.mean(self.is_impulse))
        value = (
            f"in doubt on {fraction:.1%} of the smallest phase, by noise of {self.noise:.3g} and"
            f" drift of light of {self.drift:.3g} grey levels"
        )
        if impulses:
            value += f", and by impulses or scratches on {impulses:.1%}"
        cure = "the how-to on images takes noise and light away by scikit-image"
        require(fraction <= most, "threshold", value=value, allowed=f"up to {most:.0%}", cure=cure)


def segment(grey: Array, thresholds: Sequence[float]) -> Segmentation:
    """Segment a grey image: classes, light, noise, and pixels that may be of another class.

    Levels, light and noise are fitted and classes assigned in turn, until no class changes.

    Args:
        grey: Grey values, shape (rows, columns).
        thresholds: Grey values between the classes, rising.

    Raises:
        RefusedError: A class has no pixel, or grey values are clipped.
    """
    values, borders = np.asarray(grey, float), tuple(map(float, thresholds))
    y, x = np.meshgrid(*(np.linspace(-1, 1, count) for count in values.shape), indexing="ij")
    polynomials = np.stack([x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 5)  # of the light
    polynomials -= polynomials.mean(axis=0)
    light, last_labels = np.zeros_like(values), None
    for _ in range(_MAX_ITERATIONS):
        labels = np.searchsorted(borders, values - light, side="right")
        if last_labels is not None and np.array_equal(labels, last_labels):
            break
        levels, light, noise = _fit_light(values, labels, polynomials, len(borders) + 1)
        last_labels = labels
    impulses = _impulses(values - light, levels, noise)
    _require_unclipped(values, borders, ~impulses)
    return Segmentation(values, borders, levels, light, noise, impulses)


def _impulses(grey: Array, levels: Array, noise: float) -> Mask:
    """Mask of the pixels that are salt, pepper or scratches in an evenly lit image."""
    # beyond the noise of every class and of most pixels around, unlike those of a blurred border
    band = CONFIDENT * noise + _EXACT * float(np.abs(grey).max())
    is_outlier = np.abs(grey[..., None] - levels).min(axis=-1) > band
    low, high = (percentile_filter(grey, q, _AROUND, mode="wrap") for q in _PERCENTILES_AROUND)
    impulses = is_outlier & ((grey < low - band) | (grey > high + band))
    return np.asarray(impulses & (impulses.mean() >= MIN_IMPULSES))


def _require_unclipped(values: Array, borders: tuple[float, ...], sound: Mask) -> None:
    """Refuse an image of which a class piles up at an end of the values; `sound`: no impulses."""
    labels = median_filter(np.searchsorted(borders, values, side="right"), _MEDIAN, mode="wrap")
    interior = _interior(labels, _BORDER) & sound
    classes = [values[interior & (labels == k)] for k in range(len(borders) + 1)]
    classes = [grey for grey in classes if grey.size >= _MIN_PIXELS]
    flat = [_is_flat(grey, float(np.ptp(values[sound]))) for grey in classes]
    for end in (float(values[sound].min()), float(values[sound].max())):
        for grey, is_flat in zip(classes, flat, strict=True):
            distance, counts = np.unique(np.abs(grey - end), return_counts=True)
            pile = counts[0] / grey.size if distance[0] == 0 else 0.0
            next_value = counts[1] / grey.size if len(counts) > 1 else 0.0
            is_clipped = pile >= _MIN_PILE and pile > _STEEPEST * next_value
            if is_clipped and not (is_flat and all(flat)):  # all flat: a clean image
                what = f"{pile:.0%} of a phase at the end of the grey values, {end:g}"
                cure = "take the image before its contrast was raised, or give cell.labels"
                raise RefusedError("image", what, "grey values that are not clipped", cure)


def _is_flat(grey: Array, contrast: float) -> bool:
    """Whether a class has one grey value, or up to three distant ones, as in a clean image."""
    values, counts = np.unique(grey, return_counts=True)
    order = np.argsort(-counts)[:_MAX_FLAT]  # of the most frequent values
    fractions = counts[order] / grey.size
    are_distant = (np.diff(np.sort(values[order])) >= _FLAT_GAP * contrast).all()
    return bool(fractions[0] >= _FLAT or (are_distant and fractions.sum() >= _FLAT))


def _fit_light(
    values: Array, labels: Ints, shapes: Array, classes: int
) -> tuple[Array, Array, float]:
    """Fit levels (classes,), light (rows, columns) and noise by least squares without outliers."""
    inner = _inner_pixels(labels, classes).ravel()
    columns = np.hstack([labels.reshape(-1, 1) == np.arange(classes), shapes])
    flat, used = values.ravel(), inner
    rounding = _EXACT * float(np.abs(flat).max())
    for _ in range(3):
        fit = np.linalg.lstsq(columns[used], flat[used], rcond=None)[0]
        residual = np.abs(flat - columns @ fit)
        median, high = np.quantile(residual[inner], (0.5, _NOISE_QUANTILE))
        limit = max(_NEAR * _OF_NORMAL * float(median), float(high), rounding)
        used = inner & (residual <= limit)
    noise, light = float(np.sqrt(np.mean(residual[used] ** 2))), shapes @ fit[classes:]
    light[np.abs(light) < rounding] = 0.0
    return fit[:classes], light.reshape(values.shape), noise if noise > rounding else 0.0


def _inner_pixels(labels: Ints, classes: int) -> Mask:
    """Mask of pixels 3 pixels from other classes, or nearer until a tenth of each class is left."""
    counts = np.bincount(labels.ravel(), minlength=classes)
    value, allowed = "beyond the grey values of a class", "values that leave each class some pixels"
    require(counts.all(), "threshold", value=value, allowed=allowed)
    for reach in range(_BORDER, 0, -1):
        inner = _interior(labels, reach)
        if (np.bincount(labels[inner], minlength=classes) >= _ENOUGH * counts).all():
            return inner
    return np.ones(labels.shape, bool)


def _interior(labels: Ints, reach: int) -> Mask:
    """Mask of the pixels with no other class within `reach` pixels."""
    low, high = (f(labels, 2 * reach + 1, mode="wrap") for f in (minimum_filter, maximum_filter))
    return np.asarray(low == high)
