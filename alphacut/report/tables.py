"""Sections and tables of the report as HTML."""

from __future__ import annotations

import html
from collections.abc import Sequence


def section(title: str, *content: str) -> str:
    """A section with its heading."""
    return f"<section>\n<h2>{html.escape(title)}</h2>\n" + "\n".join(content) + "\n</section>"


def table(
    head: Sequence[str], rows: Sequence[Sequence[object]], *, numbers: int | None = None
) -> str:
    """A table; from column `numbers` on everything is a number, aligned to the right."""
    first = 1 if numbers is None else numbers

    def cell(tag: str, column: int, content: object) -> str:
        mark = ' class="number"' if column >= first else ""
        return f"<{tag}{mark}>{html.escape(str(content))}</{tag}>"

    top = "".join(cell("th", column, name) for column, name in enumerate(head))
    body = "".join(
        "<tr>" + "".join(cell("td", column, entry) for column, entry in enumerate(row)) + "</tr>\n"
        for row in rows
    )
    return (
        "<div"
        f' class="scroll"><table><thead><tr>{top}</tr></thead><tbody>\n{body}</tbody></table></div>'
    )
