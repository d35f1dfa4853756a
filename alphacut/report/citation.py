"""Citation of the program and of the paper it follows, in BibTeX."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from alphacut.io.provenance import own_version


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
