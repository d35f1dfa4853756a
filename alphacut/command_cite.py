"""``alphacut cite``: how to cite the program and the paper it follows."""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path
from typing import TextIO

from alphacut.provenance import own_version

ABOUT = "how to cite this program"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Options of the command."""
    parser.add_argument("--quiet", action="store_true", help="no difference here; every command takes it")


def citation() -> str:
    """The citation in BibTeX, from CITATION.cff where that is at hand."""
    file = Path(__file__).resolve().parent.parent / "CITATION.cff"
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    found = dict(re.findall(r'^(title|date-released): *"?([^"\n]+)"?', text, flags=re.MULTILINE))
    title = found.get("title", "alphacut: from an uncertain microstructure to the fuzzy vibration of a structure")
    year = found.get("date-released", "")[:4]
    return (
        f"@software{{alphacut,\n  title = {{{title}}},\n  version = {{{own_version()}}},\n"
        + (f"  year = {{{year}}},\n" if year else "")
        + "}\n"
    )


def run(options: argparse.Namespace, petsc: Mapping[str, str], out: TextIO) -> int:
    """Print."""
    out.write(citation())
    return 0
