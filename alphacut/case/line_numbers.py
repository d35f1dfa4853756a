"""Lines of the keys of a TOML text, which tomllib does not tell."""

from __future__ import annotations

import re

HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\]]*?)\s*\]\]?")
ASSIGNMENT = re.compile(r"""\s*([A-Za-z0-9_.\-"' ]+?)\s*=""")


def lines_of_keys(text: str) -> dict[str, int]:
    """Full key name (``study[1].name`` in repeated tables) to its line, from 1."""
    found: dict[str, int] = {}
    counts: dict[str, int] = {}
    prefix, inside = "", ""
    for number, line in enumerate(text.splitlines(), start=1):
        if inside:
            inside = "" if inside in line else inside
            continue
        if header := HEADER.match(line):
            name = header[2].strip().strip("\"'")
            if header[1] == "[[":
                counts[name] = counts.get(name, -1) + 1
                name = f"{name}[{counts[name]}]"
            prefix = name + "."
            found.setdefault(name, number)
        elif match := ASSIGNMENT.match(line):
            key = re.sub(r"[\"' ]", "", match[1])
            found.setdefault(prefix + key, number)
            inside = opened(line[match.end() :])
    return found


def opened(rest: str) -> str:
    """Closing mark of a value that goes on over the next lines, or an empty text."""
    for quotes in ('"""', "'''"):
        if rest.count(quotes) % 2:
            return quotes
    return ""


def key_at(text: str, line: int) -> tuple[str, int]:
    """The key that `line` belongs to, and the line it starts on: the last one at or above it."""
    best, at = "the file", 0
    for key, number in lines_of_keys(text).items():
        if at < number <= line:
            best, at = key, number
    return best, at or line
