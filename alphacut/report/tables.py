"""Pieces of the report as HTML, by Jinja2; text is escaped unless it is markup already."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from markupsafe import Markup

from alphacut.figures.captions import INPUTS
from alphacut.io.provenance import own_version

if TYPE_CHECKING:
    from jinja2 import Environment


HERE = Path(__file__).parent


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


def table(
    head: Sequence[str], rows: Sequence[Sequence[object]], *, numbers: int | None = None
) -> Markup:
    """A table; from column `numbers` on everything is a number, aligned to the right."""
    return fragment("table", head, rows, 1 if numbers is None else numbers)


def paragraphs(*texts: str) -> Markup:
    """One paragraph for each text; words that are markup stay so."""
    return fragment("paragraphs", texts)


def items(entries: Iterable[str]) -> Markup:
    """A list."""
    return fragment("items", list(entries))


def details(head: str, content: Markup) -> Markup:
    """A part that unfolds."""
    return fragment("details", head, content)


def code(text: str, tag: str = "code") -> Markup:
    """Text as it was typed, on its line or, with the tag pre, by itself."""
    return Markup("<{0}>{1}</{0}>").format(tag, text)


SYMBOL = re.compile(r"\w+\.\w|\w*[\d_]|(?!a\b)\w\b")
"""What is told by its digits, its length or its point: q3, c, frame.masses."""


def sentence(text: str) -> str:
    """Text as a sentence: a capital, unless a symbol or key leads it, and a full stop."""
    symbol = SYMBOL.match(text) or re.split(r"\W", text)[0] in INPUTS
    head = text[:1] if symbol else text[:1].upper()
    return f"{head}{text[1:].rstrip('.')}." if text else ""


def percent(share: float | None) -> str:
    """A share in percent; a dash where there is none, as of a width of zero."""
    return "–" if share is None else f"{share:.1%}"


def citation() -> str:
    """The citations in BibTeX, from CITATION.cff where that is at hand."""
    file = Path(__file__).resolve().parents[2] / "CITATION.cff"
    own, _, paper = (
        file.read_text(encoding="utf-8").partition("references:")
        if file.is_file()
        else ("", "", "")
    )
    program = told(own, "title", "date-released", "name")
    entry = {
        "author": f"{{{program.get('name', 'The alphacut developers')}}}",
        "title": program.get(
            "title",
            "alphacut: from an uncertain microstructure to the fuzzy vibration of a structure",
        ),
        "version": own_version(),
        "year": program.get("date-released", "")[:4],
    }
    return bibtex("software", "alphacut", entry) + bibtex(
        "article", "alphacut-paper", told(paper, "title", "journal", "year", "doi")
    )


def told(text: str, *names: str) -> dict[str, str]:
    """The values of some keys of a piece of CITATION.cff."""
    found = dict(re.findall(r'^[\s-]*([\w-]+): *"?([^"\n]+)"?', text, flags=re.MULTILINE))
    return {name: found[name] for name in names if name in found}


def bibtex(kind: str, name: str, entry: Mapping[str, str]) -> str:
    """An entry; empty where nothing is known."""
    lines = "".join(f"  {key} = {{{value}}},\n" for key, value in entry.items() if value)
    return f"@{kind}{{{name},\n{lines}}}\n" if lines else ""
