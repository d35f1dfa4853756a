"""PETSc, started without the option files of the caller's home and folder, and its options.

PETSc reads ``~/.petscrc`` when it is first imported, DOLFINx imports it too: import this file
before either. Open MPI's transport for one-sided messages over fabrics, which nothing here sends,
takes a second to look for a fabric when MPI starts; it is left out unless the caller names
transports. UCX rewrites the process's functions of memory to watch them, which takes 0.05 s and
serves fabrics alone; it does not unless the caller asks for it. Options stand under the project's
prefix; what PETSc does not use is an error.
"""

from __future__ import annotations

import ctypes
import os
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.interruption import uninterrupted
from alphacut.rve.solver.options import PREFIX, OptionError

os.environ.setdefault("OMPI_MCA_btl", "^ofi")
os.environ.setdefault("UCX_MEM_EVENTS", "n")

with uninterrupted():
    import petsc4py

    petsc4py.init(["alphacut", "-skip_petscrc"])
    from petsc4py import PETSc as PETSc

if TYPE_CHECKING:
    from mpi4py import MPI

_LIBRARY = ctypes.CDLL(PETSc.__file__)  # petsc4py does not wrap PetscOptionsUsed
_INTEGER = ctypes.POINTER(ctypes.c_int)
_LIBRARY.PetscOptionsUsed.argtypes = [ctypes.c_void_p, ctypes.c_char_p, _INTEGER]


def clean(comm: MPI.Comm | None) -> None:
    """Free what ranks shared and nothing refers to any more; petsc4py keeps it until all ask."""
    if comm is not None:
        PETSc.garbage_cleanup(comm)


def block_values(matrix: PETSc.Mat) -> ctypes.c_void_p:
    """Where the blocks of a matrix on one rank begin: row by row, each column by column."""
    first = ctypes.c_void_p()
    _LIBRARY.MatSeqBAIJGetArray(ctypes.c_void_p(matrix.handle), ctypes.byref(first))
    return first


def ghosts(matrix: PETSc.Mat) -> NDArray[np.int32 | np.int64]:
    """Numbers of other ranks' blocks that a matrix on several ranks multiplies on this one."""
    count, first = np.zeros(1, PETSc.IntType), ctypes.c_void_p()
    _LIBRARY.MatGetGhosts(ctypes.c_void_p(matrix.handle), count.ctypes, ctypes.byref(first))
    data = ctypes.string_at(first, int(count[0]) * count.itemsize) if count[0] else b""
    return np.frombuffer(data, PETSc.IntType)


@contextmanager
def in_database(options: Mapping[str, str], *, wanted: Collection[str]) -> Iterator[None]:
    """Keep `options` in PETSc's database while the block configures a solver.

    Args:
        options: Names without prefix to values.
        wanted: Those that somebody asked for, and that must not go unused.

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
            f"PETSc refuses the options {asked}: {str(failure).splitlines()[-1].strip()}"
        ) from failure
    finally:
        for name in options:
            database.delValue(name)
    if unused:
        raise OptionError(
            f"PETSc has no use for -{PREFIX}{unused[0]} {options[unused[0]]}".rstrip()
            + ": check its spelling"
        )


def _used(name: str) -> bool:
    flag = ctypes.c_int(0)
    _LIBRARY.PetscOptionsUsed(None, f"{PREFIX}{name}".encode(), ctypes.byref(flag))
    return bool(flag.value)
