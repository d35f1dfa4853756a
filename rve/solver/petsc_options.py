"""PETSc options under the project's prefix; what PETSc does not use is an error."""

from __future__ import annotations

import ctypes
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager

from alphacut.rve.petsc import PETSc
from alphacut.rve.solver.options import PREFIX, OptionError

_LIBRARY = ctypes.CDLL(PETSc.__file__)  # petsc4py does not wrap PetscOptionsUsed
_LIBRARY.PetscOptionsUsed.argtypes = [
    ctypes.c_void_p,
    ctypes.c_char_p,
    ctypes.POINTER(ctypes.c_int),
]


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
