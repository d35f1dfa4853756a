"""Arrays in files of NumPy (.npy, .npz), as NumPy reads them; pickled objects are never loaded."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from alphacut.base.errors import RefusedError, require
from alphacut.base.memory import require_free_memory

Numbers = NDArray[np.generic]
DEFLATE_RATIO = 1032
"""Largest number of bytes for which one byte of deflated data can stand (RFC 1951)."""


def read_npy(path: Path, *, kinds: str = "buif") -> Numbers:
    """Return the array in a .npy file as a memory map, whose numbers are read when they are used.

    Args:
        path: The file.
        kinds: Allowed letters of `numpy.dtype.kind`: b for truth values, u and i for integers, f
            for floats, c for complex numbers, S and U for texts.

    Returns:
        An array that cannot be written to. It reads the file as long as it exists, so the file must
        not change meanwhile.

    Raises:
        RefusedError: The file is cut off, damaged, or holds numbers of other kinds or other things.
        OSError: The file cannot be opened.
    """

    def load() -> Numbers:
        array: Numbers = np.load(path, mmap_mode="r", allow_pickle=False)
        size = path.stat().st_size
        fits = isinstance(array, np.memmap) and array.offset + array.nbytes == size
        value = f"of {size} bytes, where its head states shape {array.shape} of {array.dtype}"
        require(fits, path.name, value, "as many bytes", "copy or save the file anew")
        return array

    return _checked(path.name, load, kinds=kinds)


def names_in_npz(path: Path) -> list[str]:
    """Return the names of the arrays in a .npz file.

    Raises:
        RefusedError: It is not an archive as `numpy.savez` writes it.
        OSError: The file cannot be opened.
    """
    try:
        with np.load(path, allow_pickle=False) as archive:
            return list(archive.files)
    except OSError:
        raise
    except Exception as error:  # of a damaged archive, errors of many types
        raise RefusedError(path.name, f"unreadable ({error})", "an archive .npz") from None


def read_npz(path: Path, name: str, *, kinds: str = "buif") -> Numbers:
    """Return one of the arrays in a .npz file, by its name.

    Args:
        path: The file.
        name: One of `names_in_npz`.
        kinds: As of `read_npy`.

    Raises:
        RefusedError: The array is damaged, of other kinds, or too large for half of the free
            memory, or its archive states more than its bytes can stand for.
        OSError: The file cannot be opened.
    """
    place = f"{path.name}:{name}"

    def load() -> Numbers:
        with np.load(path, allow_pickle=False) as archive:
            members = {x.filename.removesuffix(".npy"): x for x in archive.zip.infolist()}
            size = members[name].file_size
            # The caller mostly makes a copy, such as a conversion to floats.
            require_free_memory(place, 2.0 * size, f"{size} bytes")
            most = DEFLATE_RATIO * path.stat().st_size
            require(size <= most, place, f"of {size} bytes", f"up to {most}")
            array: Numbers = archive[name]
        # NumPy pads the head to a multiple of 64 bytes, older ones of 16.
        is_whole = (size - array.nbytes) % 16 == 0
        require(is_whole, place, f"of {size} bytes for shape {array.shape}", "as many bytes")
        return array

    return _checked(place, load, kinds=kinds)


def _checked(place: str, load: Callable[[], object], *, kinds: str) -> Numbers:
    """Return what a function loads, if it is an array of some kinds.

    Raises:
        RefusedError: It is not, or NumPy raises an error.
        OSError: The file cannot be opened.
    """
    allowed = "an array of real numbers as numpy.save writes it"
    cure = "save numbers, as array.astype(float), a sparse matrix by scipy.sparse.save_npz"
    try:
        array = load()
    except (RefusedError, OSError):
        raise
    except Exception as error:  # of a damaged file, errors of many types
        reason = str(error).partition("\n")[0] or type(error).__name__
        raise RefusedError(place, f"unreadable ({reason})", allowed, cure) from None
    is_array = isinstance(array, np.ndarray) and array.dtype.kind in kinds
    require(is_array, place, f"{getattr(array, 'dtype', 'no array')}", allowed, cure)
    assert isinstance(array, np.ndarray)
    return array
