"""Scale bars, captions and other rectangles of one grey that do not belong to a micrograph."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.stochastic.theta.law import Array

FILLED = 0.95  # share of its bounding box that a rectangle fills, holes with text in it counted
LEAST_SIDE = 8  # pixels
LEAST_SHARE = 1e-3  # of the image
FLAT = 0.02  # of the picture's range, by which neighbours of one grey may differ

FRAMING = 0.05  # share of the pixels within a frame that may have its grey

Crop = tuple[int, int, int, int]
"""Left, top, right and bottom in pixels from the upper left corner; right and bottom excluded."""


@dataclass(frozen=True)
class Rectangle:
    """A rectangle of one grey.

    Args:
        box: Where it lies.
        share: Part of the image that it covers, in (0, 1).
    """

    box: Crop
    share: float


def rectangles(picture: Array) -> list[Rectangle]:
    """Rectangles of one grey in a grey image, shape (rows, columns), the largest first.

    Neighbours that differ by less than `FLAT` of the picture's range are of one grey. Noise breaks
    up what a camera has seen; what a program has drawn over it stays whole. A piece counts with the
    holes that letters and bars leave in it, unless it spans the whole image.
    """
    from scipy import ndimage

    reach = ndimage.maximum_filter(picture, 3) - ndimage.minimum_filter(picture, 3)
    pieces, _ = ndimage.label(reach <= FLAT * np.ptp(picture))
    found = []
    for number, window in enumerate(ndimage.find_objects(pieces), start=1):
        whole = ndimage.binary_fill_holes(pieces[window] == number)
        rows, columns = whole.shape
        if min(rows, columns) < LEAST_SIDE - 2 or whole.shape == picture.shape:
            continue
        if whole.mean() >= FILLED and whole.size >= LEAST_SHARE * picture.size:
            found.append(_widened(window, picture.shape))
    return sorted(found, key=lambda one: -one.share)


def _widened(window: tuple[slice, slice], shape: tuple[int, ...]) -> Rectangle:
    """The rectangle of a flat piece with its rim of one pixel, where neighbours differ."""
    (top, bottom), (left, right) = (
        (max(0, part.start - 1), min(size, part.stop + 1))
        for part, size in zip(window, shape, strict=True)
    )
    share = (bottom - top) * (right - left) / (shape[0] * shape[1])
    return Rectangle((left, top, right, bottom), share)


def best_crop(shape: tuple[int, ...], found: list[Rectangle]) -> Crop:
    """The largest part of the image beside all rectangles: above, below, left or right of them."""
    rows, columns = shape
    left, top = (min(one.box[k] for one in found) for k in (0, 1))
    right, bottom = (max(one.box[k] for one in found) for k in (2, 3))
    parts: list[Crop] = [
        (0, 0, columns, top),
        (0, bottom, columns, rows),
        (0, 0, left, rows),
        (right, 0, columns, rows),
    ]
    return max(parts, key=lambda one: (one[2] - one[0]) * (one[3] - one[1]))


def framed(picture: Array) -> Crop | None:
    """The part within a frame of one grey, which the pixels within it hardly have; None without."""
    ink = np.abs(picture - picture[0, 0]) <= FLAT * np.ptp(picture)
    rows, columns = (np.flatnonzero(~ink.all(axis=axis)) for axis in (1, 0))
    if not rows.size or min(rows[0], columns[0]) == 0:
        return None
    box = (int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
    inside = ink[box[1] : box[3], box[0] : box[2]]
    ends = box[2] < picture.shape[1] and box[3] < picture.shape[0]
    return box if ends and inside.mean() < FRAMING else None


def cropped(picture: Array, crop: Crop | None, path: Path) -> Array:
    """The part of a picture, shape (rows, columns), that is material.

    Args:
        picture: Grey values.
        crop: The part to take; the whole picture, given by its four numbers, is taken as it is.
        path: Its file, for the message.

    Raises:
        ValueError: The part does not lie in the picture, or has a frame or rectangle of one grey.
    """
    rows, columns = picture.shape
    left, top, right, bottom = crop or (0, 0, columns, rows)
    if not (0 <= left < right <= columns and 0 <= top < bottom <= rows):
        raise ValueError(
            f"the part {[left, top, right, bottom]} of {path} (left, top, right, bottom) must lie"
            f" in its {columns} × {rows} pixels"
        )
    part = picture[top:bottom, left:right]
    if crop == (0, 0, columns, rows):
        return part
    if within := framed(part):
        inside = [x + shift for x, shift in zip(within, 2 * (left, top), strict=True)]
        raise ValueError(
            f"{path} has a frame of one grey around it, which would be read as material: crop ="
            f" {inside} cuts it off (left, top, right, bottom in pixels)"
        )
    if not (found := rectangles(part)):
        return part
    first = found[0].box
    best = best_crop(part.shape, found)
    inside = [x + shift for x, shift in zip(best, 2 * (left, top), strict=True)]
    raise ValueError(
        f"{path} has a rectangle of one grey, {first[2] - first[0]} × {first[3] - first[1]} pixels"
        f" with its upper left corner at ({left + first[0]}, {top + first[1]}),"
        f" {found[0].share:.1%} of the area, as of a scale bar or a caption, which would be read as"
        f" material: crop = {inside} cuts it off (left, top, right, bottom in pixels), and crop ="
        f" {[0, 0, columns, rows]} takes the image as it is"
    )
