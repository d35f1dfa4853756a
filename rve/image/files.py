"""Grey values or labels of pixels and voxels from files: images, stacks, folders, raw data.

A picture is read with row 0 at the bottom, so that y points up. The axes of a volume are (z, y, x)
as its file orders them: pages or slices along z, rows along y, columns along x.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.array_files import read_npy
from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.pictures import opened_picture
from alphacut.base.stated import warn_of_overrides
from alphacut.rve.image.memory import require_memory
from alphacut.rve.image.raw import HEADS, data_of_head, read_head
from alphacut.rve.image.spacing import (
    StatedSpacing,
    require_spacing,
    spacing_of_resolution,
    spacing_of_tags,
)
from alphacut.rve.image.stack import read_stack
from alphacut.rve.image.white import PHOTOMETRIC, as_shown, stored_values, tags_of

if TYPE_CHECKING:
    from PIL.Image import Image

SLICES = (".tif", ".tiff", ".png", ".bmp")
"""Endings of the pictures of a folder that are its slices."""


def read_grid(path: Path, sides: Sequence[float], override: Collection[str] = ()) -> Array:
    """Return grey values or labels, shape (y, x) of a picture or (z, y, x) of a volume.

    A picture is read with its bottom row first, so that y points up. A volume stays as its file
    orders it. Values are bright as large numbers, in the type of the file.

    Args:
        path: Picture (PNG, TIFF …) or ``.npy``; of a volume a TIFF stack, a folder of pictures in
            the order of the numbers in their names, ``.npy``, ``.mhd`` or ``.nhdr``/``.nrrd``.
        sides: Sides of a pixel along (y, x) or of a voxel along (z, y, x), in m. With two a
            picture is read, with three a volume.
        override: "voxel", where a volume states wrong sides.

    Raises:
        RefusedError: The file cannot be read; its array is of another dimension, complex, shorter
            than 2 along an axis, not finite everywhere, or too large for memory; or the file states
            other sides of a voxel, or other ratios of those of a pixel.
    """
    dimension = len(sides)
    warn_of_overrides(path.name, override)
    kind = "a picture" if dimension == 2 else "a volume"
    cure = "a picture takes cell.pixel, a volume cell.voxel"
    require(dimension == 3 or not path.is_dir(), path.name, "a folder", "a picture", cure)
    try:
        if path.suffix.lower() == ".npy":
            # The file is mapped, not read: one too large for memory must come as far as the
            # question of how large it is.
            values = np.asarray(read_npy(path, kinds="buifc"))
        elif dimension == 2:
            values = _read_picture(path, sides, override)
        else:
            values = _read_volume(path, sides, override)
    except RefusedError:
        raise
    except Exception as error:  # readers of damaged files raise errors of many kinds
        raise RefusedError(path.name, f"unreadable ({error})", kind) from None
    is_thin = min(values.shape, default=0) < 2
    is_grid = values.ndim == dimension and not is_thin and values.dtype.kind in "buif"
    what = f"{values.dtype} of shape {values.shape}"
    allowed = f"{kind} of real numbers, two or more along {dimension} axes"
    require(is_grid, path.name, what, allowed, cure)
    # This comes before the numbers of a mapped array are touched.
    require_memory(values.shape)
    n_not_finite = int((~np.isfinite(values)).sum())
    what = f"with {n_not_finite} values that are not finite"
    require(n_not_finite == 0, path.name, what, "numbers")
    return np.ascontiguousarray(values[::-1] if dimension == 2 else values)


def files_of(path: Path) -> list[Path]:
    """Return the files of an image or a volume: a head and its data, the slices of a folder."""
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.suffix.lower() in SLICES)
    is_head = path.suffix.lower() in (".mhd", ".nhdr")
    data = data_of_head(path) if is_head else ()
    return [path, *(file for file in data if file != path and file.is_file())]


def _read_volume(path: Path, sides: Sequence[float], override: Collection[str]) -> Array:
    """Return the numbers of a volume along the axes (z, y, x), in the type of its file.

    Args:
        path: TIFF stack, folder of pictures, or head of MetaImage or NRRD.
        sides: Sides of a voxel along (z, y, x), in m.
        override: "voxel", where the file states wrong ones.

    Raises:
        RefusedError: The file has another ending (the message says how to convert some), is too
            large for memory, or states other voxels.
        Exception: What readers raise of damaged files, of many kinds.
    """
    if path.is_dir():
        return _read_slices(path, sides, override)
    ending = path.suffix.lower()
    if ending in (".tif", ".tiff"):
        return read_stack(path, sides, override)
    if ending in HEADS:
        head = read_head(path, sides, override)
        require_memory(head.shape)
        return head.read()
    cure = "save the array along (z, y, x) by numpy.save; a picture takes cell.pixel"
    allowed = "a TIFF stack, a folder of slices, .npy, .mhd or .nhdr"
    raise RefusedError(path.name, f"a file of kind {path.suffix or 'unknown'}", allowed, cure)


def _read_slices(folder: Path, sides: Sequence[float], override: Collection[str]) -> Array:
    """Return the pictures of a folder as a volume, in the order of the numbers in their names.

    Args:
        folder: Folder whose .tif, .tiff, .png and .bmp files are the slices along z; others in it
            are ignored.
        sides: Sides of a voxel along (z, y, x), in m.
        override: "voxel", where pictures, or a log beside them, state wrong ones.

    Returns:
        Numbers in the type of the pictures, shape (slices, rows, columns), the top row first.

    Raises:
        RefusedError: There are fewer than two slices, their numbers are missing, repeated or not in
            a row, they differ in size or type, one has colours or several pages, or memory is too
            small.
        OSError: A file is no picture, or damaged.
    """
    files = files_of(folder)
    count = len(files)
    allowed = "a folder of slices, PNG, TIFF or BMP"
    require(count > 1, folder.name, f"{count} pictures", allowed)
    by_number = dict(zip(_numbers_in_names(files), files, strict=True))
    lowest = min(by_number)
    # A slice that is missing, or there twice, would move all above it. A repeated number leaves
    # fewer entries than files, so that another one is missing.
    missing = [k for k in range(lowest, lowest + count) if k not in by_number]
    what = f"{count} pictures, none with number {min(missing, default=lowest)}"
    require(not missing, folder.name, what, "slices with numbers that follow one another")
    # Bruker's scanners write a list of settings beside the slices.
    logs = [x.read_text("utf-8", "replace") for x in folder.glob("*.log") if x.is_file()]
    lines = "\n".join(logs).splitlines()
    # Their pixels are sides of cubes.
    texts = [line.lower().replace("pixel", "voxel") for line in lines if "ixel" in line]
    require_spacing(folder.name, StatedSpacing([], [], texts), sides, override=override)
    first = _read_picture(by_number[lowest], sides[-2:], override)
    shape = (count, *first.shape)
    require_memory(shape)
    values = np.empty(shape, first.dtype)
    for number, file in by_number.items():
        page = _read_picture(file, sides[-2:], override)
        is_alike = page.shape == first.shape and page.dtype == first.dtype
        what = f"{page.dtype} of shape {page.shape}"
        require(is_alike, file.name, what, f"{first.dtype} of shape {first.shape} as the others")
        values[number - lowest] = page
    return values


def _numbers_in_names(files: Sequence[Path]) -> list[int]:
    """Return the number of each slice: the last one in its name that changes between slices.

    Where the names differ in words too, or no number changes, it is the last number in the name.

    Args:
        files: Files of the slices, one at least. Names that have the same words have equally many
            numbers.

    Raises:
        RefusedError: A name has no number.
    """
    # Names also hold bits of a pixel, widths or dates, as in "rec_0012_8bit.tif".
    numbers = [re.findall(r"\d+", file.stem) for file in files]
    for file, found in zip(files, numbers, strict=True):
        require(bool(found), file.name, "no number", "a number in the name of each slice")
    place = -1
    if len({re.sub(r"\d+", "#", file.stem) for file in files}) == 1:
        # Numbers of all names at the same place, to see which place changes from slice to slice.
        columns = enumerate(zip(*numbers, strict=True))
        changing = (k for k, column in columns if len(set(map(int, column))) > 1)
        place = max(changing, default=-1)
    return [int(found[place]) for found in numbers]


def _read_picture(path: Path, sides: Sequence[float], override: Collection[str]) -> Array:
    """Return the grey values of an image file, bright large, shape (rows, columns), top row first.

    Args:
        path: File that Pillow reads.
        sides: Sides of a pixel along (y, x), in m. If they are equal, the picture may not state
            unequal ones.
        override: "voxel", where the picture states wrong ones.

    Raises:
        RefusedError: The file has several pages, or colours that are not grey, or states other
            pixels than the case, or has values that Pillow changes; or memory is too small.
        OSError: The file is no picture, or damaged.
    """
    with opened_picture(path) as picture:
        # Colours may be grey values, if red, green and blue are equal.
        is_colour = picture.mode in ("RGB", "RGBA", "P", "LA")
        is_grey = picture.mode in ("1", "L", "I;16", "I;16B", "I;16L", "I", "F")
        frames = getattr(picture, "n_frames", 1)
        what = f"of mode {picture.mode} with {frames} pages"
        cure = "save the one meant as grey values; a volume takes cell.voxel"
        is_read = (is_grey or is_colour) and frames == 1
        require(is_read, path.name, what, "one page of grey values", cure)
        found = _spacing_of(path, picture)
        texts = [text for text in picture.info.values() if isinstance(text, str)]
        found = found._replace(texts=[*texts, *found.texts])
        size = (picture.width, picture.height)
        require_spacing(path.name, found, sides, counts=size, override=override)
        require_memory((picture.height, picture.width))
        if is_colour:
            return _grey_of_colours(path.name, np.asarray(picture.convert("RGBA")))
        values = stored_values(picture)
        _require_right_sign(path.name, picture, values)
        return as_shown(path.name, values, tags_of(picture).get(PHOTOMETRIC))


def _spacing_of(path: Path, picture: Image) -> StatedSpacing:
    """Return what an open picture states of its pixels, in tags of TIFF or as a resolution."""
    if tags := tags_of(picture):
        return spacing_of_tags(tags)
    scale = re.search(rb"sCAL\x01([\d.eE+-]+)\0([\d.eE+-]+)", path.read_bytes())
    if picture.format == "PNG" and scale is not None:
        return StatedSpacing([float(scale[1]), float(scale[2])], ["m", "m"])
    x, y = picture.info.get("dpi", picture.info.get("aspect", (1, 1)))
    return spacing_of_resolution(float(x), float(y))


def _require_right_sign(name: str, picture: Image, values: Array) -> None:
    """Refuse a picture whose integers Pillow reads as signed if unsigned, or the other way round.

    Args:
        name: Name of the file, for the message.
        picture: The open picture.
        values: Its values as Pillow gives them.

    Raises:
        RefusedError: The values are wrong: unsigned integers of 32 bits above 2³¹ − 1, which become
            negative, or signed ones of 8 bits, whose negative ones become large.
    """
    sample_format = 339  # TIFF's tag, 2 for signed integers
    is_signed = tags_of(picture).get(sample_format) == (2,)
    is_wrapped = not is_signed and picture.mode == "I" and values.min() < 0  # of unsigned 32 bits
    is_right = not is_wrapped and not (is_signed and picture.mode == "L")
    what = f"of integers whose sign Pillow changes, as {values.min()}"
    require(is_right, name, what, "values from 0 to 2³¹ − 1", "save it as .npy")


def _grey_of_colours(name: str, values: Array) -> Array:
    """Return the grey values of an opaque picture whose red, green and blue are equal.

    Args:
        name: Name of the file, for messages.
        values: Red, green, blue and opacity from 0 to 255, shape (rows, columns, 4); 255 is opaque.

    Returns:
        New array of shape (rows, columns), of the type of `values`.

    Raises:
        RefusedError: It has colours, or is transparent somewhere.
    """
    # Programs save grey values as colours; weights of red, green and blue would be a guess.
    red = values[..., 0]
    is_grey = (values[..., 1] == red).all() and (values[..., 2] == red).all()
    cure = "save it as grey values"
    require(is_grey, name, "in colours", "one page of grey values", cure)
    require((values[..., 3] == 255).all(), name, "transparent in places", "opaque pixels", cure)
    return np.ascontiguousarray(red)
