"""Segmentation of a grey image, and the pixels whose class noise and uneven light leave open.

A pixel's grey value is modelled as the level of its class, plus a light that changes slowly over
the image (a polynomial of degree two), plus noise. The model is fitted to the segmented image and
its classes are assigned anew until nothing changes. A pixel may belong to either side of a
threshold where its grey value is nearer to it than `CONFIDENT` deviations of the noise and the
light there. Texture of the phases counts as noise.

Grey values that are clipped hide noise and light, so that no judgement holds: an image is refused
where the values of a class pile up at an end, or one class is flat beside another one that is not.
Clipped until both are flat, an image looks like a clean one and is taken for it.

Smoothing is that of non-local means (Buades, Coll, Morel 2005), which keeps edges. In doubt besides
is what a second pass would change once more, or one deviation of the noise that smoothing leaves
(measured by adding half as much noise again), whichever is more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import (
    maximum_filter,
    median_filter,
    minimum_filter,
    percentile_filter,
    uniform_filter,
)

from alphacut.fuzzy.arrays import Array, Mask, Rows
from alphacut.fuzzy.refused import RefusedError, require

CONFIDENT = 3.0  # deviations of the noise
MOST_OPEN = 0.15  # area that may be open, over that of the smallest class
_MAX_ITERATIONS = 20
_OF_NORMAL = 1.4826  # deviation of a normal law over the median of its magnitude
_NEAR = 3.0  # deviations within which a pixel helps to fit levels and light
_BORDER = 3  # pixels from a border that do not help, if
_ENOUGH = 0.1  # of each class is farther from it
_NOISE_QUANTILE = 0.9  # of the residuals; rounding makes up to half of them zero
_EXACT = 1e-9  # of the grey values: noise that is rounding
_LEAST_PILE, _STEEPEST = 0.01, 3.0  # share at an end, and over that of the next value, if clipped
_FLAT = 0.95  # of a class at one value; where particles meet, a blurred image has others
_MAX_FLAT, _FLAT_GAP = 3, 0.05  # greys of a clean class, and least gap over the contrast
MIN_IMPULSES = 0.01
"""Share of pixels that are impulses from which on they count; noise alone has 0.003."""
_AROUND, _MOST_AROUND = 7, (15, 85)  # pixels around, and percentiles; a line has 7 of 49 pixels
_MIN_PIXELS = 50  # of a class whose grey values are checked for clipping
_PATCH, _REACH = 5, 7  # pixels of a neighbourhood, and to those that it is compared with
_NOISE_SAMPLES = 4  # of added noise, to measure how much of it smoothing leaves
_STRENGTH = 0.8  # of the smoothing, over the noise


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
        smoothing_error: Uncertainty of each grey value from smoothing; infinite at impulses and
            scratches.
    """

    grey: Array
    thresholds: tuple[float, ...]
    levels: Array
    light: Array
    noise: float
    smoothing_error: Array | float = 0.0

    @property
    def drift(self) -> float:
        """Range of the light over the image, in grey values."""
        return float(np.ptp(self.light))

    @property
    def level_midpoints(self) -> tuple[float, ...]:
        """Grey values half-way between the levels of neighbouring classes."""
        return tuple(float(value) for value in (self.levels[1:] + self.levels[:-1]) / 2)

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

    def ranges(self) -> tuple[Rows, Rows]:
        """Least and greatest class that each pixel may be of, shape (rows, columns) each.

        The grey value is varied by `CONFIDENT` deviations of the noise, by the light and by the
        uncertainty from smoothing.
        """
        uncertainty = CONFIDENT * self.noise + np.abs(self.light) + self.smoothing_error
        first = np.searchsorted(self.thresholds, self.grey - uncertainty, side="right")
        last = np.searchsorted(self.thresholds, self.grey + uncertainty, side="right")
        return first, last

    def require_certain(self, most: float = MOST_OPEN) -> None:
        """Refuse a segmentation with too much uncertain area beside that of the smallest class.

        Args:
            most: Largest allowed uncertain area, as a fraction of the smallest class's.
        """
        fraction = self.open_fraction / float(self.fractions.min())
        impulses = float(np.mean(np.isinf(self.smoothing_error)))
        value = (
            f"in doubt on {fraction:.1%} of the smallest phase, by noise of {self.noise:.3g} and"
            f" drift of light of {self.drift:.3g} grey levels"
        )
        if impulses:
            value += f", and by impulses or scratches on {impulses:.1%}"
        cure = 'remove = ["noise", "light"] takes noise and the drift of light away'
        require(fraction <= most, "threshold", value=value, allowed=f"up to {most:.0%}", cure=cure)


def segment(
    grey: Array, thresholds: Sequence[float], *, smooth: bool = False, level: bool = False
) -> Segmentation:
    """Segment a grey image: classes, light, noise, and the uncertainty of each pixel.

    Args:
        grey: Grey values, shape (rows, columns).
        thresholds: Grey values between the classes, rising.
        smooth: Remove noise first.
        level: Remove the drift of the light first; the thresholds, which were read off the uneven
            image, are replaced by the `level_midpoints` of the even one.

    Raises:
        RefusedError: A class has no pixel, or grey values are clipped.
    """
    values, borders = np.asarray(grey, float), tuple(map(float, thresholds))
    impulses = _impulses(_classify(values, borders))
    _require_unclipped(values, borders, ~impulses)
    smoothing_error: Array | float = 0.0
    if level:
        values = values - _classify(values, borders).light
        borders = _classify(values, borders).level_midpoints
    if smooth and (noise := _classify(values, borders).noise):
        noisy, values = values, _denoise(values, noise)
        second_change = np.abs(values - _denoise(values, noise))
        smoothing_error = np.maximum(second_change, _remaining_noise(noisy, values, noise))
    return replace(
        _classify(values, borders), smoothing_error=np.where(impulses, np.inf, smoothing_error)
    )


def _impulses(image: Segmentation) -> Mask:
    """Mask of the pixels that are salt, pepper or scratches, shape (rows, columns).

    Their grey values lie beyond the noise of every class and of most pixels around them, unlike
    those of a blurred border. If they are less than `MIN_IMPULSES` of the image there are none.
    """
    grey = image.grey - image.light
    band = CONFIDENT * image.noise + _EXACT * float(np.abs(grey).max())
    is_outlier = np.abs(grey[..., None] - image.levels).min(axis=-1) > band
    low, high = (percentile_filter(grey, q, _AROUND, mode="wrap") for q in _MOST_AROUND)
    impulses = is_outlier & ((grey < low - band) | (grey > high + band))
    return np.asarray(impulses & (impulses.mean() >= MIN_IMPULSES))


def _require_unclipped(values: Array, borders: tuple[float, ...], sound: Mask) -> None:
    """Refuse an image whose grey values are clipped: a class piles up at an end of the values.

    Args:
        values: Grey values.
        borders: Thresholds between the classes.
        sound: Pixels that are no impulses.
    """
    labels = median_filter(np.searchsorted(borders, values, side="right"), _PATCH, mode="wrap")
    interior = _interior(labels, _BORDER) & sound
    classes = [values[interior & (labels == k)] for k in range(len(borders) + 1)]
    classes = [grey for grey in classes if grey.size >= _MIN_PIXELS]
    flat = [_is_flat(grey, float(np.ptp(values[sound]))) for grey in classes]
    for end in (float(values[sound].min()), float(values[sound].max())):
        for grey, is_flat in zip(classes, flat, strict=True):
            distance, counts = np.unique(np.abs(grey - end), return_counts=True)
            pile = counts[0] / grey.size if distance[0] == 0 else 0.0
            next_value = counts[1] / grey.size if len(counts) > 1 else 0.0
            is_clipped = pile >= _LEAST_PILE and pile > _STEEPEST * next_value
            if is_clipped and not (is_flat and all(flat)):  # all flat: a clean image
                what = f"{pile:.0%} of a phase at the end of the grey values, {end:g}"
                cure = "take the image before its contrast was raised, or give cell.labels"
                raise RefusedError("image", what, "grey values that are not clipped", cure)


def _is_flat(grey: Array, contrast: float) -> bool:
    """Whether a class has one grey value, or up to three distant ones, as in a clean image.

    Args:
        grey: Grey values of the pixels of a class, shape (n,).
        contrast: Range of the grey values of the image.
    """
    values, counts = np.unique(grey, return_counts=True)
    order = np.argsort(-counts)[:_MAX_FLAT]  # of the most frequent values
    fractions = counts[order] / grey.size
    are_distant = (np.diff(np.sort(values[order])) >= _FLAT_GAP * contrast).all()
    return bool(fractions[0] >= _FLAT or (are_distant and fractions.sum() >= _FLAT))


def _classify(values: Array, borders: tuple[float, ...]) -> Segmentation:
    """Fit levels, light and noise and assign the classes in turn, until no class changes."""
    polynomials = _polynomials(values.shape)  # of the light
    light, last_labels = np.zeros_like(values), None
    for _ in range(_MAX_ITERATIONS):
        labels = np.searchsorted(borders, values - light, side="right")
        if last_labels is not None and np.array_equal(labels, last_labels):
            break
        levels, light, noise = _fit_light(values, labels, polynomials, len(borders) + 1)
        last_labels = labels
    return Segmentation(values, borders, levels, light, noise)


def _denoise(grey: Array, noise: float) -> Array:
    """Remove the noise of an image by non-local means with periodic edges.

    Args:
        grey: Grey values, shape (rows, columns).
        noise: Standard deviation of the noise.
    """
    from skimage import restoration

    edge = _PATCH + _REACH
    padded = np.pad(grey, edge, mode="wrap")
    smooth = restoration.denoise_nl_means(
        padded, patch_size=_PATCH, patch_distance=_REACH, h=_STRENGTH * noise, sigma=noise
    )
    return np.asarray(smooth[edge:-edge, edge:-edge])


def _remaining_noise(noisy: Array, smooth: Array, noise: float) -> Array:
    """Standard deviation of the noise that smoothing leaves in each pixel, (rows, columns).

    Half as much noise again is added and its effect on the smoothed image measured nearby. Near
    borders few patches are alike, so that more is left than inside the classes.
    """
    rng = np.random.default_rng(0)
    squares = [
        (_denoise(noisy + noise / 2 * rng.normal(size=noisy.shape), noise) - smooth) ** 2
        for _ in range(_NOISE_SAMPLES)
    ]
    return np.asarray(2 * np.sqrt(uniform_filter(np.mean(squares, axis=0), 3, mode="wrap")))


def _polynomials(shape: tuple[int, ...]) -> Array:
    """x, y, x², xy and y² of mean zero on the pixels, shape (pixels, 5)."""
    y, x = np.meshgrid(*(np.linspace(-1, 1, count) for count in shape), indexing="ij")
    columns = np.stack([x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 5)
    return np.asarray(columns - columns.mean(axis=0))


def _fit_light(
    values: Array, labels: Rows, shapes: Array, classes: int
) -> tuple[Array, Array, float]:
    """Fit grey levels (classes,), light (rows, columns) and noise to a classified image.

    Least squares over pixels away from borders; outliers are left out in three passes.

    Args:
        values: Grey values, shape (rows, columns).
        labels: Class of each pixel.
        shapes: Polynomials of the light at the pixels, shape (pixels, 5).
        classes: Number of classes.
    """
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


def _inner_pixels(labels: Rows, classes: int) -> Mask:
    """Mask of pixels farther than 3 pixels from other classes, or as far as the classes allow.

    The distance is reduced until a tenth of each class is left.
    """
    counts = np.bincount(labels.ravel(), minlength=classes)
    value, allowed = "beyond the grey values of a class", "values that leave each class some pixels"
    require(counts.all(), "threshold", value=value, allowed=allowed)
    for reach in range(_BORDER, 0, -1):
        inner = _interior(labels, reach)
        if (np.bincount(labels[inner], minlength=classes) >= _ENOUGH * counts).all():
            return inner
    return np.ones(labels.shape, bool)


def _interior(labels: Rows, reach: int) -> Mask:
    """Mask of the pixels with no other class within `reach` pixels."""
    low, high = (f(labels, 2 * reach + 1, mode="wrap") for f in (minimum_filter, maximum_filter))
    return np.asarray(low == high)
