"""Volumes in TIFF stacks, read by tifffile after their heads are held against file and memory."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.base.array_files import DEFLATE_RATIO
from alphacut.base.arrays import Array
from alphacut.base.errors import require
from alphacut.base.extras import extra_named
from alphacut.base.memory import require_free_memory
from alphacut.base.pictures import LZW_RATIO, opened_picture
from alphacut.rve.image.memory import require_memory
from alphacut.rve.image.spacing import require_spacing, spacing_of_tags
from alphacut.rve.image.white import as_shown, stored_values

if TYPE_CHECKING:
    from tifffile import TiffFile


def read_stack(path: Path, sides: Sequence[float], override: Collection[str] = ()) -> Array:
    """Return the pages of a TIFF file along (z, y, x), bright as large numbers.

    Args:
        path: The file.
        sides: Sides of a voxel along (z, y, x), in m.
        override: "voxel", where the file states wrong ones.

    Returns:
        Array of three axes, in the type of the file.

    Raises:
        RefusedError: tifffile is not installed; or the file has colours or other axes, promises
            more than it can hold or memory takes, states voxels of other ratios, or is compressed
            in a way that is not read.
        Exception: What tifffile raises of a damaged file, of many kinds.
    """
    with extra_named(path.name, "save the volume as .npy"):
        import tifffile
    with tifffile.TiffFile(path) as file:
        return _read_file(path, file, sides, override)


def _read_file(
    path: Path, file: TiffFile, sides: Sequence[float], override: Collection[str]
) -> Array:
    """Return the pages of an open TIFF file as a volume along (z, y, x), bright as large numbers.

    The sizes that the heads promise are held against the memory and the length of the file before
    anything is read.

    Args:
        path: The file.
        file: The same file, opened by tifffile.
        sides: Sides of a voxel along (z, y, x), in m.
        override: "voxel", where the file states wrong ones.

    Returns:
        Array of three axes, in the type of the file. Axes of length 1 are left out.

    Raises:
        RefusedError: The file has no single axis of two pages or more beside rows and columns, or
            colours, promises more than it can hold or memory takes, states voxels of other ratios,
            or has pages of unlike brightness.
        Exception: What tifffile raises of a damaged file, of many kinds.
    """
    # tifffile calls pages that belong together a series. Pages that are alike but are not said to
    # belong together are a series each.
    name = path.name
    cure = "save the volume meant, one number a voxel, with axes ZYX or as .npy"
    series = list(file.series)
    kinds = {(one.axes, one.shape, one.dtype.str) for one in series}
    are_pages = len(series) > 1 and len(kinds) == 1 and series[0].axes == "YX"
    is_one = len(series) == 1 or are_pages
    require(is_one, name, f"{len(series)} series", "one volume, or pages that are alike")
    first = series[0]
    axes = first.axes
    shape = first.shape
    if are_pages:
        axes = "ZYX"
        shape = (len(series), *shape)

    # One axis beside rows and columns: not colours, and of red, green and blue alone equal ones.
    # Up to four pages that a file calls channels are colours, else slices; times are none.
    has_colours = axes.endswith("S") and shape[-1] == 3
    spatial = shape[:-1] if has_colours else shape
    pages = [(a, n) for a, n in zip(axes, spatial, strict=False) if a not in "YX" and n > 1]
    is_colour = any(a == "S" or (a == "C" and n <= 4) for a, n in pages)
    is_volume = len(pages) == 1 and not is_colour and pages[0][0] != "T"
    what = f"axes {axes} of {' × '.join(map(str, shape))}"
    require(is_volume, name, what, "pages along z, rows, columns", cure)

    # Sizes are held against memory and the file before anything is read.
    require_memory([n for n in spatial if n > 1])
    n_bytes = sum(one.nbytes for one in series)
    require_free_memory(name, 3.0 * n_bytes, what)
    # A head may promise gigabytes that a short file cannot hold.
    compression = int(first.keyframe.compression)
    file_size = path.stat().st_size
    max_bytes = _max_bytes_per_byte(compression) * file_size
    require(n_bytes <= max_bytes, name, what, f"what {file_size} bytes can hold")
    found = spacing_of_tags({int(tag.code): tag.value for tag in file.pages.first.tags})
    texts = [*found.texts, str((file.imagej_metadata or {}).get("Info", ""))]
    counts = [n for n in reversed(spatial) if n > 1]
    found = found._replace(texts=texts)
    require_spacing(name, found, sides, counts=counts, override=override)

    if compression == 5:  # LZW, which tifffile does not unpack without another package
        values = _pages_by_pillow(path, first.dtype)
    else:
        values = np.stack([one.asarray() for one in series])
    values = np.squeeze(values)
    if has_colours:
        is_grey = bool((values == values[..., :1]).all())
        require(is_grey, name, f"{what}, in colours", "one number a voxel", cure)
        values = values[..., 0]
    photometrics = {one.keyframe.photometric for one in series}
    is_alike = len(photometrics) == 1
    require(is_alike, name, "pages of unlike brightness", "pages alike", cure)
    return as_shown(name, values, photometrics.pop())


def _max_bytes_per_byte(compression: int) -> float:
    """Return how many bytes of numbers a byte of a file can stand for at most.

    Args:
        compression: TIFF's number of the compression. Known are 1 (none), 5 (LZW), 8 and 32946
            (deflate) and 32773 (PackBits, which repeats a byte up to 128 times by two bytes). Of
            others the ratio is infinite: the memory alone limits them.
    """
    ratios = {1: 1, 5: LZW_RATIO, 8: DEFLATE_RATIO, 32946: DEFLATE_RATIO, 32773: 64}
    return ratios.get(compression, math.inf)


def _pages_by_pillow(path: Path, dtype: np.dtype[Any]) -> Array:
    """Return the stored values of all pages of a TIFF file, read by Pillow.

    It serves files that are compressed by LZW, for which tifffile would need another package.

    Args:
        path: The file, whose pages are alike.
        dtype: Type of the numbers by the heads.

    Returns:
        Array of type `dtype` and shape (pages, rows, columns), not inverted where white is zero.

    Raises:
        RefusedError: The type is not unsigned of 8 or 16 bits.
        OSError: Pillow cannot read the file.
        ValueError: The pages are not alike.
    """
    cure = "save it without compression"
    is_read = dtype in (np.uint8, np.uint16)
    require(is_read, path.name, f"{dtype} compressed by LZW", "8 or 16 bits, unsigned", cure)
    pages = []
    with opened_picture(path) as picture:
        for number in range(getattr(picture, "n_frames", 1)):
            picture.seek(number)
            pages.append(stored_values(picture))
    return np.stack(pages).astype(dtype)
