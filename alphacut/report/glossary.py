"""The report's terms: each explained where it first occurs, and all together in a box."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from markupsafe import Markup, escape

from alphacut.report.tables import fragment

_FILE = Path(__file__).with_suffix(".toml")
TERMS: dict[str, str] = tomllib.loads(_FILE.read_text(encoding="utf-8"))
"""Terms and their meaning, word for word as in the documentation's glossary."""
_SAID = {name: meaning.replace("*", "") for name, meaning in TERMS.items()}
_WORDS = re.compile(
    "|".join(rf"(?<![\w-]){re.escape(name)}(?![\w-])" for name in sorted(TERMS, key=len)[::-1]),
    re.IGNORECASE,
)
_CLOSED = "pre|code|svg|script|h[1-3]|a|summary|select|button|strong"
_PIECES = re.compile(rf"(<({_CLOSED})\b.*?</\2>|<[^>]*>)", re.DOTALL)


def explained(html: Markup) -> Markup:
    """HTML in which the first occurrence of each term leads to the glossary and shows its meaning.

    Headings, code, drawings, links and what stands in tags are left alone.
    """
    pieces, told = _PIECES.split(html), set[str]()
    # split gives text, tag or closed element, the element's name, and again
    pieces[::3] = [_WORDS.sub(lambda found: _linked(found[0], told), text) for text in pieces[::3]]
    del pieces[2::3]
    return Markup("".join(pieces))


def _linked(word: str, told: set[str]) -> str:
    """The word as a link to its term when it occurs first."""
    name = next(name for name in TERMS if name.lower() == word.lower())
    if name in told:
        return word
    told.add(name)
    return f'<a class="term" href="#{anchor(name)}" data-meaning="{escape(_SAID[name])}">{word}</a>'


def anchor(name: str) -> str:
    """Identifier of a term on the page."""
    return "term-" + name.lower().replace(" ", "-").replace("α", "alpha")


def box() -> Markup:
    """All terms with their meanings."""
    return fragment("glossary", [(anchor(name), name, text) for name, text in _SAID.items()])
