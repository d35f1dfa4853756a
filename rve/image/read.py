"""Grey values or labels of a micrograph, from PNG, TIFF or a NumPy file; every doubt is refused."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError

PLANE_MODES = ("1", "L", "I;16", "I;16B", "I;16L", "I", "F")
PHOTOMETRIC, WHITE_IS_ZERO = 262, 0  # tag of TIFF and its value
SAMPLE_FORMAT, SIGNED = 339, 2
BYTES, BYTES_PER_ELEMENT = 1e8, 1450
"""Of the program, and of each element of the cuts' solutions with their first guess; within 1.25 of
peaks measured at 128² … 512² pixels of two elements a side, and 512² and 1024² of one."""


def read_grey(path: Path, *, square: bool = True) -> Array:
    """Grey values of ``.png``, ``.tif`` … or ``.npy``, (rows, columns), row 0 at the bottom.

    Refuses what is no plane image of numbers or too large for memory and, with `square`, a file
    that says that its pixels are not square.
    """
    try:
        values = _array(path) if path.suffix == ".npy" else _picture(path, square)
    except (RefusedError, MemoryError):
        raise
    except Exception as error:  # readers of damaged files raise errors of many kinds
        raise RefusedError(path.name, f"unreadable ({error})", "an image or an array") from error
    if values.ndim != 2 or min(values.shape) < 2 or values.dtype.kind not in "buif":
        what = f"{values.dtype} of shape {values.shape}"
        raise RefusedError(path.name, what, "one plane of 2 × 2 numbers or more")
    require_memory(*values.shape)
    if not np.isfinite(values).all():
        count = int((~np.isfinite(values)).sum())
        raise RefusedError(path.name, f"with {count} values that are not finite", "numbers")
    return np.ascontiguousarray(values[::-1])


def _array(path: Path) -> Array:
    # mapped: one too large for memory must come as far as the question of how large it is
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))


def _picture(path: Path, square: bool) -> Array:
    """Read the pixels of an image file with one page of grey values, top row first."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None  # the memory is checked here, before the pixels are read
    with Image.open(path) as picture:
        mode, frames = picture.mode, getattr(picture, "n_frames", 1)
        if mode not in PLANE_MODES or frames > 1:
            what = f"of mode {mode} with {frames} pages"
            raise RefusedError(path.name, what, "one page of grey values", "save the one meant")
        dpi_x, dpi_y = map(float, picture.info.get("dpi", (1, 1)))
        if square and abs(dpi_x / dpi_y - 1) > 0.01:
            what = f"of pixels {dpi_x:g} by {dpi_y:g} per inch"
            raise RefusedError(path.name, what, "square ones", "give cell.pixel = [width, height]")
        require_memory(picture.height, picture.width)
        values = np.asarray(picture)
        tags = getattr(picture, "tag_v2", {})
        greys = np.unique(values) if tags.get(PHOTOMETRIC) == WHITE_IS_ZERO else []
        if len(greys) == 2:  # tifffile writes masks so, and readers exchange the phases
            value = f"two-valued with white as zero, bright on {np.mean(values == greys[1]):.4g}"
            cure = "save it as .npy or PNG, and look at the fractions that check prints"
            raise RefusedError(path.name, value, "masks that all programs read alike", cure)
        is_signed = tags.get(SAMPLE_FORMAT, (1,)) == (SIGNED,)
        is_changed = (
            is_signed if mode == "L" else not is_signed and mode == "I" and values.min() < 0
        )
        if is_changed:
            what = f"of integers whose sign Pillow changes, as {values.min()}"
            raise RefusedError(path.name, what, "values from 0 to 2³¹ − 1", "save it as .npy")
        return values


def needed_memory(rows: int, columns: int, division: int = 1) -> float:
    """Bytes that the cuts of an image take with so many elements along each side of a pixel."""
    return BYTES + BYTES_PER_ELEMENT * rows * columns * division**2


def require_memory(rows: int, columns: int, division: int = 1) -> None:
    """Refuse an image whose solution needs more memory than this machine has."""
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    needed = needed_memory(rows, columns, division)
    if needed > available:
        side = int((available / BYTES_PER_ELEMENT) ** 0.5 / division)
        what = f"{rows} × {columns} pixels, about {needed / 1e9:.0f} GB"
        allowed = f"up to {available / 1e9:.0f} GB of memory"
        raise RefusedError("image", what, allowed, f"crop a piece of {side} × {side} pixels")


def require_phases(grey: Array, thresholds: tuple[tuple[float, float], ...]) -> None:
    """Refuse thresholds (least, greatest), rising, that may leave a phase without a pixel."""
    low, high = float(grey.min()), float(grey.max())
    for least, greatest in thresholds:
        if not (low < least and greatest <= high):
            span = f"{least:g}" if least == greatest else f"[{least:g}, {greatest:g}]"
            raise RefusedError("threshold", span, f"grey values of the image, {low:g} to {high:g}")
    for (_, lower), (upper, _) in pairwise(thresholds):  # of the pixels surely between both
        if not ((grey >= lower) & (grey < upper)).any():
            what = f"{lower:g} and {upper:g}"
            raise RefusedError("threshold", what, "rising values with pixels between them")
