"""Output paths, checked before anything is computed."""

from __future__ import annotations

import argparse
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from alphacut.io.files import is_special
from alphacut.io.problem import BadInput, Problem, refuse

INSIDE = (
    "inside ./enter only the project, the current folder, home and the temporary folder are visible"
)
ENDINGS = {"FILE.nc": (".nc",), "FILE.html": (".html", ".htm")}
OUTPUTS = ("out", "json", "export", "store", "csv")


def check_destinations(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    """Refuse empty text, and what a command could not write.

    Raises:
        BadInput: One problem for each option or argument of that kind.
    """
    problems: list[Problem] = []
    for action in parser._actions:
        given, writes = getattr(options, action.dest, None), action.dest in OUTPUTS
        kind = str(action.metavar)
        option = [kind, *action.option_strings][-1]
        if isinstance(given, str) and not given.strip(" ,"):
            what, allowed = ("the name", f"a {kind.lower()}") if writes else ("this", action.help)
            problems.append(Problem(option, f"{what} is empty", given, allowed or kind))
        elif writes and isinstance(given, str) and given != "-":
            place = list(unwritable(option, Path(given), folder=kind == "FOLDER"))
            problems += place or unknown_ending(option, kind, given)
    refuse(problems)


def unknown_ending(option: str, kind: str, given: str) -> Iterator[Problem]:
    """The problem of a file name whose ending names no format that this option writes."""
    ending = Path(given).suffix.lower()
    if option == "--json" and ending not in ("", ".json"):
        yield Problem(
            option, "this ending is not that of JSON", given, ".json, or - for standard output"
        )
    elif option == "--out" and kind in ENDINGS and ending not in ENDINGS[kind]:
        yield Problem(option, "this ending is not known", given, " or ".join(ENDINGS[kind]))


def unwritable(option: str, path: Path, *, folder: bool) -> Iterator[Problem]:
    """Problem of a place that cannot be written."""
    if path.is_dir() and not folder:
        yield Problem(
            option,
            "this is a folder, and a file is wanted",
            str(path),
            "a file's name, for example " + str(path / "result"),
        )
        return
    if folder and path.exists() and not path.is_dir():
        yield Problem(
            option, "this is a file, and a folder is wanted", str(path), "a new or existing folder"
        )
        return
    there = path if folder else path.parent
    while not there.exists() and there != there.parent:
        there = there.parent
    try:
        if not is_special(path):
            tempfile.TemporaryFile(dir=there).close()
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        yield Problem(
            option,
            f"nothing can be written in {there}: {reason}",
            str(path),
            hint(path) or "a folder that you may write to",
        )


@contextmanager
def alone(option: str, folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder; where the file system cannot, nothing is kept out.

    Raises:
        BadInput: Another run is writing into it.
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
                what = "another run is writing into this folder"
                cure = "another folder, or this one once that run has ended"
                raise BadInput.of(option, what, str(folder), cure) from None
        yield
    finally:
        os.close(handle)


def hint(path: Path) -> str:
    """Folders that the environment shows, for a path outside of them; else empty."""
    if not os.environ.get("ALPHACUT_INSIDE"):
        return ""
    shown = [
        Path(__file__).resolve().parents[2],
        Path.cwd(),
        Path.home(),
        Path(tempfile.gettempdir()),
    ]
    return "" if any(path.absolute().is_relative_to(folder) for folder in shown) else INSIDE
