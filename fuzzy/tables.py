"""How results leave: tables as CSV files, and as HTML for notebooks."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from tempfile import NamedTemporaryFile

from alphacut.fuzzy.refused import RefusedError

Cell = str | float


def html_table(header: Sequence[str], rows: Iterable[Sequence[str]], *, below: str = "") -> str:
    """A table with every text escaped.

    Args:
        header: Titles of the columns.
        rows: Texts of the cells.
        below: Text under the table; its lines are kept.
    """
    titles = "".join(f"<th>{escape(text)}</th>" for text in header)
    body = "".join(
        f"<tr>{''.join(f'<td>{escape(text)}</td>' for text in cells)}</tr>" for cells in rows
    )
    under = f"<p>{'<br>'.join(map(escape, below.splitlines()))}</p>" if below else ""
    return f"<table><thead><tr>{titles}</tr></thead><tbody>{body}</tbody></table>{under}"


def write_csv(path: str | Path, titles: Sequence[str], rows: Iterable[Sequence[Cell]]) -> None:
    """Write a table under its titles; numbers keep all their digits.

    Args:
        path: The file; one that is there is replaced once the new one is whole.
        titles: Titles of the columns.
        rows: Texts and numbers.

    Raises:
        RefusedError: The file cannot be written there.
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
        allowed = "a file in a folder that exists and may be written to"
        raise RefusedError("table", target, allowed, str(error.strerror)) from None
