"""The examination of boxes by compiled code, where there is a compiler, or by its NumPy twin."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from alphacut.frame.calculus.c_library import FUSED, c_library
from alphacut.frame.calculus.jet import Array
from alphacut.frame.certificate.numpy_kernel import examine
from alphacut.frame.certificate.piece import Piece, Problems

SOURCE = Path(__file__).with_name("kernel.c")
Examine = Callable[[Piece, Problems], tuple[Array, Array]]
"""Codes (0 closed, 1 + axis split, `FACES` and above confined) and side × output at the centres."""


@cache
def examination() -> tuple[str, Examine]:
    """The fastest kernel there is, and its name."""
    library = c_library(SOURCE.read_text(encoding="utf-8"), FUSED)
    if library is None:
        return "NumPy", examine
    return "C", lambda piece, problems: _compiled(library, piece, problems)


def _compiled(library: ctypes.CDLL, piece: Piece, problems: Problems) -> tuple[Array, Array]:
    over, forced, free = problems.remainder, piece.forced, piece.forced is None
    code, value = np.zeros(len(piece.column), np.int32), np.zeros(len(piece.column))
    (boxes, d), parts = piece.centre.shape, piece.started + (not free)
    sizes = (d, piece.modes, problems.third.shape[0], parts, piece.started)
    given = [
        *((x, np.int64) for x in (piece.row_start, piece.item_start, piece.node)),
        *((piece.column, np.int32), (piece.jets, complex), (problems.time, float)),
        *((forced, complex), (problems.third, float), (over.margin, float)),
        *((piece.centre, float), (piece.radius, float), (piece.edges, np.uint8)),
        *((x, float) for x in (problems.best, problems.point, problems.jets)),
        *((x if free else None, float) for x in (*over.rate[2:], *over.share)),
    ]
    arrays: list[Array | None] = [
        None if x is None else np.ascontiguousarray(x, kind) for x, kind in given
    ]
    library.examine(
        *(ctypes.c_long(boxes), ctypes.c_long(len(problems.time)), *map(ctypes.c_int, sizes)),
        *(None if x is None else ctypes.c_void_p(x.ctypes.data) for x in arrays),
        *(ctypes.c_double(problems.gap), *(ctypes.c_void_p(x.ctypes.data) for x in (code, value))),
    )
    return code, value
