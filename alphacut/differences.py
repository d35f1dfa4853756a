"""What the program does otherwise than the paper, read from the heads of the modules that say so."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("stochastic", "rve", "fuzzy", "frame")
MARK = "This differs from the paper in:"


def differences() -> Iterator[tuple[str, str]]:
    """Subject of each module that differs, and its differences, "1. … 2. …"."""
    root = Path(__file__).resolve().parent.parent
    for package in PACKAGES:
        for file in sorted((root / package).glob("*.py")):
            words = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
            if MARK in words:
                after = words.partition(MARK)[2].split("\n\n")[0]
                subject = re.sub(r"\s*\(.*", "", words.partition("\n")[0].rstrip("."))
                yield subject, " ".join(after.split())
