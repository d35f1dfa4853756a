"""Volumes in TIFF stacks, read by tifffile after their heads are held against file and memory."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.base.array_files import DEFLATE_RATIO
from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.memory import require_free_memory
from alphacut.base.pictures import opened_picture
from alphacut.rve.image.spacing import ome_spacing, require_spacing
from alphacut.rve.image.white import PHOTOMETRIC, WHITE_IS_ZERO, as_shown, tags_of

COLOURS = 3  # numbers of a voxel in red, green and blue
MAX_COLOURS = 4  # pages that a file calls channels are colours up to so many, else slices
BYTES_PER_BYTE = {1: 1, 5: 2731, 8: DEFLATE_RATIO, 32946: DEFLATE_RATIO, 32773: 64}
"""Bytes that a byte can stand for, by TIFF's number of the compression: none, LZW (4096 bytes of a
string in twelve bits), deflate twice, PackBits. Others are limited by the memory alone."""
LZW = 5
X_RESOLUTION, Y_RESOLUTION = 282, 283
"""Tags of TIFF with the pixels of a length along x and y."""


def read_stack(
    path: Path, sides: Sequence[float], require_memory: Callable[[tuple[int, ...]], None]
) -> Array:
    """Return the pages of a TIFF file along (z, y, x), bright as large numbers.

    Args:
        path: The file.
        sides: Sides of a voxel along (z, y, x), in any unit.
        require_memory: Refuses a shape that is too large.

    Raises:
        RefusedError: The file has other axes, promises more than it can hold, or states voxels of
            other ratios.
    """
    try:
        import tifffile
    except ImportError:
        cure = "install tifffile, or save the volume as .npy"
        raise RefusedError(path.name, "a TIFF stack", "no stack without tifffile", cure) from None
    with tifffile.TiffFile(path) as file:
        series = list(file.series)
        kinds = {(one.axes, one.shape, one.dtype.str) for one in series}
        are_pages = len(series) > 1 and len(kinds) == 1 and series[0].axes == "YX"
        is_one = len(series) == 1 or are_pages
        require(is_one, path.name, f"{len(series)} series", "one volume, or pages that are alike")
        first = series[0]
        axes = "ZYX" if are_pages else first.axes
        shape = (len(series), *first.shape) if are_pages else first.shape
        has_colours = axes.endswith("S") and shape[-1] == COLOURS
        pages = [(a, n) for a, n in zip(axes, shape, strict=True) if a not in "YX" and n > 1]
        pages = pages[:-1] if has_colours else pages
        is_colour = any(a == "S" or (a == "C" and n <= MAX_COLOURS) for a, n in pages)
        is_volume = len(pages) == 1 and not is_colour
        what = f"axes {axes} of {' × '.join(map(str, shape))}"
        cure = "save the volume meant, one number a voxel, with axes ZYX or as .npy"
        require(is_volume, path.name, what, "pages along z, rows, columns", cure)
        spatial = shape[:-1] if has_colours else shape
        require_memory(tuple(n for n in spatial if n > 1))
        n_bytes = sum(one.nbytes for one in series)
        require_free_memory(path.name, 3.0 * n_bytes, what)
        size, compression = path.stat().st_size, int(first.keyframe.compression)
        most = BYTES_PER_BYTE.get(compression, math.inf) * size
        require(n_bytes <= most, path.name, what, f"what {size} bytes can hold")
        require_spacing(path.name, _spacing(file), sides)
        if compression == LZW:
            values = _pages_by_pillow(path, first.dtype)
        else:
            values = np.stack([one.asarray() for one in series])
        values = np.squeeze(values)
        if has_colours:
            is_grey = bool((values == values[..., :1]).all())
            require(is_grey, path.name, f"{what}, in colours", "one number a voxel", cure)
            values = values[..., 0]
        photometrics = {one.keyframe.photometric for one in series}
        require(
            len(photometrics) == 1, path.name, "pages of unlike brightness", "pages alike", cure
        )
        return as_shown(path.name, values, photometrics.pop())


def _pages_by_pillow(path: Path, dtype: np.dtype[Any]) -> Array:
    """The stored values of pages that tifffile does not unpack without another package."""
    cure = "save it without compression"
    is_read = dtype in (np.uint8, np.uint16)
    require(is_read, path.name, f"{dtype} compressed by LZW", "8 or 16 bits, unsigned", cure)
    pages = []
    with opened_picture(path) as picture:
        for number in range(getattr(picture, "n_frames", 1)):
            picture.seek(number)
            page = np.asarray(picture)
            is_inverted = picture.mode == "L" and tags_of(picture).get(PHOTOMETRIC) == WHITE_IS_ZERO
            pages.append(np.uint8(255) - page if is_inverted else page)
    return np.stack(pages).astype(dtype)


def _spacing(file: Any) -> tuple[float, float, float]:
    """Distances of voxels along x, y, z in the heads of OME, ImageJ and TIFF; nan where unknown."""
    if file.is_ome and file.ome_metadata:
        return ome_spacing(file.ome_metadata)
    x, y = _pixel_side(file, X_RESOLUTION), _pixel_side(file, Y_RESOLUTION)
    head = (file.imagej_metadata or {}) if file.is_imagej else {}
    spacing = head.get("spacing")
    has_unit = str(head.get("unit", "")).lower() not in ("", "pixel", "pixels", "null")
    z = float(spacing) if spacing is not None else math.nan
    if not has_unit and spacing is not None and (math.isnan(x) or x == y == 1):
        x = y = 1.0  # ImageJ's spacing is then in pixels
    return x, y, z


def _pixel_side(file: Any, tag: int) -> float:
    """Side of a pixel by a tag of resolution, in any unit; nan where there is none."""
    entry = file.pages[0].tags.get(tag)
    count, length = entry.value if entry is not None else (0, 0)
    return length / count if count > 0 and length > 0 else math.nan
