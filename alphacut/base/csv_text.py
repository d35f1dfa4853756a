"""Text of CSV files that a spreadsheet opens as texts and numbers, and never as formulas."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence

_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""What a text begins with that spreadsheets execute (OWASP, CSV injection)."""


def csv_cell(text: str) -> str:
    """Return a cell that no spreadsheet takes for a formula, before it is quoted.

    A text that begins as a formula does gets an apostrophe in front, numbers do not.

    Example:
        >>> csv_cell("=1+1"), csv_cell("-1.5e3")
        ("'=1+1", '-1.5e3')
    """
    is_formula = text.startswith(_FORMULA) and _NUMBER.fullmatch(text) is None
    return f"'{text}" if is_formula else text


def csv_text(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return lines of comma-separated cells, those with commas, quotes or line ends quoted."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerows([csv_cell(cell) for cell in row] for row in (head, *rows))
    return stream.getvalue()
