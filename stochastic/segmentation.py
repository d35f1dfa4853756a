"""Segmentation of a grey image, and the pixels whose class noise and uneven light leave open.

A pixel's grey value is modelled as the level of its class, plus a light that changes slowly over
the image (a polynomial of degree two), plus noise. The model is fitted to the segmented image and
its classes are assigned anew until nothing changes. A pixel may belong to either side of a
threshold where its grey value is nearer to it than `CONFIDENT` standard deviations of the noise
and the light there. Texture of the phases counts as noise.

Grey values that are clipped hide noise and light, so that no judgement holds: an image is refused
where the values of a class pile up at an end, or one class is flat beside another one that is not.
Clipped until both are flat, an image looks like a clean one and is taken for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError, require

CONFIDENT = 3.0
"""Standard deviations of the noise within which a pixel may be of another class: a normal noise
leaves 0.3 % outside. A larger number leaves more pixels open."""


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
        """Return the lowest and the highest class that each pixel may be of, (rows, columns) each.

        The grey value is varied by three standard deviations of the noise and by the magnitude of
        the light. Salt, pepper and scratches may be of any class.
        """
        # The light counts in full, as if it had not been fitted: its polynomial may be wrong.
        uncertainty = CONFIDENT * self.noise + np.abs(self.light)
        uncertainty = np.where(self.is_impulse, np.inf, uncertainty)
        first = np.searchsorted(self.thresholds, self.grey - uncertainty, side="right")
        last = np.searchsorted(self.thresholds, self.grey + uncertainty, side="right")
        return first, last

    def require_certain(self, max_fraction: float = 0.15) -> None:
        """Raise for a segmentation that leaves too many pixels open.

        Args:
            max_fraction: Area of pixels that may be of another class, over the area of the smallest
                class.

        Raises:
            RefusedError: There are more open pixels.
        """
        # The smallest class changes most by the same number of pixels.
        fraction = self.open_fraction / float(self.fractions.min())
        impulses = float(np.mean(self.is_impulse))
        value = (
            f"in doubt on {fraction:.1%} of the smallest phase, by noise of {self.noise:.3g} and"
            f" drift of light of {self.drift:.3g} grey levels"
        )
        if impulses:
            value += f", and by impulses or scratches on {impulses:.1%}"
        cure = "the how-to on images takes noise and light away by scikit-image"
        is_certain = fraction <= max_fraction
        require(is_certain, "threshold", value, allowed=f"up to {max_fraction:.0%}", cure=cure)


def segment(grey: Array, thresholds: Sequence[float]) -> Segmentation:
    """Segment a grey image: classes, light, noise, and pixels that may be of another class.

    A grey value is modelled as the level of its class, plus a light that is a polynomial of degree
    two over the image, plus noise. Levels, light and noise are fitted and classes assigned in turn,
    until no class changes, at most 20 times.

    Args:
        grey: Grey values, finite, shape (rows, columns).
        thresholds: Grey values between the classes, rising, at least one; a pixel at a threshold is
            of the class above it.

    Raises:
        RefusedError: A class has no pixel, or the grey values of a class pile up at an end, where
            they were clipped.
    """
    values = np.asarray(grey, float)
    borders = tuple(map(float, thresholds))

    # Polynomials of degree two and mean zero, of which the light consists, shape (pixels, 5)
    coordinates = [np.linspace(-1, 1, count) for count in values.shape]
    y, x = np.meshgrid(*coordinates, indexing="ij")
    polynomials = np.stack([x, y, x * x, x * y, y * y], axis=-1).reshape(-1, 5)
    # A constant would be the same as levels that are all higher.
    polynomials -= polynomials.mean(axis=0)

    light = np.zeros_like(values)
    # The fit depends on the labels alone: once they repeat, nothing changes any more.
    last_labels = None
    for _ in range(20):
        labels = np.searchsorted(borders, values - light, side="right")
        if last_labels is not None and np.array_equal(labels, last_labels):
            break
        fit = _fit_light(values, labels, polynomials=polynomials, classes=len(borders) + 1)
        light = fit.light
        last_labels = labels
    impulses = _impulses(values - light, fit.levels, fit.noise)
    _require_unclipped(values, borders, ~impulses)
    return Segmentation(values, borders, fit.levels, light, fit.noise, impulses)


def _rounding(grey: Array) -> float:
    """Return the noise that is no more than rounding of some grey values."""
    return 1e-9 * float(np.abs(grey).max())


def _impulses(grey: Array, levels: Array, noise: float) -> Mask:
    """Return which pixels are salt, pepper or scratches, shape (rows, columns).

    An impulse differs by more than three standard deviations of the noise from the level of every
    class, and from most of the 7 × 7 pixels around it. Pixels of a blurred border differ from the
    levels only. Noise alone makes 0.3 % of the pixels differ, so no pixel is an impulse if fewer
    than 1 % would be. The image is taken as periodic.

    Args:
        grey: Grey values of an evenly lit image, shape (rows, columns).
        levels: Grey value of each class, shape (classes,).
        noise: Standard deviation of the noise, in grey values.
    """
    band = CONFIDENT * noise + _rounding(grey)
    is_outlier = np.abs(grey[..., None] - levels).min(axis=-1) > band
    # A line takes 7 of the 49 pixels, 14 %, so that the percentiles 15 and 85 are greys beside it.
    impulses = np.zeros(grey.shape, bool)
    for place, (low, high) in _ranks(grey, is_outlier, 7, (0.15, 0.85)):
        values = grey[place]
        impulses[place] = (values < low - band) | (values > high + band)
    return np.asarray(impulses & (impulses.mean() >= 0.01))


def _ranks(
    values: Array, chosen: Mask, side: int, fractions: Sequence[float]
) -> Iterator[tuple[tuple[Ints, Ints], Array]]:
    """Yield values of given rank in the windows about some pixels, of an image that repeats itself.

    Args:
        values: The image, shape (rows, columns).
        chosen: Pixels whose windows are wanted, of the same shape.
        side: Pixels on a side of a window, odd.
        fractions: Ranks as fractions of the pixels of a window, in [0, 1), rounded down.

    Yields:
        For portions of the pixels, which fit into memory: their indices along both axes, and the
        values, shape (fractions, pixels).
    """
    ranks = [int(side**2 * fraction) for fraction in fractions]
    windows = sliding_window_view(np.pad(values, side // 2, mode="wrap"), (side, side))
    rows, columns = np.nonzero(chosen)
    for start in range(0, len(rows), 100_000):
        place = rows[start : start + 100_000], columns[start : start + 100_000]
        window = windows[place].reshape(-1, side**2)
        yield place, np.partition(window, ranks, axis=1)[:, ranks].T


def _require_unclipped(values: Array, borders: tuple[float, ...], sound: Mask) -> None:
    """Raise for an image of which a class piles up at an end of the grey values.

    A class is clipped if at least 1 % of its pixels have the lowest or highest grey value of the
    image, and more than three times as many as have the next value. Classes with fewer than 50
    pixels away from borders are not judged. A clean image, whose classes are all flat, passes.

    Args:
        values: Grey values, shape (rows, columns).
        borders: Grey values between the classes, rising.
        sound: Pixels that are no impulses, shape (rows, columns), at least one.

    Raises:
        RefusedError: A class is clipped.
    """
    # The median over 5 × 5 pixels takes noise off the classes. It is the pixel's own class where
    # these pixels have one class alone.
    labels = np.searchsorted(borders, values, side="right")
    noisy = labels.astype(float)
    for place, (median,) in _ranks(noisy, ~_interior(labels, reach=2), 5, (0.5,)):
        labels[place] = median
    interior = _interior(labels, reach=3) & sound
    classes = [values[interior & (labels == k)] for k in range(len(borders) + 1)]
    classes = [grey for grey in classes if grey.size >= 50]
    contrast = float(np.ptp(values[sound]))
    is_flat = [_is_flat(grey, contrast) for grey in classes]
    if all(is_flat):  # a clean image
        return
    # The histogram of a noisy class falls towards its end; clipping heaps its tail up there.
    for end in (float(values[sound].min()), float(values[sound].max())):
        for grey in classes:
            distance, counts = np.unique(np.abs(grey - end), return_counts=True)
            if distance[0] != 0:  # no pixel of the class is at this end
                continue
            at_end = counts[0] / grey.size
            next_to_end = counts[1:2].sum() / grey.size
            if at_end >= 0.01 and at_end > 3.0 * next_to_end:
                what = f"{at_end:.0%} of a phase at the end of the grey values, {end:g}"
                cure = "take the image before its contrast was raised, or give cell.labels"
                raise RefusedError("image", what, "grey values that are not clipped", cure)


def _is_flat(grey: Array, contrast: float) -> bool:
    """Return whether a class has one grey value, or up to three distant ones, as in a clean image.

    These take at least 95 % of its pixels; the others may be blurred ones where particles meet.
    Distant grey values are apart by at least 5 % of the contrast.

    Args:
        grey: Grey values of the pixels of the class, shape (pixels,), at least one.
        contrast: Range of the grey values of the image.
    """
    values, counts = np.unique(grey, return_counts=True)
    most_frequent = np.argsort(-counts)[:3]
    fractions = counts[most_frequent] / grey.size
    gaps = np.diff(np.sort(values[most_frequent]))
    are_distant = (gaps >= 0.05 * contrast).all()
    return bool(fractions[0] >= 0.95 or (are_distant and fractions.sum() >= 0.95))


class _LightFit(NamedTuple):
    """Levels of the classes, shape (classes,), light (rows, columns), and noise of an image."""

    levels: Array
    light: Array
    noise: float


def _fit_light(values: Array, labels: Ints, *, polynomials: Array, classes: int) -> _LightFit:
    """Fit levels, light and noise of an image by least squares without outliers.

    Pixels are left out whose residual is above three standard deviations of the noise, and those
    near borders of classes.

    Args:
        values: Grey values, shape (rows, columns).
        labels: Class of each pixel, from 0, same shape.
        polynomials: Values of the five polynomials of the light, of mean zero, shape (pixels, 5),
            with pixels row by row.
        classes: Number of classes.

    Returns:
        Level of each class, shape (classes,); light at each pixel, shape (rows, columns); and
        standard deviation of the residuals. Light and noise that are no more than rounding are 0.

    Raises:
        RefusedError: A class has no pixel.
    """
    inner = _inner_pixels(labels, classes).ravel()
    # A column for each class is 1 in its pixels, so that its coefficient is the level of the class.
    columns = np.hstack([labels.reshape(-1, 1) == np.arange(classes), polynomials])
    flat = values.ravel()
    rounding = _rounding(flat)
    # The first fit has the outliers too; each further one leaves out the outliers of the fit
    # before.
    used = inner
    for _ in range(3):
        coefficients = np.linalg.lstsq(columns[used], flat[used], rcond=None)[0]
        residual = np.abs(flat - columns @ coefficients)
        # A normal noise has 1.4826 times the median residual as its standard deviation. Grey values
        # that are whole numbers may have the median 0, and then a higher quantile counts.
        median, high = np.quantile(residual[inner], (0.5, 0.9))
        limit = max(3.0 * 1.4826 * float(median), float(high), rounding)
        used = inner & (residual <= limit)
    noise = float(np.sqrt(np.mean(residual[used] ** 2)))
    # Rounding is neither light nor noise: 0 leaves no pixel of a clean image open.
    light = polynomials @ coefficients[classes:]
    light[np.abs(light) < rounding] = 0.0
    return _LightFit(
        levels=coefficients[:classes],
        light=light.reshape(values.shape),
        noise=noise if noise > rounding else 0.0,
    )


def _inner_pixels(labels: Ints, classes: int) -> Mask:
    """Return the pixels that have no pixel of another class within 3, shape (rows, columns).

    If that leaves less than a tenth of some class, the distance is 2, then 1, and at last all
    pixels are returned. The image is taken as periodic.

    Args:
        labels: Class of each pixel, from 0, shape (rows, columns).
        classes: Number of classes.

    Raises:
        RefusedError: A class has no pixel.
    """
    counts = np.bincount(labels.ravel(), minlength=classes)
    value = "beyond the grey values of a class"
    require(counts.all(), "threshold", value, allowed="values that leave each class some pixels")
    # Blurred borders of classes have grey values in between, which would widen the noise.
    for reach in (3, 2, 1):
        inner = _interior(labels, reach)
        if (np.bincount(labels[inner], minlength=classes) >= 0.1 * counts).all():
            return inner
    return np.ones(labels.shape, bool)


def _interior(labels: Ints, reach: int) -> Mask:
    """Return the pixels with no other class within `reach` pixels, the image repeated."""
    lowest = highest = np.pad(labels, reach, mode="wrap")
    side = 2 * reach + 1
    for axis in (0, 1):
        # The windows' own axis is put first, along which NumPy is ten times as fast.
        lowest = np.moveaxis(sliding_window_view(lowest, side, axis), -1, 0).min(axis=0)
        highest = np.moveaxis(sliding_window_view(highest, side, axis), -1, 0).max(axis=0)
    return np.asarray(lowest == highest)
