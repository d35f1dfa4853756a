"""Output: places that are checked, one JSON object on standard output; messages."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TextIO

import numpy as np
from pydantic_core import to_json

from alphacut.base.errors import RefusedError, printable, require
from alphacut.base.kept_files import is_special

OPTIONS_OF_OUTPUT = ("out", "json", "export", "csv", "tables")
"""Options of commands that name what is written."""
INSIDE = "ALPHACUT_INSIDE"
"""Variable that ./enter sets."""
Document = dict[str, Any]
"""A JSON document: numbers, texts, lists and documents by name; its reader knows their types."""


def rank() -> int:
    """Return this process's MPI rank as mpirun tells it, without starting MPI; else 0."""
    names = "OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_LOCALRANKID"
    return _first_variable(names, default=0)


def ranks() -> int:
    """Return the number of MPI ranks as mpirun tells it; 1 where there is none."""
    names = "OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"
    return _first_variable(names, default=1)


def _first_variable(names: Iterable[str], *, default: int) -> int:
    """Return the whole number in the first environment variable that is set."""
    for name in names:
        if name in os.environ:
            return int(os.environ[name])
    return default


def as_json(document: Mapping[str, object], *, indent: int | None = None) -> str:
    """Return a document as JSON, ending in a line feed; numbers that are not finite become null."""
    content = to_json(document, indent=indent, inf_nan_mode="null", fallback=_plain)
    return content.decode() + "\n"


def _plain(value: object) -> object:
    """Return what stands in JSON for a value that `to_json` does not know."""
    if isinstance(value, Mapping):
        return dict(value)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


@contextmanager
def standard_output(*, alone: bool) -> Iterator[TextIO]:
    """Yield the stream for answers: standard output of the first MPI rank, nothing of others.

    Args:
        alone: Whether all else that is printed, by C libraries too, goes to standard error.
    """
    if not alone and rank() == 0:
        yield sys.stdout
        sys.stdout.flush()
        return
    sys.stdout.flush()
    original = os.dup(1)
    os.dup2(2, 1)  # what C libraries print goes to standard error
    try:
        target = os.dup(original) if rank() == 0 else os.open(os.devnull, os.O_WRONLY)
        with redirect_stdout(sys.stderr), os.fdopen(target, "w", encoding="utf-8") as stream:
            yield stream
    finally:
        os.dup2(original, 1)
        os.close(original)


def say(message: str) -> None:
    """Print one line for people on standard error; only the first MPI rank does."""
    if rank() == 0:
        bar_end = "\r\x1b[K" if sys.stderr.isatty() else ""  # over a progress bar
        with suppress(OSError):
            print(f"{bar_end}alphacut: {printable(message)}", file=sys.stderr, flush=True)


def check_destinations(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse options of a command that name files or folders where nothing can be written."""
    for action in parser._actions:
        value = getattr(options, action.dest, None)
        if action.dest in OPTIONS_OF_OUTPUT and isinstance(value, str) and value != "-":
            folder = action.metavar == "FOLDER"
            require_writable(action.option_strings[-1], value, folder=folder)


def require_writable(option: str, value: str, *, folder: bool) -> None:
    """Refuse the path of a file or folder where nothing can be written.

    Args:
        option: Option that gives the path, for the message.
        value: The path.
        folder: Whether it is of a folder, which need not be there.

    Raises:
        RefusedError: The path is empty, something of the other kind is there, or the nearest folder
            that exists takes no files.
    """
    path = Path(value)
    is_free = bool(value.strip()) and (not path.exists() or path.is_dir() == folder)
    existing = path if folder else path.parent
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    reason = ""
    try:
        tempfile.TemporaryFile(dir=existing).close()
    except OSError as error:
        is_free = False
        reason = f"nothing can be written in {existing}: {error.strerror or error}".lower()
    allowed = f"the name of {'a folder' if folder else 'a file'} where you may write"
    require(is_free or is_special(path), option, value or "empty", allowed, cure=reason)


class BadInput(Exception):  # noqa: N818 - it names the input, not the program, as the culprit
    """An input that cannot be used; `problems` are all that is wrong with it."""

    def __init__(self, problems: Iterable[RefusedError]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the known name that is most like `name`, whatever its capitals; empty if none is."""
    by_small_letters = {option.lower(): option for option in names}
    small = name.lower().replace("-", "_")
    close = get_close_matches(small, by_small_letters, n=1, cutoff=0.6)
    return by_small_letters[close[0]] if close else ""


def suggestion(name: str, names: Iterable[str]) -> str:
    """Return a question after the known name that was probably meant; empty if there is none."""
    close = nearest(name, names)
    return f"did you mean {close}?" if close else ""


def missing(error: ImportError) -> str:
    """Return the message about an import that failed, with the extra that brings the library."""
    of_cell = "dolfinx", "petsc4py", "mpi4py", "basix", "ufl", "cffi", "gmsh", "meshio", "h5py"
    extras = {"skimage": "particles", **dict.fromkeys(of_cell, "cell")}
    library = (error.name or "").partition(".")[0]
    cure = f"install {library}"
    if library in extras:
        cure = f"pip install '.[{extras[library]}]'"
    if not os.environ.get(INSIDE):
        cure += ", or run inside ./enter"
    return f"{error}; {cure}"
