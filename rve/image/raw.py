"""Volumes of numbers beside or behind a head: MetaImage (.mhd, .mha) and NRRD (.nhdr, .nrrd)."""

from __future__ import annotations

import math
import re
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, require
from alphacut.rve.image.spacing import require_spacing

HEADS = (".mhd", ".mha", ".nhdr", ".nrrd")
TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "float": "f4", "double": "f8",
}  # fmt: skip
"""Of numbers in raw data, by the names of MetaImage and NRRD without "MET_" and spaces."""
LONGEST_HEAD = 1 << 16
"""Bytes in which a head ends; usual ones have less than a thousand."""
MAX_VOXELS = 1 << 40
YES = ("true", "t", "1", "yes")
GZIP_OR_ZLIB = 47  # of zlib: the largest window, and either of both heads
PERPENDICULAR = 1e-3
"""Largest component of an axis's unit vector along the other axes."""


Axes = tuple[int, int, int]
Lookup = Callable[..., str]
"""Value in a head by its keys, of which the first that is there counts; empty if none is."""


@dataclass(frozen=True)
class RawHead:
    """What a head says of its volume.

    Args:
        path: File of the head.
        data: File of the numbers, which may be that of the head.
        offset: Bytes before the numbers; −1 if they are the last bytes of the file.
        dtype: Type of a number, with its byte order.
        sizes: Numbers along each axis of the file, the fastest first.
        axes: Which of x, y, z each axis of the file runs along, as 0, 1, 2.
        signs: −1 of an axis that runs backwards, else 1.
        is_compressed: Whether the numbers are compressed by zlib or gzip.
    """

    path: Path
    data: Path
    offset: int
    dtype: np.dtype[np.generic]
    sizes: Axes
    axes: Axes
    signs: Axes
    is_compressed: bool

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers along z, y, x."""
        of_axis = dict(zip(self.axes, self.sizes, strict=True))
        return of_axis[2], of_axis[1], of_axis[0]

    def read(self) -> Array:
        """Return the numbers along z, y, x; refuse a file of another size than the head says."""
        expected = math.prod(self.sizes) * self.dtype.itemsize
        found = self.data.stat().st_size
        sizes = " × ".join(map(str, self.sizes))
        name, allowed = self.data.name, f"{expected} for {sizes} of {self.dtype}"
        if self.is_compressed:
            content = self._decompressed(expected)
            require(len(content) == expected, name, f"{len(content)} bytes unpacked", allowed)
            values = np.frombuffer(content, self.dtype)
        else:
            offset = found - expected if self.offset < 0 else self.offset
            allowed = f"{offset} + {allowed}" if offset > 0 else allowed
            require(offset >= 0 and found == offset + expected, name, f"{found} bytes", allowed)
            values = np.fromfile(self.data, self.dtype, offset=offset)
        values = values.reshape(self.sizes[::-1]).astype(self.dtype.newbyteorder("="))
        # axis k of the array is axis 2 − k of the file; those of the world are wanted as z, y, x
        place = {axis: 2 - k for k, axis in enumerate(self.axes)}
        sign = dict(zip(self.axes, self.signs, strict=True))
        ordered = values.transpose(place[2], place[1], place[0])
        return np.asarray(ordered[:: sign[2], :: sign[1], :: sign[0]])

    def _decompressed(self, expected: int) -> bytes:
        """Up to one byte more than expected, so that a file that unpacks to gigabytes does not."""
        with self.data.open("rb") as file:
            file.seek(max(self.offset, 0))
            packed = file.read()
        try:
            return zlib.decompressobj(GZIP_OR_ZLIB).decompress(packed, expected + 1)
        except zlib.error as error:
            raise RefusedError(self.data.name, f"damaged ({error})", "gzip or zlib") from None


def read_head(path: Path, sides: Sequence[float]) -> RawHead:
    """Return the head of a volume, whose voxels must have sides of the given ratios.

    Args:
        path: File of the head.
        sides: Sides of a voxel along (z, y, x), in any unit.

    Raises:
        RefusedError: The head lacks something, or says what is not read.
    """
    entries, size = _entries(path)

    def value(*keys: str) -> str:
        return next((entries[key] for key in keys if key in entries), "")

    name, data = path.name, data_of_head(path)
    type_name = value("elementtype", "type").lower().removeprefix("met_").removeprefix("signed ")
    kind = TYPES.get(type_name.replace("unsigned ", "u").removesuffix("_t"))
    require(kind is not None, name, "a type that is not known", "whole numbers or floats")
    sizes = value("dimsize", "sizes").split()
    require(len(sizes) == 3, name, f"{len(sizes)} sizes", "three, along x, y and z")
    are_whole = all(re.fullmatch(r"\+?\d{1,9}", n) and int(n) > 0 for n in sizes)
    are_whole = are_whole and math.prod(map(int, sizes)) <= MAX_VOXELS
    require(are_whole, name, f"sizes {' '.join(sizes)}", "whole numbers greater than 0")
    require(data.is_file(), name, f"data in {data.name}", "a file beside the head")
    encoding = value("encoding").lower() or "raw"
    is_packed = value("compresseddata").lower() in YES or encoding in ("gzip", "gz")
    is_text = value("binarydata").lower() not in ("", *YES)
    is_read = encoding in ("raw", "gzip", "gz") and not is_text
    cure = "save it without compression"
    require(is_read, name, f"data in encoding {encoding}", "raw or gzip", cure)
    channels = value("elementnumberofchannels") or "1"
    require(channels == "1", name, f"{channels} numbers a voxel", "one")
    byte_order = value("binarydatabyteordermsb", "elementbyteordermsb", "endian").lower()
    layout = _layout(name, value)
    along = dict(zip(layout.axes, layout.spacing, strict=True))
    require_spacing(name, (along[0], along[1], along[2]), sides)
    first, second, third = map(int, sizes)
    return RawHead(
        path,
        data,
        size if data == path else _skipped(name, value, is_packed=is_packed),
        np.dtype((">" if byte_order in (*YES, "big") else "<") + str(kind)),
        (first, second, third),
        layout.axes,
        layout.signs,
        is_packed,
    )


def data_of_head(path: Path) -> Path:
    """Return the file of the numbers, which may be that of the head."""
    entries, _ = _entries(path)
    keys = "elementdatafile", "data file", "datafile"
    name = next((entries[key] for key in keys if key in entries), "LOCAL")
    return path if name == "LOCAL" else path.parent / name


def _entries(path: Path) -> tuple[Mapping[str, str], int]:
    """Values by small keys of a MetaImage (key = value) or NRRD head (key: value); its bytes."""
    entries: dict[str, str] = {}
    size = 0
    with path.open("rb") as file:
        start = file.read(LONGEST_HEAD)
    for line in start.splitlines(keepends=True):
        size += len(line)
        key, *value = re.split(r":=|[=:]", line.decode("latin-1").strip(), maxsplit=1)
        entries[key.strip().lower()] = "".join(value).strip()
        if key == "" or key.strip() == "ElementDataFile":  # raw data may follow
            return entries, size
    is_whole = len(start) < LONGEST_HEAD
    require(is_whole, path.name, "without an end of its head", f"{LONGEST_HEAD} bytes")
    return entries, size


def _skipped(name: str, value: Lookup, *, is_packed: bool) -> int:
    """Bytes before the numbers in a file beside the head; −1 if these are its last bytes."""
    lines = value("line skip", "lineskip") or "0"
    require(lines == "0", name, f"a line skip of {lines}", "0", "give the bytes: byte skip")
    text = value("headersize", "byte skip", "byteskip") or "0"
    is_count = re.fullmatch(r"\+?\d{1,15}", text) is not None
    is_end = text == "-1" and not is_packed
    allowed = "a whole number, or −1 of raw data"
    require(is_count or is_end, name, f"{text} bytes to skip", allowed)
    return int(text)


class _Layout(NamedTuple):
    """Axes and signs as in `RawHead`, and the distance of voxels along each axis of the file.

    A distance is nan where the head does not state it.
    """

    axes: Axes
    signs: Axes
    spacing: tuple[float, float, float]


def _layout(name: str, value: Lookup) -> _Layout:
    """Return how the axes of the file lie; refuse axes that do not run along x, y and z."""
    directions = value("space directions")
    vectors = [_numbers(name, x) for x in re.findall(r"\(([^)]*)\)", directions)]
    if matrix := _numbers(name, value("transformmatrix", "rotation", "orientation")):
        require(len(matrix) == 9, name, f"a matrix of {len(matrix)} numbers", "nine")
        vectors = [matrix[:3], matrix[3:6], matrix[6:]]
    spacing = _numbers(name, value("elementspacing", "spacings", "elementsize"))
    require(len(spacing) in (0, 3), name, f"{len(spacing)} spacings", "three")
    if not vectors:
        x, y, z = spacing or [math.nan] * 3
        return _Layout((0, 1, 2), (1, 1, 1), (x, y, z))
    are_three = [len(vector) for vector in vectors] == [3, 3, 3]
    require(are_three, name, f"directions {vectors}", "three vectors of three numbers")
    lengths = np.linalg.norm(vectors, axis=1)
    allowed = "directions along x, y and z, each once"
    cure = "resample the volume along the axes"
    require(bool((lengths > 0).all()), name, f"directions {vectors}", allowed, cure)
    units = np.array(vectors) / lengths[:, None]
    axes = np.abs(units).argmax(axis=1)
    along = units[np.arange(3), axes]
    # of a unit vector with the component c along an axis, 1 − c is half the square of the rest
    is_along = bool((1 - np.abs(along) <= PERPENDICULAR**2 / 2).all())
    is_each_once = sorted(axes.tolist()) == [0, 1, 2]
    require(is_along and is_each_once, name, f"directions {vectors}", allowed, cure)
    first, second, third = (int(axis) for axis in axes)
    signs = np.sign(along).astype(int).tolist()
    x, y, z = spacing or lengths.tolist()
    return _Layout((first, second, third), (signs[0], signs[1], signs[2]), (x, y, z))


def _numbers(name: str, text: str) -> list[float]:
    """The finite numbers or nans of a text, between blanks or commas."""
    try:
        numbers = [float(word) for word in re.split(r"[\s,]+", text.strip()) if word]
    except ValueError:
        raise RefusedError(name, repr(text[:40]), "numbers such as 1.25") from None
    require(not any(map(math.isinf, numbers)), name, text[:40], "finite numbers")
    return numbers
