"""The examination of boxes by compiled code, where there is a compiler, or by its NumPy twin."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from alphacut.frame.calculus.c_library import c_library
from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.numpy_kernel import examine
from alphacut.frame.certificate.piece import Piece, Problems

SOURCE = Path(__file__).with_name("kernel.c")
FLAGS = ("-O3", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC")
Examine = Callable[[Piece, Problems], tuple[Array, Array]]
"""Codes (0 closed, 1 + axis split, `FACES` and above confined) and side × output at the centres."""


@cache
def examination() -> tuple[str, Examine]:
    """The fastest kernel there is, and its name."""
    library = c_library(SOURCE.read_text(encoding="utf-8"), FLAGS)
    if library is None:
        return "NumPy", examine
    return "C", lambda piece, problems: _compiled(library, piece, problems)


def _compiled(library: ctypes.CDLL, piece: Piece, problems: Problems) -> tuple[Array, Array]:
    size, boxes, parts, n, m = piece.share.shape
    d, terms = piece.centre.shape[1], 6 * parts * n
    table = np.empty((boxes, m, terms, size))
    code, value = np.zeros(len(piece.column), np.int32), np.zeros(len(piece.column))
    counts = [ctypes.c_long(boxes), *map(ctypes.c_int, (d, n, m, parts, size))]
    library.compose(*counts, *_pointers((piece.rate, complex), (piece.share, complex)), _at(table))
    given = _pointers(
        (piece.row_start, np.int64),
        (piece.item_start, np.int64),
        (piece.node, np.int64),
        (piece.column, np.int32),
        (table, float),
        (piece.waves, complex),
        (problems.third, float),
        (problems.margin, float),
        (piece.centre, float),
        (piece.radius, float),
        (piece.edges, np.uint8),
        (problems.best, float),
        (problems.point, float),
        (problems.jets, float),
    )
    counts = [ctypes.c_long(boxes), *map(ctypes.c_int, (d, m, terms, size))]
    library.examine(*counts, *given, ctypes.c_double(problems.gap), _at(code), _at(value))
    return code, value


class _Kept(ctypes.c_void_p):
    """Address of an array that lives as long as this."""

    array: Array


def _at(array: Array) -> ctypes.c_void_p:
    pointer = _Kept(array.ctypes.data)
    pointer.array = array
    return pointer


def _pointers(*given: tuple[Array, type]) -> list[ctypes.c_void_p]:
    """Addresses of arrays of these kinds, copied where they are not contiguous."""
    return [_at(np.ascontiguousarray(array, kind)) for array, kind in given]
