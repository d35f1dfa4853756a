"""Grey values or labels of a micrograph, from PNG, TIFF or a NumPy file; every doubt is refused."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

PLANE_MODES = {"1": 1, "L": 8, "I;16": 16, "I;16B": 16, "I;16L": 16, "I": 32, "F": 32}
BYTES_PER_PIXEL = 1400  # of both sides together, measured at 1024 × 1024
EIGHT_BITS = 255


def read_grey(path: Path, *, division: int = 1, square: bool = True) -> Array:
    """Grey values of an image, shape (rows, columns), row 0 at the bottom.

    Args:
        path: A file ``.png``, ``.tif`` … or ``.npy``.
        division: Parts along each side of a pixel that the solver will make.
        square: Refuse a file that says that its pixels are not square.

    Raises:
        ValueError: The file is no plane grey image, holds no numbers, or is too large for memory.
    """
    values = _array(path) if path.suffix == ".npy" else _picture(path, division, square)
    if values.ndim != 2 or min(values.shape) < 2:
        raise ValueError(
            f"{path.name} has the shape {values.shape}; it takes one plane of 2 × 2 pixels or more"
        )
    require_memory(values.shape[0], values.shape[1], division)
    if values.dtype.kind not in "buif":
        raise ValueError(f"{path.name} holds {values.dtype}; it takes numbers")
    if not np.isfinite(values).all():
        raise ValueError(
            f"{path.name} holds {int((~np.isfinite(values)).sum())} values that are not finite"
        )
    return np.ascontiguousarray(values[::-1])


def _array(path: Path) -> Array:
    try:
        # mapped: one too large for memory must come as far as the question of how large it is
        return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))
    except (ValueError, EOFError) as error:
        raise ValueError(f"{path.name} cannot be read as a NumPy array: {error}") from error


def _picture(path: Path, division: int, square: bool) -> Array:
    from PIL import Image, UnidentifiedImageError

    Image.MAX_IMAGE_PIXELS = None  # the memory is checked here, before the pixels are read
    try:
        with Image.open(path) as picture:
            _require_plane(path, picture.mode, getattr(picture, "n_frames", 1))
            if square:
                _require_square(path, picture.info.get("dpi"))
            require_memory(picture.height, picture.width, division)
            return np.asarray(picture)
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        raise ValueError(f"{path.name} cannot be read as an image: {error}") from error


def _require_plane(path: Path, mode: str, frames: int) -> None:
    """Refuse palettes, several channels, several pages."""
    if mode == "P":
        raise ValueError(
            f"{path.name} has a palette: its numbers are colours, not grey values; "
            "save it as a grey image"
        )
    if mode not in PLANE_MODES:
        raise ValueError(
            f"{path.name} has several channels ({mode}); save the one that tells the phases as grey"
        )
    if frames > 1:
        raise ValueError(f"{path.name} has {frames} pages; save the one that is meant")


def _require_square(path: Path, resolution: tuple[float, float] | None) -> None:
    if resolution and abs(float(resolution[0]) / float(resolution[1]) - 1) > 0.01:
        raise ValueError(
            f"{path.name} says that its pixels are not square, {float(resolution[0]):g} by "
            f"{float(resolution[1]):g} per inch; give cell.pixel = [width, height]"
        )


def require_memory(rows: int, columns: int, division: int) -> None:
    """Refuse an image whose solution cannot fit into this machine's memory.

    Raises:
        ValueError: It says how much is needed, and how large a window would fit.
    """
    needed, have = memory(rows, columns, division)
    if needed > have:
        side = int((have / BYTES_PER_PIXEL / division**2) ** 0.5)
        raise ValueError(
            f"{rows} × {columns} pixels divided by {division} need about {needed / 1e9:.0f} GB of "
            f"memory, this machine has {have / 1e9:.0f}; crop a window of {side} × {side} pixels"
        )


def memory(rows: int, columns: int, division: int) -> tuple[int, int]:
    """Bytes that the solution of an image needs, and those that this machine has."""
    have = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return BYTES_PER_PIXEL * rows * columns * division**2, have


def require_phases(grey: Array, thresholds: tuple[tuple[float, float], ...]) -> None:
    """Refuse thresholds that leave a phase without a pixel, whatever their value in the interval.

    Args:
        grey: Grey values, shape (rows, columns).
        thresholds: Least and greatest value of each.

    Raises:
        ValueError: A threshold lies outside the grey values, a phase is empty, or the threshold is
            one of 8 bits for 16.
    """
    low, high = float(grey.min()), float(grey.max())
    told = f"the grey values lie from {low:g} to {high:g}"
    if low == high:
        raise ValueError(f"the image has one grey value, {low:g}, so one phase")
    for least, greatest in thresholds:
        if not (low < least and greatest <= high):
            span = f"{least:g}" if least == greatest else f"[{least:g}, {greatest:g}]"
            raise ValueError(f"the threshold {span} is outside: {told}")
    top = thresholds[-1][1]
    if grey.dtype == np.uint16 and top <= EIGHT_BITS < high:
        raise ValueError(f"the threshold {top:g} is one of 8 bits, the image has 16: {told}")
    for (_, before), (after, _) in pairwise(thresholds):
        if not ((grey >= before) & (grey < after)).any():
            why = told if before < after else "they must rise, their supports apart"
            pair = f"{before:g} and {after:g}"
            raise ValueError(f"no pixel lies between the thresholds {pair}: {why}")
