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

RANKS = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "MPI_LOCALRANKID")
SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "MPI_LOCALNRANKS")
OUTPUTS = ("out", "json", "export", "csv", "tables")
"""Options that name what is written."""
INSIDE = "ALPHACUT_INSIDE"
"""Variable that ./enter sets."""
ELEMENTS = ("dolfinx", "petsc4py", "mpi4py", "basix", "ufl", "cffi", "gmsh", "meshio", "h5py")
EXTRAS = {"skimage": "particles", **dict.fromkeys(ELEMENTS, "cell")}
"""Extras of the installation by the libraries that they bring."""
Document = dict[str, Any]
"""A JSON document: numbers, texts, lists and documents by name; its reader knows their types."""


def rank() -> int:
    """This process's MPI rank as mpirun tells it, without starting MPI; 0 where there is none."""
    return next((int(os.environ[name]) for name in RANKS if name in os.environ), 0)


def ranks() -> int:
    """The number of MPI ranks as mpirun tells it; 1 where there is none."""
    return next((int(os.environ[name]) for name in SIZES if name in os.environ), 1)


def as_json(document: Mapping[str, object], *, indent: int | None = None) -> str:
    """One JSON object, ending in a line feed; what is not finite becomes null."""
    options: dict[str, Any] = {"indent": indent, "inf_nan_mode": "null", "fallback": _plain}
    return to_json(document, **options).decode() + "\n"


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return dict(value)
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


@contextmanager
def standard_output(*, alone: bool) -> Iterator[TextIO]:
    """Yields the stream for answers: standard output of the first MPI rank, nothing of others.

    `alone`: all else that is printed, by C libraries too, goes to standard error.
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
    """One line to people, on standard error; the first rank alone speaks."""
    if rank() == 0:
        bar_end = "\r\x1b[K" if sys.stderr.isatty() else ""  # over a progress bar
        with suppress(OSError):
            print(f"{bar_end}alphacut: {printable(message)}", file=sys.stderr, flush=True)


def check_destinations(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuses options of a command that name files or folders where nothing can be written."""
    for action in parser._actions:
        value = getattr(options, action.dest, None)
        if action.dest in OUTPUTS and isinstance(value, str) and value != "-":
            folder = action.metavar == "FOLDER"
            require_writable(action.option_strings[-1], value, folder=folder)


def require_writable(option: str, value: str, *, folder: bool) -> None:
    """Refuses the path of a file or folder, given by an option, where nothing can be written."""
    path, kind, reason = Path(value), "a folder" if folder else "a file", ""
    fits = bool(value.strip()) and (not path.exists() or path.is_dir() == folder)
    existing = path if folder else path.parent
    while not existing.exists() and existing != existing.parent:
        existing = existing.parent
    try:
        tempfile.TemporaryFile(dir=existing).close()
    except OSError as error:
        fits, reason = False, f"nothing can be written in {existing}: {error.strerror or error}"
    allowed, fits = f"the name of {kind} where you may write", fits or is_special(path)
    require(fits, option, value or "empty", allowed, cure=reason.lower())


class BadInput(Exception):  # noqa: N818 - it names the input, not the program, as the culprit
    """An input that cannot be used; `problems` are all that is wrong with it."""

    def __init__(self, problems: Iterable[RefusedError]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


def nearest(name: str, names: Iterable[str]) -> str:
    """The known name that comes nearest to `name`; empty if none comes near."""
    folded = {option.lower(): option for option in names}
    close = get_close_matches(name.lower().replace("-", "_"), folded, n=1, cutoff=0.6)
    return folded[close[0]] if close else ""


def suggestion(name: str, names: Iterable[str]) -> str:
    """Words on the known name that comes nearest; empty if none comes near."""
    return f"did you mean {close}?" if (close := nearest(name, names)) else ""


def missing(error: ImportError) -> str:
    """Message for an import that failed, with its cure."""
    library = (error.name or "").partition(".")[0]
    cure = f"pip install '.[{EXTRAS[library]}]'" if library in EXTRAS else f"install {library}"
    return f"{error}; {cure}" + ("" if os.environ.get(INSIDE) else ", or run inside ./enter")
