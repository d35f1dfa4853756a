"""Pieces of the report as HTML, by Jinja2; text is escaped unless it is markup already."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

if TYPE_CHECKING:
    from jinja2 import Environment

HERE = Path(__file__).parent
Rows = Sequence[Sequence[object]]


@cache
def environment() -> Environment:
    """The templates of this folder; everything in them is escaped."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    return Environment(autoescape=True, loader=FileSystemLoader(HERE), undefined=StrictUndefined)


def fragment(name: str, *values: object) -> Markup:
    """A macro of ``fragments.html`` with its values filled in."""
    return Markup(getattr(environment().get_template("fragments.html").module, name)(*values))


def section(title: str, *content: Markup) -> Markup:
    """A section with its heading; empty pieces are left out."""
    return fragment("section", title, [piece for piece in content if piece])


def table(head: Sequence[str], rows: Rows) -> Markup:
    """A table; all columns but the first hold numbers, aligned to the right."""
    return fragment("table", head, rows, 1) if rows else Markup("")


def paragraphs(*texts: str) -> Markup:
    """One paragraph for each text; words that are markup stay so."""
    return fragment("paragraphs", [text for text in texts if text])


def folded(head: str, *content: Markup) -> Markup:
    """A part that unfolds; empty where it holds nothing."""
    pieces = Markup("\n").join(piece for piece in content if piece)
    return fragment("details", head, pieces) if pieces else Markup("")


def code(text: str, tag: str = "code") -> Markup:
    """Text as it was typed, on its line or, with the tag pre, by itself."""
    return Markup("<{0}>{1}</{0}>").format(tag, text)


def picture(png: Path, caption: str) -> Markup:
    """A PNG inside the page; empty where the file is missing.

    No SVG is taken from the folder: it could hold a script of somebody else.
    """
    if not png.is_file() or png.read_bytes()[:8] != b"\x89PNG\r\n\x1a\n":
        return Markup("")
    data = base64.b64encode(png.read_bytes()).decode()
    image = Markup('<img alt="{}" src="data:image/png;base64,{}">').format(caption, data)
    return fragment("figure", image, caption)
