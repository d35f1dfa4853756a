"""Output: places that are checked, one JSON object on standard output; messages."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from alphacut.base.errors import RefusedError, printable, require
from alphacut.base.extras import MissingLibraryError, install_command
from alphacut.base.kept_files import is_special
from alphacut.base.seen_folders import INSIDE

Document = dict[str, Any]
"""A JSON document: numbers, texts, lists and documents by name; its reader knows their types."""


def rank() -> int:
    """Return this process's MPI rank as mpirun tells it, without starting MPI; else 0."""
    # Open MPI, PMIx, MPICH and Intel MPI each set a variable of their own. To ask MPI itself would
    # start it, which takes time and fails on some machines without a network.
    names = "OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_LOCALRANKID"
    return int([*filter(None, map(os.environ.get, names)), "0"][0])


def ranks() -> int:
    """Return the number of MPI ranks as mpirun tells it; 1 where there is none."""
    names = "OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS"
    return int([*filter(None, map(os.environ.get, names)), "1"][0])


def as_json(document: Mapping[str, object], *, indent: int | None = None) -> str:
    """Return a document as JSON, ending in a line feed; numbers that are not finite become null."""
    # Python's own `json` writes NaN, which no other program reads. Imported here so that `missing`
    # can be called where Pydantic is not installed.
    from pydantic_core import to_json

    content = to_json(document, indent=indent, inf_nan_mode="null", fallback=_plain)
    return content.decode() + "\n"


def _plain(value: object) -> object:
    """Return what stands in JSON for a value that `to_json` does not know, such as an array."""
    if isinstance(value, Mapping):
        return dict(value)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


@contextmanager
def standard_output(*, alone: bool) -> Iterator[TextIO]:
    """Yield the stream for answers: standard output of the first MPI rank, else the null device.

    Args:
        alone: Whether the answer stands alone on standard output, such as a JSON document for
            another program: then all else that is printed during the block, by C libraries too,
            goes to standard error. On other ranks this holds in any case.
    """
    # Python has no streams for descriptors that were closed before it began, as by "alphacut >&-".
    if sys.stdout is None:
        raise OSError("standard output is closed")
    if not alone and rank() == 0:
        yield sys.stdout
        sys.stdout.flush()
        return
    # C libraries write to the file descriptor 1 without asking Python. It is led to standard error,
    # 2, and the answer goes to a copy of what it was before.
    sys.stdout.flush()
    original = os.dup(1)
    os.dup2(2, 1)
    try:
        target = os.dup(original) if rank() == 0 else os.open(os.devnull, os.O_WRONLY)
        with redirect_stdout(sys.stderr), os.fdopen(target, "w", encoding="utf-8") as stream:
            yield stream
    finally:
        os.dup2(original, 1)
        os.close(original)


def say(message: str) -> None:
    """Print one line for people on standard error; only the first MPI rank does."""
    if rank() == 0 and sys.stderr is not None:
        bar_end = "\r\x1b[K" if sys.stderr.isatty() else ""  # over a progress bar
        with suppress(OSError):  # standard error may be a closed pipe; the computation goes on
            print(f"{bar_end}alphacut: {printable(message)}", file=sys.stderr, flush=True)


def check_destinations(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Raise RefusedError for an option that names a file or folder where nothing can be written.

    Options of output are --out, --json, --export, --csv and --tables. They name a folder if their
    metavar is FOLDER, else a file; "-" is standard output. Options that are not given pass.

    Args:
        parser: Parser of the command.
        options: What it has read from the command line.
    """
    options_of_output = ("out", "json", "export", "csv", "tables")
    # It is found here before a computation of hours, whose result could not be written.
    for action in parser._actions:
        value = getattr(options, action.dest, None)
        if action.dest in options_of_output and isinstance(value, str) and value != "-":
            folder = action.metavar == "FOLDER"
            require_writable(action.option_strings[-1], value, folder=folder)


def require_writable(option: str, value: str, *, folder: bool) -> None:
    """Raise RefusedError for the path of a file or folder where nothing can be written.

    A device or a pipe is allowed in place of a file. Nothing remains written.

    Args:
        option: Option that gives the path, for the message.
        value: The path. Neither it nor the folders that lead to it need exist.
        folder: Whether it is the path of a folder, else of a file.

    Raises:
        RefusedError: The path is empty, a folder stands where a file is meant or the reverse, or
            the nearest folder that exists takes no files.
    """
    path = Path(value)
    is_free = bool(value.strip()) and (not path.exists() or path.is_dir() == folder)
    # Rights alone do not tell: a disk may be full or read-only. So a file is made, which vanishes.
    existing = path if folder else path.parent
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    import tempfile  # takes time, and most commands name no file

    reason = ""
    try:
        tempfile.TemporaryFile(dir=existing).close()
    except OSError as error:
        is_free = False
        reason = f"nothing can be written in {existing}: {error.strerror or error}".lower()
    allowed = f"the name of {'a folder' if folder else 'a file'} where you may write"
    is_stream = is_special(path) and not folder
    require(is_free or is_stream, option, value or "empty", allowed, cure=reason)


class BadInput(Exception):  # noqa: N818 - it names the input, not the program, as the culprit
    """An input that cannot be used; `problems` are all that is wrong with it."""

    def __init__(self, problems: Iterable[RefusedError]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(str(problem) for problem in self.problems))


def nearest(name: str, names: Iterable[str]) -> str:
    """Return the known name that is most like `name`, whatever its capitals; empty if none is."""
    # Keys of case files have underscores where options of commands have hyphens.
    by_small_letters = {option.lower(): option for option in names}
    small = name.lower().replace("-", "_")
    close = get_close_matches(small, by_small_letters, n=1, cutoff=0.6)
    return by_small_letters[close[0]] if close else ""


def suggestion(name: str, names: Iterable[str]) -> str:
    """Return a question after the known name that was probably meant; empty if there is none."""
    close = nearest(name, names)
    return f"did you mean {close}?" if close else ""


def missing(error: ImportError) -> str:
    """Return the message about an import that failed: what is missing, and how to install it.

    Libraries of the optional dependencies of this project, such as dolfinx, are installed by their
    extra, as pip install 'alphacut[cell]'. Others are named alone.

    Args:
        error: The exception of the import. Its `name` may be a module of the library, such as
            "dolfinx.fem", or None where a library has raised the error itself.
    """
    message = str(error)
    if not isinstance(error, MissingLibraryError):  # which says how to install it
        library = (error.name or "what is missing").partition(".")[0]
        message += f"; {install_command(library)}"
    # ./enter, which sets this variable, brings an environment with all libraries.
    if not os.environ.get(INSIDE):
        message += ", or run inside ./enter"
    return message
