"""``alphacut cite``: how to cite the program and the paper it follows."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.output import as_json, write_text
from alphacut.provenance import own_version

ABOUT = "how to cite this program"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--json", metavar="FILE", help="write the citation as JSON; - for standard output")
    parser.add_argument("--quiet", action="store_true", help="no difference here; every command takes it")


def citation() -> str:
    """The citations in BibTeX, from CITATION.cff where that is at hand."""
    file = Path(__file__).resolve().parent.parent / "CITATION.cff"
    own, _, paper = file.read_text(encoding="utf-8").partition("references:") if file.is_file() else ("", "", "")
    program = told(own, "title", "date-released", "name")
    entry = {
        "author": f"{{{program.get('name', 'The alphacut developers')}}}",
        "title": program.get("title", "alphacut: from an uncertain microstructure to the fuzzy vibration of a structure"),
        "version": own_version(),
        "year": program.get("date-released", "")[:4],
    }
    return bibtex("software", "alphacut", entry) + bibtex("article", "alphacut-paper", told(paper, "title", "journal", "year", "doi"))


def told(text: str, *names: str) -> dict[str, str]:
    """The values of some keys of a piece of CITATION.cff."""
    found = dict(re.findall(r'^[\s-]*([\w-]+): *"?([^"\n]+)"?', text, flags=re.MULTILINE))
    return {name: found[name] for name in names if name in found}


def bibtex(kind: str, name: str, entry: Mapping[str, str]) -> str:
    """An entry; empty where nothing is known."""
    lines = "".join(f"  {key} = {{{value}}},\n" for key, value in entry.items() if value)
    return f"@{kind}{{{name},\n{lines}}}\n" if lines else ""


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Print."""
    document = as_json({"bibtex": citation(), "version": own_version()})
    if options.json not in (None, "-"):
        write_text(options.json, document)
    out.write(document if options.json == "-" else citation())
    return 0
