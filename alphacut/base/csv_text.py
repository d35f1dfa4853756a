"""Text of CSV files that a spreadsheet opens as texts and numbers, and never as formulas."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence
from itertools import chain


def csv_cell(text: str) -> str:
    """Return a text as a cell that no spreadsheet executes, before it is quoted.

    A text that begins like a formula (OWASP, CSV injection) gets an apostrophe in front, unless it
    is a number.

    Example:
        >>> csv_cell("=1+1"), csv_cell("-1.5e3")
        ("'=1+1", '-1.5e3')
    """
    begins_like_formula = text.startswith(("=", "+", "-", "@", "\t", "\r"))
    is_number = re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?", text)
    if begins_like_formula and not is_number:
        return f"'{text}"
    return text


def csv_text(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table as the text of a CSV file, with commas between cells and quotes where needed.

    A cell that a spreadsheet would take for a formula gets an apostrophe in front. Each line ends
    with a line feed.

    Args:
        head: Titles of the columns, the first line.
        rows: Cells of each row; their number is not checked.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    for row in chain([head], rows):
        writer.writerow([csv_cell(cell) for cell in row])
    return stream.getvalue()
