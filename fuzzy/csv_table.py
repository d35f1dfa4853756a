"""CSV files of results: one row for each bound, whole or not at all."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path
from tempfile import NamedTemporaryFile

Cell = str | float


def write_csv(path: str | Path, titles: Sequence[str], rows: Iterable[Sequence[Cell]]) -> None:
    """Write a table under its titles; numbers keep all their digits.

    Args:
        path: The file; one that is there is replaced once the new one is whole.
        titles: Titles of the columns.
        rows: Texts and numbers.

    Raises:
        ValueError: The file cannot be written there.
    """
    target = Path(path)
    partial: Path | None = None
    try:
        with NamedTemporaryFile(
            "w", dir=target.parent, prefix=target.name, newline="", encoding="utf-8", delete=False
        ) as file:
            partial = Path(file.name)
            csv.writer(file).writerows([titles, *rows])
        partial.chmod(0o644)
        partial.replace(target)
    except OSError as error:
        if partial is not None:
            partial.unlink(missing_ok=True)
        raise ValueError(
            f"the table cannot be written to {target} ({error.strerror}); name a file in a folder"
            " that exists and may be written to"
        ) from None
