"""Grey values or labels of pixels and voxels from files: images, stacks, folders, raw data.

A picture is read with row 0 at the bottom, so that y points up. The axes of a volume are (z, y, x)
as its file orders them: pages or slices along z, rows along y, columns along x.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require

PLANE_MODES = ("1", "L", "I;16", "I;16B", "I;16L", "I", "F")
PHOTOMETRIC, WHITE_IS_ZERO = 262, 0  # tag of TIFF and its value
SAMPLE_FORMAT, SIGNED = 339, 2
PROGRAM_BYTES = 1.7e8
"""Memory of the program and its libraries."""
BYTES_PER_ELEMENT = {2: 1450, 3: 1600}
"""Memory of an element in the cuts' solutions with their first guess, by dimension; within 1.25 of
peaks at 128² … 512² pixels of two elements a side, 512² and 1024² of one, 64³ … 128³ voxels."""
MAX_COLOURS = 4  # pages that a file calls channels are colours up to so many, else slices
TAKE_VOXEL = "a volume takes cell.voxel in place of cell.pixel"
TAKE_PIXEL = "a picture takes cell.pixel in place of cell.voxel"
SLICES = (".tif", ".tiff", ".png", ".bmp")
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float": "f4", "double": "f8",
}  # fmt: skip
"""Of numbers in raw data, by the names of MetaImage and NRRD without "MET_" and spaces."""


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
            values = np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))
        elif dimension == 2:
            values = _read_picture(path, has_equal_sides)
        else:
            values = _read_volume(path, sides)
    except (RefusedError, MemoryError):
        raise
    except Exception as error:  # readers of damaged files raise errors of many kinds
        allowed = "an image or an array" if dimension == 2 else "a volume"
        raise RefusedError(path.name, f"unreadable ({error})", allowed) from error
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
    data = _data_of_head(path, _read_head(path)[0]) if is_head else path
    return [path, data] if data != path and data.is_file() else [path]


def _read_volume(path: Path, sides: Sequence[float]) -> Array:
    """Numbers of a volume along the axes (z, y, x)."""
    if path.is_dir():
        return _read_slices(path, sides[-1] == sides[-2])
    if path.suffix.lower() in (".tif", ".tiff"):
        return _read_stack(path)
    if path.suffix.lower() in (".mhd", ".mha", ".nhdr", ".nrrd"):
        return _read_raw(path, sides)
    allowed = "a TIFF stack, a folder of slices, .npy, .mhd or .nhdr"
    cure = "write raw data beside a .mhd head with DimSize, ElementType and ElementDataFile"
    if path.suffix.lower() in (*SLICES, ".jpg", ".jpeg"):
        cure = TAKE_PIXEL
    raise RefusedError(path.name, f"a file of kind {path.suffix or 'unknown'}", allowed, cure)


def _read_slices(folder: Path, is_square: bool) -> Array:
    """The pictures of a folder one above another, in the order of the numbers in their names."""
    files = files_of(folder)
    allowed = "a folder of slices, PNG, TIFF or BMP"
    require(len(files) > 1, folder.name, f"{len(files)} pictures", allowed)
    by_number = {}
    for file in files:
        digits = re.findall(r"\d+", file.stem)
        require(bool(digits), file.name, "no number", "a number in the name of each slice")
        by_number[int(digits[-1])] = file
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


def _read_stack(path: Path) -> Array:
    """Pages of a TIFF file; which axis they are the file says."""
    try:
        import tifffile
    except ImportError:
        cure = "install tifffile, or save the volume as .npy"
        raise RefusedError(path.name, "a TIFF stack", "no stack without tifffile", cure) from None
    with tifffile.TiffFile(path) as file:
        require(len(file.series) == 1, path.name, f"{len(file.series)} series", "one volume")
        series = file.series[0]
        axes, shape = series.axes, series.shape
        pages = [(a, n) for a, n in zip(axes, shape, strict=True) if a not in "YX" and n > 1]
        is_colour = "S" in axes or any(a == "C" and n <= MAX_COLOURS for a, n in pages)
        is_volume = len(pages) == 1 and not is_colour
        what = f"axes {axes} of {' × '.join(map(str, shape))}"
        cure = "save the volume meant, one number a voxel, with axes ZYX or as .npy"
        require(is_volume, path.name, what, "pages along z, rows, columns", cure)
        require_memory(tuple(n for n in shape if n > 1))
        values = np.squeeze(series.asarray())
        _require_clear_mask(path, values, getattr(file.pages[0], "photometric", None))
    return np.asarray(values)


def _read_head(path: Path) -> tuple[dict[str, str], int]:
    """Values by small keys of a MetaImage (key = value) or NRRD head (key: value); its bytes."""
    head, size = {}, 0
    with path.open("rb") as file:
        for line in file:
            size += len(line)
            key, *value = re.split(r":=|[=:]", line.decode("latin-1").strip(), maxsplit=1)
            head[key.strip().lower()] = "".join(value).strip()
            if key == "" or key.strip() == "ElementDataFile":  # raw data may follow
                break
    return head, size


def _data_of_head(path: Path, head: Mapping[str, str]) -> Path:
    """The file of the raw data, which may be that of the head."""
    keys = "elementdatafile", "data file", "datafile"
    name = next((head[key] for key in keys if key in head), "LOCAL")
    return path if name == "LOCAL" else path.parent / name


def _read_raw(path: Path, sides: Sequence[float]) -> Array:
    """Volume (z, y, x) of a MetaImage or NRRD head, sizes along x, y, z, and of its raw data."""
    head, size = _read_head(path)

    def value(*keys: str) -> str:
        return next((head[key] for key in keys if key in head), "")

    name, data = path.name, _data_of_head(path, head)
    type_name = value("elementtype", "type").lower().removeprefix("met_").removeprefix("signed ")
    kind, sizes = TYPES.get(type_name.replace("unsigned ", "u")), value("dimsize", "sizes").split()
    byte_order = value("binarydatabyteordermsb", "elementbyteordermsb", "endian").lower()
    is_compressed = value("compresseddata").lower() == "true" or value("encoding").lower() not in (
        "",
        "raw",
    )
    n_head_bytes = size if data == path else int(value("headersize", "byte skip") or 0)
    directions = re.findall(r"\(([^)]*)\)", value("space directions"))
    lengths = [math.hypot(*map(float, vector.split(","))) for vector in directions]
    spacing = [*map(float, value("elementspacing", "spacings").split())] or lengths
    require(kind is not None, name, "a type that is not known", "whole numbers or floats")
    require(not is_compressed, name, "compressed data", "raw data", "save it without compression")
    require(len(sizes) == 3, name, f"{len(sizes)} sizes", "three, along x, y and z")
    require(data.is_file(), name, f"data in {data.name}", "a file beside the head")
    stated = np.array(spacing[::-1] or sides) / np.asarray(sides, float)
    if stated.max() > 1.01 * stated.min():
        what = f"voxels of {' × '.join(f'{x:g}' for x in spacing)} along x, y, z"
        given = " : ".join(f"{side:g}" for side in reversed(sides))
        raise RefusedError(name, what, given, "give cell.voxel = [x, y, z] as they are")
    shape = tuple(int(n) for n in reversed(sizes))
    require_memory(shape)
    dtype = np.dtype((">" if byte_order in ("true", "big") else "<") + str(kind))
    expected = n_head_bytes + math.prod(shape) * dtype.itemsize
    found = data.stat().st_size
    allowed = f"{expected} for {' × '.join(sizes)} of {dtype}"
    require(found == expected, data.name, f"{found} bytes", allowed)
    values = np.fromfile(data, dtype, offset=n_head_bytes).reshape(shape)
    return values.astype(dtype.newbyteorder("="))


def _require_clear_mask(path: Path, values: Array, photometric: object) -> None:
    """Refuses a mask whose white is zero: tifffile writes such, and readers exchange the phases."""
    if photometric == WHITE_IS_ZERO and len(np.unique(values)) == 2:
        bright_fraction = np.mean(values == values.max())
        what = f"two-valued with white as zero, bright on {bright_fraction:.4g}"
        cure = "save it as .npy or PNG, and look at the fractions that check prints"
        raise RefusedError(path.name, what, "masks that all programs read alike", cure)


def _read_picture(path: Path, is_square: bool) -> Array:
    """Read the pixels of an image file with one page of grey values, top row first."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = None  # the memory is checked here, before the pixels are read
    with Image.open(path) as picture:
        mode, frames = picture.mode, getattr(picture, "n_frames", 1)
        if mode not in PLANE_MODES or frames > 1:
            what = f"of mode {mode} with {frames} pages"
            cure = "save the one meant as grey values; a volume takes cell.voxel"
            raise RefusedError(path.name, what, "one page of grey values", cure)
        dpi_x, dpi_y = map(float, picture.info.get("dpi", (1, 1)))
        if is_square and abs(dpi_x / dpi_y - 1) > 0.01:
            what = f"of pixels {dpi_x:g} by {dpi_y:g} per inch"
            raise RefusedError(path.name, what, "square ones", "give cell.pixel = [width, height]")
        require_memory((picture.height, picture.width))
        values = np.asarray(picture)
        tags = getattr(picture, "tag_v2", {})
        _require_clear_mask(path, values, tags.get(PHOTOMETRIC))
        is_signed = tags.get(SAMPLE_FORMAT, (1,)) == (SIGNED,)
        is_wrapped = not is_signed and mode == "I" and values.min() < 0  # of unsigned 32 bits
        if is_wrapped or (is_signed and mode == "L"):
            what = f"of integers whose sign Pillow changes, as {values.min()}"
            raise RefusedError(path.name, what, "values from 0 to 2³¹ − 1", "save it as .npy")
        return values


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
