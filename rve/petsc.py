"""PETSc, started without the option files of the caller's home and folder, and its options.

PETSc reads ``~/.petscrc`` when it is first imported, DOLFINx imports it too: import this file
before either. Open MPI's transports for one-sided messages over fabrics, which nothing here sends,
take up to a second to look for a fabric when MPI starts; they are left out unless the caller names
transports. UCX rewrites the process's functions of memory to watch them, which takes 0.05 s and
serves fabrics alone; it does not unless the caller asks for it. Signals stay the program's. Options
stand under the project's prefix; what PETSc does not use is an error.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.interruption import uninterrupted
from alphacut.rve.ranks import Ranks
from alphacut.rve.solver.options import PREFIX, OptionError

os.environ.setdefault("OMPI_MCA_btl", "^ofi,uct")
os.environ.setdefault("UCX_MEM_EVENTS", "n")

with uninterrupted():
    import petsc4py

    petsc4py.init(["alphacut", "-skip_petscrc", "-no_signal_handler"])
    from petsc4py import PETSc as PETSc

if TYPE_CHECKING:
    from mpi4py import MPI

_LIBRARY = ctypes.CDLL(PETSc.__file__)  # petsc4py does not wrap PetscOptionsUsed
_INTEGER = ctypes.POINTER(ctypes.c_int)
_LIBRARY.PetscOptionsUsed.argtypes = [ctypes.c_void_p, ctypes.c_char_p, _INTEGER]


def clean(comm: MPI.Intracomm | None) -> None:
    """Free what ranks shared and nothing refers to any more; petsc4py keeps it until all ask."""
    if comm is not None:
        PETSc.garbage_cleanup(comm)


def give_back() -> None:
    """Give the system the memory that is free, which MPI has told the C library to keep."""
    getattr(ctypes.CDLL(None), "malloc_trim", bool)(0)  # glibc has it


def zero_matrix(
    starts: Sequence[NDArray[np.int32]],
    columns: Sequence[NDArray[np.int32]],
    size: int,
    block: int,
    ranks: Ranks,
) -> PETSc.Mat:
    """Square matrix of zeros in blocks; each rank gives the pattern of its own, consecutive rows.

    Rows begin at `starts` in the rising `columns`: of those that this rank owns, counted from its
    first, and of others; `size` counts all ranks' rows, not in blocks.
    """
    found, counts = PETSc.Mat().create(ranks.comm), [np.diff(own) for own in starts]
    found.setSizes([(block * len(counts[0]), size)] * 2, block)
    found.setType("baij")
    shares = [count.astype(PETSc.IntType) for count in counts]
    found.setPreallocationNNZ(shares if ranks.size > 1 else shares[0])
    parts = [(found.getDiagonalBlock().handle, columns[0][: starts[0][-1]])]
    if ranks.size > 1:
        parts.append((_beside_diagonal(found)[0].value or 0, columns[1][: starts[1][-1]]))
    for part, numbers in parts:
        given = numbers.astype(PETSc.IntType, copy=False).ctypes
        _LIBRARY.MatSeqBAIJSetColumnIndices(ctypes.c_void_p(part), given)
    found.assemble()
    return found


def block_values(matrix: PETSc.Mat) -> tuple[ctypes.c_void_p, ctypes.c_void_p]:
    """Where the blocks of this rank's rows begin: row by row, each column by column.

    First those whose columns it owns too, then the others.
    """
    own, other = ctypes.c_void_p(matrix.getDiagonalBlock().handle), ctypes.c_void_p()
    if matrix.comm.size > 1:
        other = _beside_diagonal(matrix)[0]
    return _first_block(own), _first_block(other) if other else other


def _first_block(part: ctypes.c_void_p) -> ctypes.c_void_p:
    first = ctypes.c_void_p()
    _LIBRARY.MatSeqBAIJGetArray(part, ctypes.byref(first))
    return first


def _beside_diagonal(matrix: PETSc.Mat) -> tuple[ctypes.c_void_p, ctypes.c_void_p]:
    """PETSc's part of a matrix whose columns other ranks own, and where their numbers begin."""
    part, numbers = ctypes.c_void_p(), ctypes.c_void_p()
    _LIBRARY.MatMPIBAIJGetSeqBAIJ(
        ctypes.c_void_p(matrix.handle), None, ctypes.byref(part), ctypes.byref(numbers)
    )
    return part, numbers


class BesideDiagonal(NamedTuple):
    """What this rank's rows of a matrix in blocks multiply of other ranks.

    Args:
        rows: Numbers of the rows of blocks that have some, n.
        starts: Where the blocks of each begin, shape (n + 1,).
        columns: Which of `others` each block stands for.
        blocks: The first number of the first block; they run column by column, and are PETSc's own.
        others: Numbers of the other ranks' blocks that the rows need.
    """

    rows: NDArray[np.int32]
    starts: NDArray[np.int32]
    columns: NDArray[np.int32]
    blocks: ctypes.c_void_p
    others: NDArray[np.int32 | np.int64]


def beside_diagonal(matrix: PETSc.Mat) -> BesideDiagonal:
    """What this rank's rows of a matrix in blocks multiply of other ranks; the matrix must live."""
    part, numbers = _beside_diagonal(matrix)
    rows, done = np.zeros(1, PETSc.IntType), ctypes.c_int()
    starts, columns = ctypes.c_void_p(), ctypes.c_void_p()
    found = rows.ctypes, ctypes.byref(starts), ctypes.byref(columns), ctypes.byref(done)
    _LIBRARY.MatGetRowIJ(part, 0, 0, 1, *found)
    pointers = _numbers(starts, int(rows[0]) + 1, PETSc.IntType)
    place = _numbers(columns, int(pointers[-1]), PETSc.IntType)
    some = np.flatnonzero(np.diff(pointers))
    small = [one.astype(np.int32) for one in (some, np.append(pointers[some], pointers[-1]), place)]
    others = _numbers(numbers, int(place.max(initial=-1)) + 1, PETSc.IntType)
    return BesideDiagonal(small[0], small[1], small[2], _first_block(part), others.copy())


def _numbers(first: ctypes.c_void_p, count: int, kind: type) -> Any:
    """So many numbers of PETSc's from there on; they are PETSc's own."""
    if not count:
        return np.empty(0, kind)
    held = (ctypes.c_char * (int(count) * np.dtype(kind).itemsize)).from_address(first.value or 0)
    return np.frombuffer(memoryview(held), kind)


@contextmanager
def in_database(options: Mapping[str, str], *, wanted: Collection[str]) -> Iterator[None]:
    """Keep `options`, names without prefix to values, in PETSc's database during the block.

    Somebody asked for those `wanted`, which must not go unused.

    Raises:
        OptionError: PETSc refuses an option, or has not asked for a wanted one by the end of the
            block.
    """
    database = PETSc.Options(PREFIX)
    for name, value in options.items():
        database[name] = value
    try:
        yield
        unused = [name for name in wanted if not _used(name)]
    except PETSc.Error as failure:
        asked = " ".join(f"-{PREFIX}{name} {options[name]}".rstrip() for name in wanted or options)
        raise OptionError(
            "PETSc options", asked, str(failure).splitlines()[-1].strip()
        ) from failure
    finally:
        for name in options:
            database.delValue(name)
    if unused:
        raise OptionError(f"-{PREFIX}{unused[0]}", options[unused[0]], "what PETSc uses")


def _used(name: str) -> bool:
    flag = ctypes.c_int(0)
    _LIBRARY.PetscOptionsUsed(None, f"{PREFIX}{name}".encode(), ctypes.byref(flag))
    return bool(flag.value)
