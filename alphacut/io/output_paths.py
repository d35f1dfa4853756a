"""Output paths, checked before anything is computed."""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from alphacut.fuzzy.refused import RefusedError
from alphacut.io.files import is_special

OUTPUTS = ("out", "json", "export", "csv")
"""Options that name what is written."""


def check_destinations(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuses what a command could not write.

    Raises:
        RefusedError: An option names no such place.
    """
    for action in parser._actions:
        value = getattr(options, action.dest, None)
        if action.dest in OUTPUTS and isinstance(value, str) and value != "-":
            folder = action.metavar == "FOLDER"
            require_writable(action.option_strings[-1], value, folder=folder)


def require_writable(option: str, value: str, *, folder: bool) -> None:
    """Refuses a place where nothing can be written.

    Raises:
        RefusedError: It is one, or of the other kind.
    """
    path, kind = Path(value), "a folder" if folder else "a file"
    if not value.strip() or (path.exists() and path.is_dir() != folder and not is_special(path)):
        raise RefusedError(option, value or "empty", f"the name of {kind}")
    there = path if folder else path.parent
    while not there.exists() and there != there.parent:
        there = there.parent
    try:
        if not is_special(path):
            tempfile.TemporaryFile(dir=there).close()
    except OSError as error:
        reason = f"nothing can be written in {there}: {error.strerror or error}"
        raise RefusedError(option, value, f"{kind} where you may write", reason.lower()) from None


@contextmanager
def alone(option: str, folder: Path) -> Iterator[None]:
    """Keeps other runs out of a folder; where the file system cannot, nothing is kept out.

    Raises:
        RefusedError: Another run is writing into it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        with suppress(OSError):
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                cure = "another run is writing into it"
                raise RefusedError(option, str(folder), "a folder of its own", cure) from None
        yield
    finally:
        os.close(handle)
