"""How results leave: tables as CSV files, tables and drawings of α-cuts as HTML for notebooks."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Sequence
from html import escape
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.refused import RefusedError

Cell = str | float
_WIDTH, _HEIGHT, _EDGE = 220, 70, 6  # of the drawing, in pixels


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


def membership_svg(alpha: ArrayLike, lower: ArrayLike, upper: ArrayLike) -> str:
    """Drawing of a membership function with the ends of its support below it.

    Args:
        alpha: Levels of the corners, rising from 0 to 1, shape (n,).
        lower: Lower ends of the cuts, shape (n,).
        upper: Upper ends of the cuts, shape (n,).
    """
    grade, low, high = (np.asarray(ends, float) for ends in (alpha, lower, upper))
    x = np.concatenate([low[:1], low, high[::-1], high[:1]])
    y = np.concatenate([[0.0], grade, grade[::-1], [0.0]])
    width = float(high[0] - low[0])
    along = (x - low[0]) / width if width > 0 else np.full(x.shape, 0.5)
    points = " ".join(
        f"{_EDGE + (_WIDTH - 2 * _EDGE) * a:.1f},{_EDGE + (_HEIGHT - 2 * _EDGE) * (1 - m):.1f}"
        for a, m in zip(along, y, strict=True)
    )
    line = f'<polyline points="{points}" fill="#0072B222" stroke="#0072B2" stroke-width="2"/>'
    ends = (("start", _EDGE, low[0]), ("end", _WIDTH - _EDGE, high[0]))
    texts = "".join(
        f'<text x="{at}" y="{_HEIGHT + 12}" font-size="12" text-anchor="{anchor}"'
        f' fill="currentColor">{value:.6g}</text>'
        for anchor, at, value in (ends if width > 0 else (("middle", _WIDTH // 2, low[0]),))
    )
    size = f'width="{_WIDTH}" height="{_HEIGHT + 18}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>{line}{texts}</svg>'


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
