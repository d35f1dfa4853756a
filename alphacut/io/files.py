"""Output: one JSON object on standard output, whole files, one rank that speaks."""

from __future__ import annotations

import atexit
import json
import math
import os
import shutil
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import Any, NoReturn, TextIO

import numpy as np

from alphacut.fuzzy.refused import FailedError
from alphacut.io.problem import printable

FULL = 1 << 20
"""Bytes that a disk has at least where it is not full."""
LONGEST = 1000
"""Characters of a line to people."""
RANKS = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_LOCALRANKID")
SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS")

Document = dict[str, Any]
"""A JSON document: numbers, texts, lists and documents by name; its reader knows their types."""


def rank() -> int:
    """This process's MPI rank as mpirun tells it, without starting MPI; 0 where there is none."""
    return next((int(os.environ[name]) for name in RANKS if name in os.environ), 0)


def ranks() -> int:
    """The number of MPI ranks as mpirun tells it; 1 where there is none."""
    return next((int(os.environ[name]) for name in SIZES if name in os.environ), 1)


def open_streams() -> None:
    """Give standard streams that are closed the null device, for other files would take them."""
    while (handle := os.open(os.devnull, os.O_RDWR)) < 3:
        os.set_inheritable(handle, True)
    os.close(handle)
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - to the end
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115


def leave(status: int) -> NoReturn:
    """End the program; its memory is not taken apart first, up to 0.2 s once PETSc is loaded."""
    mpi = sys.modules.get("mpi4py.MPI")
    if threading.active_count() > 1:  # waited for
        sys.exit(status)
    try:
        atexit._run_exitfuncs()  # as multiprocessing does
        sys.stdout.flush()
    except OSError as error:  # BrokenPipeError where its reader wanted no more
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        if not isinstance(error, BrokenPipeError):
            say(f"standard output cannot be written: {error.strerror}")
            status = status or 1
    if mpi and not mpi.Is_finalized() and any(name in os.environ for name in (*RANKS, *SIZES)):
        mpi.Finalize()  # for mpirun or its like
    os._exit(status)


def is_special(path: Path) -> bool:
    """True if this is a device, a pipe or a socket, that nothing may replace."""
    return path.exists() and not (path.is_file() or path.is_dir())


@contextmanager
def whole_file(path: Path | str) -> Iterator[Path]:
    """Temporary name beside `path`, renamed to it once the block is through.

    A link stays and its target is replaced; a device or a pipe is written to.
    """
    path = Path(path)
    if is_special(path):
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as folder:
            yield (partial := Path(folder) / path.name)
            path.write_bytes(partial.read_bytes())
        return
    path = Path(os.path.realpath(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield partial
        os.replace(partial, path)
    except (OSError, RuntimeError):
        if shutil.disk_usage(path.parent).free < FULL:
            raise FailedError(f"the disk of {path.parent} is full", "free some space") from None
        raise
    finally:
        partial.unlink(missing_ok=True)


def write_text(path: Path | str, text: str) -> None:
    """Write a text file, whole or not at all."""
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8")


def plain(value: object) -> object:
    """A value that JSON can hold; what is not finite becomes null."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | None) else str(value)


def as_json(document: Mapping[str, object], *, indent: int | None = None) -> str:
    """One JSON object, ending in a line feed; arrays of numbers stay on one line."""
    return json.dumps(plain(document), indent=indent, allow_nan=False, ensure_ascii=False) + "\n"


@contextmanager
def standard_output(json_to_stdout: bool) -> Iterator[TextIO]:
    """The stream that answers go to.

    With ``--json -`` everything that libraries print, C ones too, goes to standard error, so that
    the one JSON object stands alone; on every MPI rank but the first, nothing is printed at all.
    """
    closed = getattr(sys.stdout, "name", "") == os.devnull  # another file may stand in its place
    if rank() == 0 and (closed or not json_to_stdout):
        yield sys.stdout
        return
    sys.stdout.flush()
    kept = os.dup(1)
    target = os.open(os.devnull, os.O_WRONLY) if rank() else 2
    os.dup2(target, 1)
    stream = os.fdopen(
        kept if rank() == 0 else os.open(os.devnull, os.O_WRONLY), "w", encoding="utf-8"
    )
    try:
        with redirect_stdout(sys.stderr if rank() == 0 else stream):
            yield stream
    finally:
        stream.flush()
        sys.stdout.flush()
        os.dup2(kept, 1)
        if rank():
            os.close(kept)
            os.close(target)
        stream.close()


def say(message: str) -> None:
    """One line to people, on standard error; the first rank alone speaks."""
    if rank() == 0:
        with suppress(OSError):
            print(f"alphacut: {printable(message, LONGEST)}", file=sys.stderr, flush=True)
