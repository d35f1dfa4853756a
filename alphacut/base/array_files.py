"""Arrays in files of NumPy (.npy, .npz), whose heads are checked before anything is allocated.

`numpy.load` takes memory for the shape that a head states before it looks for the data. Here a
shape must agree with the bytes that follow it, and the uncompressed size of a member of a .npz file
with the memory that is free. Pickled objects are never read.
"""

from __future__ import annotations

import math
from io import BytesIO
from pathlib import Path
from typing import Any, Literal
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np
from numpy.typing import NDArray

from alphacut.base.errors import RefusedError, require
from alphacut.base.memory import require_free_memory

Numbers = NDArray[np.generic]
ALLOWED = "an array of real numbers as numpy.save writes it"
formats: Any = np.lib.format  # NumPy does not say the types of its functions
LONGEST_HEAD = 1 << 16
"""Bytes; heads of arrays of numbers have 128 or 192."""
MAX_MEMBERS = 1000
"""Arrays of a .npz file."""
MAX_DIMENSIONS = 8
DEFLATE_RATIO = 1032
"""Bytes that a byte of deflated data can stand for: 258 bytes take two bits (RFC 1951)."""


class ArrayHead:
    """Shape, type and order of an array in the format .npy, and where its numbers begin.

    Args:
        name: Name of the file, for messages.
        start: The first bytes of the file, at least its whole head.
        size: Bytes of the file.
        kinds: Letters of the kinds of NumPy that are allowed: b, u, i, f, S, U, c.

    Raises:
        RefusedError: It is no such head, holds other objects than numbers, or the file has another
            size than the head states.
    """

    def __init__(self, name: str, start: bytes, *, size: int, kinds: str) -> None:
        stream = BytesIO(start[:LONGEST_HEAD])
        try:
            version = formats.read_magic(stream)
            read = {(1, 0): formats.read_array_header_1_0, (2, 0): formats.read_array_header_2_0}
            shape, is_fortran, dtype = read[version](stream)
        except Exception as error:  # readers of damaged heads raise errors of many kinds
            reason = str(error).partition("\n")[0] or type(error).__name__
            raise RefusedError(name, f"unreadable ({reason})", ALLOWED) from None
        self.shape: tuple[int, ...] = shape
        self.dtype: np.dtype[Any] = dtype
        self.order: Literal["C", "F"] = "F" if is_fortran else "C"
        self.offset = stream.tell()
        is_known = self.dtype.kind in kinds and self.dtype.itemsize <= LONGEST_HEAD
        cure = "save numbers, as array.astype(float)"
        if self.dtype.kind == "c":
            cure = "save its real part, array.real"
        require(is_known, name, f"{self.dtype} of shape {self.shape}", ALLOWED, cure)
        is_shape = len(self.shape) <= MAX_DIMENSIONS and all(n >= 0 for n in self.shape)
        require(is_shape, name, f"of shape {self.shape}", ALLOWED)
        expected = self.offset + math.prod(self.shape) * self.dtype.itemsize
        value = f"of {size} bytes, where its head states shape {self.shape} of {self.dtype}"
        require(size == expected, name, value, f"{expected} bytes", "copy or save the file anew")


def read_npy(path: Path, *, kinds: str = "buif") -> Numbers:
    """Return the array in a .npy file, mapped: its numbers are read when they are used.

    `kinds` are letters of the kinds of NumPy that are allowed. Files cut off or with pickled
    objects raise RefusedError; those that cannot be opened, OSError.
    """
    with path.open("rb") as file:
        start = file.read(LONGEST_HEAD)
    head = ArrayHead(path.name, start, size=path.stat().st_size, kinds=kinds)
    if math.prod(head.shape) == 0:
        return np.empty(head.shape, head.dtype)
    return np.memmap(path, head.dtype, "r", head.offset, head.shape, head.order)


class ArrayArchive:
    """The arrays in a .npz file by name, each read when it is asked for.

    Args:
        path: The file.

    Raises:
        RefusedError: It is no archive that `numpy.savez` writes.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with ZipFile(path) as archive:
                members = archive.infolist()
        except Exception as error:  # readers of damaged archives raise errors of many kinds
            raise RefusedError(path.name, f"unreadable ({error})", "an archive .npz") from None
        require(len(members) <= MAX_MEMBERS, path.name, f"{len(members)} arrays", f"{MAX_MEMBERS}")
        self.members = {member.filename.removesuffix(".npy"): member for member in members}

    @property
    def names(self) -> list[str]:
        """Names of the arrays."""
        return [*self.members]

    def read(self, name: str, *, kinds: str = "buif") -> Numbers:
        """Return an array; refuse one that is damaged, too large for memory or of other kinds."""
        member = self.members[name]
        place = f"{self.path.name}:{name}"
        is_known = member.compress_type in (ZIP_STORED, ZIP_DEFLATED)
        require(is_known, place, f"compressed by method {member.compress_type}", "deflate or none")
        most = DEFLATE_RATIO * member.compress_size
        if member.compress_type == ZIP_STORED:
            most = member.compress_size
        value = f"of {member.file_size} bytes out of {member.compress_size}"
        require(member.file_size <= most, place, value, f"up to {most}")
        is_inside = member.compress_size <= self.path.stat().st_size
        require(is_inside, place, value, "what lies in the file")
        require_free_memory(place, 2.0 * member.file_size, f"{member.file_size} bytes")
        try:
            with ZipFile(self.path) as archive, archive.open(member) as file:
                content = file.read(member.file_size)
        except Exception as error:  # as above
            raise RefusedError(place, f"unreadable ({error})", "an undamaged archive") from None
        head = ArrayHead(place, content, size=len(content), kinds=kinds)
        return np.ndarray(head.shape, head.dtype, content, head.offset, order=head.order)
