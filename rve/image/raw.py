"""Volumes of numbers beside or behind a head: MetaImage (.mhd, .mha) and NRRD (.nhdr, .nrrd)."""

from __future__ import annotations

import math
import os
import re
import zlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError, require
from alphacut.base.units import decoded
from alphacut.rve.image.spacing import StatedSpacing, require_spacing, unit_in_texts

HEADS = (".mhd", ".mha", ".nhdr", ".nrrd")
"""Endings of files with such a head."""


@dataclass(frozen=True, eq=False)
class RawHead:
    """What a head says of its volume.

    The axes of the stored array are those of the file in reverse order, so that the last one is the
    fastest.

    Args:
        data: Files of the numbers one after another, of which one may be that of the head.
        offset: Bytes before the numbers of each; −1 if they are the last bytes of the file.
        dtype: Type of a number, with its byte order.
        stored_shape: Numbers along each axis of the stored array.
        order: Axes of the stored array along z, y and x, shape (3,).
        reversed_axes: Axes of the stored array that run against z, y or x.
        is_compressed: Whether the numbers are compressed by zlib or gzip.
    """

    data: tuple[Path, ...]
    offset: int
    dtype: np.dtype[np.generic]
    stored_shape: tuple[int, ...]
    order: Ints
    reversed_axes: tuple[int, ...]
    is_compressed: bool

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers along z, y, x."""
        return tuple(self.stored_shape[axis] for axis in self.order)

    def read(self) -> Array:
        """Return the numbers of the volume along z, y, x, in the byte order of this machine.

        Axes that run backwards are turned. The file is read as a whole.

        Raises:
            RefusedError: The file has another size than the head says, or cannot be unpacked.
            OSError: The file cannot be read.
        """
        expected = math.prod(self.stored_shape) * self.dtype.itemsize // len(self.data)
        sizes = " × ".join(map(str, self.stored_shape[::-1]))
        cure = "mend the sizes and the type in the head, or copy the data anew"
        parts = []
        for file in self.data:
            found = file.stat().st_size
            allowed = f"{expected} for {sizes} of {self.dtype}"
            if self.is_compressed:
                content = self._decompressed(file, expected)
                is_whole = len(content) == expected
                require(is_whole, file.name, f"{len(content)} bytes unpacked", allowed, cure)
                parts.append(np.frombuffer(content, self.dtype))
                continue
            # A skip of −1 means that the numbers are the last bytes, whatever stands before them.
            offset = self.offset if self.offset >= 0 else found - expected
            if offset > 0:
                allowed = f"{offset} + {allowed}"
            is_whole = offset >= 0 and found == offset + expected
            require(is_whole, file.name, f"{found} bytes", allowed, cure)
            parts.append(np.fromfile(file, self.dtype, offset=offset))
        values = np.concatenate(parts)
        values = values.reshape(self.stored_shape).astype(self.dtype.newbyteorder("="))
        return np.asarray(np.flip(values, self.reversed_axes).transpose(self.order))

    def _decompressed(self, file: Path, expected: int) -> bytes:
        """Return the unpacked numbers of a file: one byte more than expected at most.

        Args:
            file: The file.
            expected: Bytes that the head promises. A result of another length tells that it is
                wrong.

        Raises:
            RefusedError: The data is not compressed by gzip or zlib, or is damaged.
            OSError: The file cannot be read.
        """
        packed = file.read_bytes()[max(self.offset, 0) :]
        # The limit stops a small file that would unpack to gigabytes.
        gzip_or_zlib = 47  # zlib's code: the largest window, 15, plus 32 to detect which head it is
        try:
            return zlib.decompressobj(gzip_or_zlib).decompress(packed, expected + 1)
        except zlib.error as error:
            raise RefusedError(file.name, f"damaged ({error})", "gzip or zlib") from None


def read_head(path: Path, sides: Sequence[float], override: Collection[str] = ()) -> RawHead:
    """Return the head of a volume, whose voxels must have the given sides.

    Args:
        path: File of the head.
        sides: Sides of a voxel along (z, y, x), in m.
        override: "voxel", where the head states wrong ones.

    Raises:
        RefusedError: The head lacks something, or says what is not read.
    """
    entries = _Entries.of_file(path)
    name = path.name
    data = data_of_head(path)
    yes = ("true", "t", "1", "yes")
    # NumPy's types by the names of MetaImage and NRRD without "MET_" and spaces
    types = {
        "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
        "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
        "float": "f4", "double": "f8",
    }  # fmt: skip
    type_name = entries.value("elementtype", "type").lower()
    type_name = re.sub("(?<=short) int", "", type_name).removeprefix("met_").removeprefix("signed ")
    kind = types.get(type_name.replace("unsigned ", "u").removesuffix("_t"))
    require(kind is not None, name, "a type that is not known", "whole numbers or floats")

    sizes = entries.value("dimsize", "sizes").split()
    require(len(sizes) == 3, name, f"{len(sizes)} sizes", "three, along x, y and z")
    are_whole = all(re.fullmatch(r"\+?\d{1,9}", size) and int(size) > 0 for size in sizes)
    are_whole = are_whole and math.prod(map(int, sizes)) <= 1 << 40
    require(are_whole, name, f"sizes {' '.join(sizes)}", "whole numbers greater than 0")
    for file in data:  # folders and devices are no data
        value = f"data in {os.path.relpath(file, path.parent)}, which is no file"
        cure = "put the data there, or mend the name in the head"
        require(file.is_file(), name, value, "a file, from the folder of the head", cure)
    fits = len(data) == 1 or len(data) == int(sizes[2])
    require(fits, name, f"of {len(data)} files of data", "one, or one for each z")

    encoding = entries.value("encoding").lower() or "raw"
    is_gzip = encoding in ("gzip", "gz")
    is_packed = entries.value("compresseddata").lower() in yes or is_gzip
    binary = entries.value("binarydata").lower()
    is_text = binary != "" and binary not in yes
    is_read = (encoding == "raw" or is_gzip) and not is_text
    cure = "save it without compression"
    require(is_read, name, f"data in encoding {encoding}", "raw or gzip", cure)
    channels = entries.value("elementnumberofchannels") or "1"
    require(channels == "1", name, f"{channels} numbers a voxel", "one")

    # Spacings are those of the axes of the file, the case's those of x, y and z.
    layout = _layout(name, entries)
    order = np.argsort(layout.axes)  # of the axes of the file along x, y, z
    lengths = [float(layout.lengths[axis]) for axis in order]
    text = entries.value("units", "space units", "distanceunits")
    units = [quoted or bare for quoted, bare in re.findall(r'"([^"]*)"|([^\s"]+)', text)]
    units = [""] * 3 if len(units) not in (1, 3) or units == ["?"] else (3 * units)[:3]
    # Units stand in the order of the axes of the file, those of a space in that of x, y and z.
    in_file_order = "units" in entries.values
    ordered = [units[axis] for axis in order] if in_file_order else units
    labels = " ".join(entries.value(key) for key in ("kinds", "labels", "space"))
    others = r'\btime\b|"t"|\b(?:list|\w*vector|\w*color|complex|\w*matrix|normal)\b'
    is_other = re.search(others, labels) or {"s", "ms", "sec"} & {u.lower() for u in units}
    require(not is_other, name, f"with another axis, {labels}", "three axes of space")
    known = (
        "units",
        "spacings",
        "thicknesses",
        "elementspacing",
        "elementsize",
        "elementdatafile",
        "data file",
    )
    texts = [f"{key}: {value}" for key, value in entries.values.items() if key not in known]
    if not any(units):
        ordered = [unit_in_texts(texts)] * 3
    counts = [int(sizes[axis]) for axis in order]
    stated = StatedSpacing(lengths, ordered, texts)
    require_spacing(name, stated, sides, counts=counts, override=override)
    endian = entries.value("binarydatabyteordermsb", "elementbyteordermsb", "endian")
    # NRRD asks for it beside numbers of several bytes; MetaImage means the little one without it.
    is_stated = bool(endian) or "elementtype" in entries.values or np.dtype(kind).itemsize == 1
    allowed = "endian: little, or big"
    require(is_stated, name, "without its order of bytes", allowed, "write it into the head")
    byte_order: Literal[">", "<"] = "<"
    if endian.lower() in ("big", *yes):
        byte_order = ">"
    offset = entries.size
    if data != (path,):
        offset = _skipped(name, entries, is_packed=is_packed)
    return RawHead(
        data=data,
        offset=offset,
        dtype=np.dtype(kind).newbyteorder(byte_order),
        stored_shape=tuple(int(size) for size in reversed(sizes)),
        order=np.argsort(2 - layout.axes[::-1]),
        reversed_axes=tuple(k for k in range(3) if layout.signs[2 - k] < 0),
        is_compressed=is_packed,
    )


def data_of_head(path: Path) -> tuple[Path, ...]:
    """Return the files of the numbers, of which one may be that of the head.

    A head names one file, LOCAL for its own, LIST above the names of slices, or a pattern of names
    with the first and the last number, and perhaps the step, as "slice%02d.raw 0 5 1".

    Raises:
        RefusedError: A list or a pattern names a file outside the folder of the head, or more than
            100,000 of them.
    """
    entries = _Entries.of_file(path)
    name = entries.value("elementdatafile", "data file", "datafile") or "LOCAL"
    names = [name]
    pattern = re.fullmatch(
        r"([^%]*%0?\d?d[^%]*?)\s+(\d{1,9})\s+(\d{1,9})(?:\s+([1-9]\d{0,8}))?.*", name
    )
    if name == "LOCAL":
        return (path,)
    if re.fullmatch(r"LIST(?:\s+\d+)?", name):
        names = list(entries.listed)
    elif pattern:
        numbers = range(int(pattern[2]), int(pattern[3]) + 1, int(pattern[4] or 1))
        names = [pattern[1] % number for number in numbers[: 10**5 + 1]]
    if names != [name]:
        is_beside = all(Path(one).name == one for one in names) and 0 < len(names) <= 10**5
        cure = "put all slices into the folder of the head, and list their names"
        require(is_beside, path.name, f"with the data {name}", "files beside it", cure)
    return tuple(path.parent / one for one in names)


@dataclass(frozen=True)
class _Entries:
    """Entries of a head.

    Args:
        values: Values by keys in small letters.
        size: Bytes of the head, with the line that ends it.
        listed: Lines behind the one that ends the head or begins a list of files.
    """

    values: dict[str, str]
    size: int
    listed: tuple[str, ...] = ()

    @classmethod
    def of_file(cls, path: Path) -> _Entries:
        """Return the entries of a head and its length.

        Its lines are "key = value" in MetaImage and "key: value" in NRRD. The head ends with an
        empty line, or with the line of ElementDataFile; raw data may follow.

        Args:
            path: File that begins with the head.

        Returns:
            Values by keys in small letters, and the number of bytes of the head with the line that
            ends it. Of equal keys the last one counts; a line without a separator has an empty
            value.

        Raises:
            RefusedError: The file does not end its head within 64 KiB; usual heads are shorter than
                1 KiB.
            OSError: The file cannot be read.
        """
        longest_head = 1 << 16
        values: dict[str, str] = {}
        size = 0
        with path.open("rb") as file:
            start = file.read(longest_head)
        lines = start.splitlines(keepends=True)
        for row, line in enumerate(lines, 1):
            size += len(line)
            key, *value = re.split(r":=|[=:]", decoded(line).strip(), maxsplit=1)
            text = "".join(value).strip()
            name = key.strip().lower()
            if name.startswith(("#", "comment")) and name in values:
                text = f"{values[name]}; {text}"
            values[name] = text
            is_list = text.startswith("LIST")
            if name in ("", "elementdatafile") or is_list:  # raw data may follow
                listed = [text.decode("latin-1").strip() for text in lines[row:]] if is_list else []
                return cls(values, size, tuple(filter(None, listed)))
        is_whole = len(start) < longest_head
        require(is_whole, path.name, "without an end of its head", f"{longest_head} bytes")
        return cls(values, size)

    def value(self, *keys: str) -> str:
        """Return the value of the first of some keys that is there; empty where none is."""
        return next((self.values[key] for key in keys if key in self.values), "")


def _skipped(name: str, entries: _Entries, *, is_packed: bool) -> int:
    """Return the bytes to skip before the numbers in a file beside the head.

    Args:
        name: Name of the head, for messages.
        entries: Its entries, of which HeaderSize (MetaImage), byte skip and line skip (NRRD) are
            used.
        is_packed: Whether the numbers are compressed.

    Returns:
        Number of bytes, 0 if the head states none; −1 if the numbers are the last bytes of the
        file, which is allowed only without compression.

    Raises:
        RefusedError: The head states lines to skip, or no whole number of bytes.
    """
    lines = entries.value("line skip", "lineskip") or "0"
    require(lines == "0", name, f"a line skip of {lines}", "0", "give the bytes: byte skip")
    text = entries.value("headersize", "byte skip", "byteskip") or "0"
    is_count = re.fullmatch(r"\+?\d{1,15}", text) is not None
    is_end = text == "-1" and not is_packed
    allowed = "a whole number, or −1 of raw data"
    require(is_count or is_end, name, f"{text} bytes to skip", allowed)
    return int(text)


class _Layout(NamedTuple):
    """How the axes of a file lie, in the order of the file, the fastest first.

    Attributes:
        axes: Which of x, y, z each axis runs along, as 0, 1, 2, shape (3,).
        signs: −1 for an axis that runs backwards, else 1, shape (3,).
        lengths: Distance of voxels along each axis, nan where the head does not state it, shape
            (3,).
    """

    axes: Ints
    signs: Array
    lengths: Array


def _layout(name: str, entries: _Entries) -> _Layout:
    """Return how the axes of a volume's file lie, from the directions and spacings of its head.

    Args:
        name: Name of the head, for messages.
        entries: Its entries.

    Returns:
        For each axis of the file, the fastest first: which of x, y and z it runs along, as 0, 1 or
        2; −1 if it runs backwards, else 1; and the distance of voxels along it, NaN where the head
        does not state it. Each has the shape (3,). Without directions the axes are x, y and z, none
        backwards.

    Raises:
        RefusedError: There are not three spacings or nine numbers of directions, one is no finite
            number, or the axes do not run along x, y and z, each once.
    """
    spacing = _numbers(name, entries.value("elementspacing", "spacings", "elementsize"))
    require(len(spacing) in (0, 3), name, f"{len(spacing)} spacings", "three")
    ends = [_numbers(name, entries.value(key)) for key in ("axis mins", "axis maxs")]
    sizes = _numbers(name, entries.value("sizes"))
    if not spacing and all(len(numbers) == 3 for numbers in (*ends, sizes)):
        is_of_nodes = "node" in entries.value("centerings", "centers")  # at both ends
        spacing = list(np.abs(np.subtract(ends[1], ends[0])) / np.subtract(sizes, is_of_nodes))
    lengths = np.array(spacing or [math.nan] * 3)
    # A slice's thickness is its distance where none is stated, since slices may overlap.
    thick = _numbers(name, entries.value("thicknesses"))
    if len(thick) == 3:
        lengths = np.where(np.isnan(lengths), thick, lengths)
    # NRRD writes vectors in brackets, which may be as long as a voxel; MetaImage has three names.
    text = entries.value("space directions", "transformmatrix", "rotation", "orientation")
    directions = _numbers(name, re.sub("[()]", " ", text))
    if not directions:
        return _Layout(np.arange(3), np.ones(3), lengths)

    require(len(directions) == 9, name, f"directions of {len(directions)} numbers", "nine")
    vectors = np.reshape(directions, (3, 3))
    norms = np.linalg.norm(vectors, axis=1)
    with np.errstate(invalid="ignore"):  # a vector of zeros has no direction
        units = vectors / norms[:, np.newaxis]
    axes = np.nan_to_num(abs(units)).argmax(axis=1)
    along = units[np.arange(3), axes]
    # A unit vector with the component c along an axis has √(1 − c²) across it, at most 1e-3.
    is_along = bool((1 - abs(along) <= 1e-3**2 / 2).all())
    is_each_once = sorted(axes.tolist()) == [0, 1, 2]
    allowed = "directions along x, y and z, each once"
    cure = "resample the volume along the axes"
    require(is_along and is_each_once, name, f"directions {vectors.tolist()}", allowed, cure)
    if not spacing:
        lengths = norms
    return _Layout(axes, np.sign(along), lengths)


def _numbers(name: str, text: str) -> list[float]:
    """Return the numbers of a text, finite or NaN, between blanks or commas; none of an empty text.

    Args:
        name: Name of the head, for messages.
        text: The text.

    Raises:
        RefusedError: A word is no number, or is infinite.
    """
    try:
        numbers = [float(word) for word in re.split(r"[\s,]+", text.strip()) if word]
    except ValueError:
        raise RefusedError(name, repr(text[:40]), "numbers such as 1.25") from None
    require(not any(map(math.isinf, numbers)), name, text[:40], "finite numbers")
    return numbers
