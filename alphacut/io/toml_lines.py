"""Lines on which the keys of a TOML file stand."""

from __future__ import annotations

import re

HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\]]*?)\s*\]\]?")
ASSIGNMENT = re.compile(r"""\s*([A-Za-z0-9_.\-"' ]+?)\s*=""")


def lines_of_keys(text: str) -> dict[str, int]:
    """Full key name (``study[1].name`` in repeated tables) to its line, from 1."""
    lines: dict[str, int] = {}
    counts: dict[str, int] = {}
    prefix, inside = "", ""
    for number, line in enumerate(text.splitlines(), start=1):
        if inside:
            inside = "" if inside in line else inside
        elif header := HEADER.match(line):
            name = header[2].strip().strip("\"'")
            if header[1] == "[[":
                counts[name] = counts.get(name, -1) + 1
                name = f"{name}[{counts[name]}]"
            prefix = name + "."
            lines.setdefault(name, number)
        elif match := ASSIGNMENT.match(line):
            lines.setdefault(prefix + re.sub(r"[\"' ]", "", match[1]), number)
            inside = _opened(line[match.end() :])
    return lines


def _opened(rest: str) -> str:
    """Closing mark of a value that goes on over the next lines, or an empty text."""
    return next((quotes for quotes in ('"""', "'''") if rest.count(quotes) % 2), "")
