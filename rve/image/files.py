"""Grey values or labels of pixels and voxels from files: images, stacks, folders, raw data.

A picture is read with row 0 at the bottom, so that y points up. The axes of a volume are (z, y, x)
as its file orders them: pages or slices along z, rows along y, columns along x.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from alphacut.base.array_files import read_npy
from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.base.pictures import opened_picture
from alphacut.rve.image.raw import HEADS, data_of_head, read_head
from alphacut.rve.image.stack import read_stack
from alphacut.rve.image.white import PHOTOMETRIC, WHITE_IS_ZERO, as_shown, tags_of

PLANE_MODES = ("1", "L", "I;16", "I;16B", "I;16L", "I", "F")
SAMPLE_FORMAT, SIGNED = 339, 2
PROGRAM_BYTES = 1.7e8
"""Memory of the program and its libraries."""
BYTES_PER_ELEMENT = {2: 1450, 3: 1600}
"""Memory of an element in the cuts' solutions with their first guess, by dimension; within 1.25 of
peaks at 128² … 512² pixels of two elements a side, 512² and 1024² of one, 64³ … 128³ voxels."""
COLOUR_MODES = ("RGB", "RGBA", "P", "LA")
"""Pillow's modes that may hold grey values as equal colours."""
TAKE_VOXEL = "a volume takes cell.voxel in place of cell.pixel"
TAKE_PIXEL = "a picture takes cell.pixel in place of cell.voxel"
_HDF5 = 'np.save("v.npy", h5py.File("v.h5")["data"])'
_NIFTI = 'np.save("v.npy", nibabel.load("v.nii").get_fdata().T)'
_VTI = 'm = pyvista.read("v.vti"); np.save("v.npy", m.active_scalars.reshape(m.dimensions[::-1]))'
SAVE_AS_NPY = {".nii": _NIFTI, ".h5": _HDF5, ".hdf5": _HDF5, ".vti": _VTI}
"""A line of Python that writes a volume of another format as .npy, by its ending."""
SLICES = (".tif", ".tiff", ".png", ".bmp")


def read_grid(path: Path, sides: Sequence[float]) -> Array:
    """Grey values or labels, shape (y, x) of a picture or (z, y, x) of a volume.

    Args:
        path: Picture (PNG, TIFF …) or ``.npy``; of a volume a TIFF stack, a folder of pictures in
            the order of the numbers in their names, ``.npy``, ``.mhd`` or ``.nhdr``/``.nrrd``.
        sides: Sides of a pixel along (y, x) or of a voxel along (z, y, x), in any unit.

    Raises:
        RefusedError: The file is none of these, of another dimension, too large for memory, or says
            that its pixels or voxels have sides of other ratios.
    """
    dimension, has_equal_sides = len(sides), len(set(sides)) == 1
    if dimension == 2 and path.is_dir():
        raise RefusedError(path.name, "a folder", "a picture", TAKE_VOXEL)
    try:
        if path.suffix.lower() == ".npy":
            # mapped: one too large for memory must come as far as the question of how large it is
            values = np.asarray(read_npy(path, kinds="buifc"))
        elif dimension == 2:
            values = _read_picture(path, has_equal_sides)
        else:
            values = _read_volume(path, sides)
    except (RefusedError, MemoryError):
        raise
    except Exception as error:  # readers of damaged files raise errors of many kinds
        allowed = "an image or an array" if dimension == 2 else "a volume"
        raise RefusedError(path.name, f"unreadable ({error})", allowed) from None
    is_thin = min(values.shape, default=0) < 2
    if values.ndim != dimension or is_thin or values.dtype.kind not in "buif":
        what = f"{values.dtype} of shape {values.shape}"
        allowed = "one plane of 2 × 2 numbers or more"
        if dimension == 3:
            allowed = "numbers along three axes (z, y, x), 2 × 2 × 2 or more"
        cure = {(2, 3): TAKE_VOXEL, (3, 2): TAKE_PIXEL}.get((dimension, values.ndim), "")
        raise RefusedError(path.name, what, allowed, cure)
    require_memory(values.shape)
    if not np.isfinite(values).all():
        count = int((~np.isfinite(values)).sum())
        raise RefusedError(path.name, f"with {count} values that are not finite", "numbers")
    return np.ascontiguousarray(values[::-1] if dimension == 2 else values)


def files_of(path: Path) -> list[Path]:
    """The files that make up an image or a volume: of a head its data, of a folder its slices."""
    if path.is_dir():
        return sorted(file for file in path.iterdir() if file.suffix.lower() in SLICES)
    is_head = path.suffix.lower() in (".mhd", ".nhdr")
    data = data_of_head(path) if is_head else path
    return [path, data] if data != path and data.is_file() else [path]


def _read_volume(path: Path, sides: Sequence[float]) -> Array:
    """Numbers of a volume along the axes (z, y, x)."""
    if path.is_dir():
        return _read_slices(path, sides[-1] == sides[-2])
    if path.suffix.lower() in (".tif", ".tiff"):
        return read_stack(path, sides, require_memory)
    if path.suffix.lower() in HEADS:
        head = read_head(path, sides)
        require_memory(head.shape)
        return head.read()
    allowed = "a TIFF stack, a folder of slices, .npy, .mhd or .nhdr"
    cure = "write raw data beside a .mhd head with DimSize, ElementType and ElementDataFile"
    cure = SAVE_AS_NPY.get(path.suffixes[0].lower() if path.suffixes else "", cure)
    if path.suffix.lower() in (*SLICES, ".jpg", ".jpeg"):
        cure = TAKE_PIXEL
    raise RefusedError(path.name, f"a file of kind {path.suffix or 'unknown'}", allowed, cure)


def _read_slices(folder: Path, is_square: bool) -> Array:
    """The pictures of a folder one above another, in the order of the numbers in their names."""
    files = files_of(folder)
    allowed = "a folder of slices, PNG, TIFF or BMP"
    require(len(files) > 1, folder.name, f"{len(files)} pictures", allowed)
    by_number = dict(zip(_numbers_in_names(files), files, strict=True))
    lowest, count = min(by_number), len(files)
    missing = [k for k in range(lowest, lowest + count) if k not in by_number]
    what = f"{count} pictures, none with number {min(missing, default=lowest)}"
    require(not missing, folder.name, what, "slices with numbers that follow one another")
    first = _read_picture(by_number[lowest], is_square)
    require_memory((count, *first.shape))
    values = np.empty((count, *first.shape), first.dtype)
    for k, file in by_number.items():
        page = _read_picture(file, is_square)
        is_alike = page.shape == first.shape and page.dtype == first.dtype
        what = f"{page.dtype} of shape {page.shape}"
        require(is_alike, file.name, what, f"{first.dtype} of shape {first.shape} as the others")
        values[k - lowest] = page
    return values


def _numbers_in_names(files: Sequence[Path]) -> list[int]:
    """Return the number of each slice: of the numbers in its name the one that changes.

    Where the names differ in more than one number, or in words, it is the last of them.

    Raises:
        RefusedError: A name has no number.
    """
    numbers = [re.findall(r"\d+", file.stem) for file in files]
    for file, found in zip(files, numbers, strict=True):
        require(bool(found), file.name, "no number", "a number in the name of each slice")
    words = {re.sub(r"\d+", "#", file.stem) for file in files}
    place = -1
    if len(words) == 1:
        columns = list(zip(*numbers, strict=True))
        changing = [k for k, column in enumerate(columns) if len(set(map(int, column))) > 1]
        place = changing[-1] if changing else -1
    return [int(found[place]) for found in numbers]


def _read_picture(path: Path, is_square: bool) -> Array:
    """Read the pixels of an image file with one page of grey values, top row first."""
    with opened_picture(path) as picture:
        mode, frames = picture.mode, getattr(picture, "n_frames", 1)
        is_grey = mode in PLANE_MODES or (mode in COLOUR_MODES and frames == 1)
        if not is_grey or frames > 1:
            what = f"of mode {mode} with {frames} pages"
            cure = "save the one meant as grey values; a volume takes cell.voxel"
            raise RefusedError(path.name, what, "one page of grey values", cure)
        dpi_x, dpi_y = map(float, picture.info.get("dpi", (1, 1)))
        if is_square and abs(dpi_x / dpi_y - 1) > 0.01:
            what = f"of pixels {dpi_x:g} by {dpi_y:g} per inch"
            raise RefusedError(path.name, what, "square ones", "give cell.pixel = [width, height]")
        require_memory((picture.height, picture.width))
        if mode in COLOUR_MODES:
            return _grey_of_colours(path.name, np.asarray(picture.convert("RGBA")))
        values = np.asarray(picture)
        tags = tags_of(picture)
        is_signed = tags.get(SAMPLE_FORMAT, (1,)) == (SIGNED,)
        is_wrapped = not is_signed and mode == "I" and values.min() < 0  # of unsigned 32 bits
        if is_wrapped or (is_signed and mode == "L"):
            what = f"of integers whose sign Pillow changes, as {values.min()}"
            raise RefusedError(path.name, what, "values from 0 to 2³¹ − 1", "save it as .npy")
        photometric = tags.get(PHOTOMETRIC)
        if mode == "L" and photometric == WHITE_IS_ZERO:
            values = np.uint8(255) - values  # as stored: Pillow has inverted them
        return as_shown(path.name, values, photometric)


def _grey_of_colours(name: str, values: Array) -> Array:
    """Return the grey values of an opaque picture whose red, green and blue are equal.

    Args:
        name: Name of the file.
        values: Red, green, blue and opacity, shape (rows, columns, 4), 255 where opaque.

    Raises:
        RefusedError: It has colours, or is transparent somewhere.
    """
    red = values[..., 0]
    is_grey = (values[..., 1] == red).all() and (values[..., 2] == red).all()
    cure = "save it as grey values"
    require(is_grey, name, "in colours", "one page of grey values", cure)
    require((values[..., 3] == 255).all(), name, "transparent in places", "opaque pixels", cure)
    return np.ascontiguousarray(red)


def needed_memory(shape: tuple[int, ...], division: int = 1) -> float:
    """Bytes that the cuts of a grid take with so many elements along each side of a cell."""
    elements = math.prod(shape) * math.prod([division] * len(shape))
    return PROGRAM_BYTES + BYTES_PER_ELEMENT[len(shape)] * elements


def require_memory(shape: tuple[int, ...], division: int = 1) -> None:
    """Refuse a grid whose solution needs more memory than this machine has."""
    available = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    needed, n = needed_memory(shape, division), len(shape)
    if needed > available:
        side = int((available / BYTES_PER_ELEMENT[n]) ** (1 / n) / division)
        what = f"{' × '.join(map(str, shape))} {'pixels' if n == 2 else 'voxels'}"
        allowed = f"up to {available / 1e9:.0f} GB of memory"
        cure = f"crop a piece of {' × '.join([str(side)] * n)}"
        raise RefusedError("image", f"{what}, about {needed / 1e9:.0f} GB", allowed, cure)
