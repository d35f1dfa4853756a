"""Arrays in files of NumPy (.npy, .npz), whose heads are checked before memory is allocated.

`numpy.load` allocates memory for the shape that a head states before it looks for the data. Here
the shape must agree with the number of bytes that follow, and the uncompressed size of a member of
a .npz file with the free memory. Pickled objects are never loaded.
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
formats: Any = np.lib.format  # whose functions have no types
DEFLATE_RATIO = 1032
"""Largest number of bytes for which one byte of deflated data can stand (RFC 1951)."""


class ArrayHead:
    """The head of an array in the format .npy.

    Args:
        name: Name of the file, for messages.
        start: The first bytes of the file, with at least its whole head.
        size: Number of bytes of the file.
        kinds: Letters of the kinds of NumPy's types that are allowed, among b, u, i, f, S, U, c.

    Attributes:
        shape: Shape of the array.
        dtype: Type of its numbers.
        order: "C" or "F", as in `numpy.reshape`.
        offset: Number of bytes before the first number.

    Raises:
        RefusedError: The head is damaged, the array holds other things than numbers, or the file
            has another size than the head states.
    """

    max_bytes = 1 << 16
    """Largest number of bytes of a head; heads of arrays of numbers have 128 or 192."""

    def __init__(self, name: str, start: bytes, *, size: int, kinds: str) -> None:
        allowed = "an array of real numbers as numpy.save writes it"
        stream = BytesIO(start[: self.max_bytes])
        try:
            version = formats.read_magic(stream)
            read = {(1, 0): formats.read_array_header_1_0, (2, 0): formats.read_array_header_2_0}
            shape, is_fortran, dtype = read[version](stream)
        except Exception as error:  # of a damaged head, errors of many types
            reason = str(error).partition("\n")[0] or type(error).__name__
            raise RefusedError(name, f"unreadable ({reason})", allowed) from None
        self.shape: tuple[int, ...] = shape
        self.dtype: np.dtype[Any] = dtype
        self.order: Literal["C", "F"] = "C"
        if is_fortran:
            self.order = "F"
        self.offset = stream.tell()
        # A damaged head may state entries of any length, such as texts of a thousand million
        # characters. No number has more than 32 bytes.
        is_known = self.dtype.kind in kinds and self.dtype.itemsize <= self.max_bytes
        cure = "save numbers, as array.astype(float)"
        if self.dtype.kind == "c":
            cure = "save its real part, array.real"
        elif self.dtype.kind == "O":
            cure = "save numbers, as array.astype(float), a sparse matrix by scipy.sparse.save_npz"
        require(is_known, name, f"{self.dtype} of shape {self.shape}", allowed, cure)
        is_shape = len(self.shape) <= 8 and all(n >= 0 for n in self.shape)
        require(is_shape, name, f"of shape {self.shape}", allowed)
        expected = self.offset + math.prod(self.shape) * self.dtype.itemsize
        value = f"of {size} bytes, where its head states shape {self.shape} of {self.dtype}"
        require(size == expected, name, value, f"{expected} bytes", "copy or save the file anew")


def read_npy(path: Path, *, kinds: str = "buif") -> Numbers:
    """Return the array in a .npy file as a memory map, whose numbers are read when they are used.

    Args:
        path: The file.
        kinds: Allowed letters of `numpy.dtype.kind`: b for truth values, u and i for integers, f
            for floats, c for complex numbers, S and U for texts.

    Returns:
        An array that cannot be written to, of the shape and type in the head of the file. It reads
        the file as long as it exists, so the file must not change meanwhile. An array without
        entries is no map.

    Raises:
        RefusedError: The file is cut off, damaged, or holds numbers of other kinds or other things.
        OSError: The file cannot be opened.
    """
    with path.open("rb") as file:
        start = file.read(ArrayHead.max_bytes)
    head = ArrayHead(path.name, start, size=path.stat().st_size, kinds=kinds)
    if math.prod(head.shape) == 0:  # the system maps no empty file
        return np.empty(head.shape, head.dtype)
    return np.memmap(path, head.dtype, "r", head.offset, head.shape, head.order)


class ArrayArchive:
    """The arrays in a .npz file, each of which is read when it is asked for.

    Args:
        path: The file.

    Raises:
        RefusedError: It is not an archive as `numpy.savez` writes it, or has over 1000 members.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            with ZipFile(path) as archive:
                members = archive.infolist()
        except Exception as error:  # of a damaged archive, errors of many types
            raise RefusedError(path.name, f"unreadable ({error})", "an archive .npz") from None
        require(len(members) <= 1000, path.name, f"{len(members)} arrays", "up to 1000")
        self.members = {member.filename.removesuffix(".npy"): member for member in members}

    @property
    def names(self) -> list[str]:
        """Names of the arrays."""
        return list(self.members)

    def read(self, name: str, *, kinds: str = "buif") -> Numbers:
        """Return one of the arrays, which cannot be written to.

        Args:
            name: Its name, one of `names`.
            kinds: Allowed letters of `numpy.dtype.kind`: b for truth values, u and i for integers,
                f for floats, c for complex numbers, S and U for texts.

        Raises:
            KeyError: There is no such name.
            RefusedError: The member is damaged, of other kinds, too large for half of the free
                memory, larger than its compressed bytes can stand for, or compressed by another
                method than deflate.
            OSError: The file does not exist any more.
        """
        # The archive states the sizes, and may lie. What cannot be true is refused before memory is
        # allocated, and the head of the array is compared with the bytes that were read.
        member = self.members[name]
        place = f"{self.path.name}:{name}"
        is_known = member.compress_type in (ZIP_STORED, ZIP_DEFLATED)
        require(is_known, place, f"compressed by method {member.compress_type}", "deflate or none")
        max_bytes = DEFLATE_RATIO * member.compress_size  # 1032 bytes for one, by the format
        if member.compress_type == ZIP_STORED:
            max_bytes = member.compress_size
        value = f"of {member.file_size} bytes out of {member.compress_size}"
        require(member.file_size <= max_bytes, place, value, f"up to {max_bytes}")
        is_inside = member.compress_size <= self.path.stat().st_size
        require(is_inside, place, value, "what lies in the file")
        # The caller mostly makes a copy, such as a conversion to floats.
        require_free_memory(place, 2.0 * member.file_size, f"{member.file_size} bytes")
        try:
            with ZipFile(self.path) as archive, archive.open(member) as file:
                content = file.read(member.file_size)
        except Exception as error:  # of a damaged archive, errors of many types
            raise RefusedError(place, f"unreadable ({error})", "an undamaged archive") from None
        head = ArrayHead(place, content, size=len(content), kinds=kinds)
        return np.ndarray(head.shape, head.dtype, content, head.offset, order=head.order)
