"""Text of a case file: its TOML tree, where it is broken, and the lines of its keys."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from alphacut.case.overrides import Raw
from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput, Problem

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


def contents(path: Path) -> str:
    """Text of a file, or what is wrong with it: missing, a folder, not UTF-8."""
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = {
            FileNotFoundError: "there is no such file",
            IsADirectoryError: "this is a folder",
        }.get(type(error), error.strerror)
        raise BadInput(
            Problem(
                str(path), f"{reason}", allowed=hint(path) or "a case file such as cases/paper.toml"
            )
        ) from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8")
        line = before.count("\n") + 1
        key, _ = key_at(data.decode("utf-8", "replace"), line)
        raise BadInput(
            Problem(
                key,
                f"byte {data[error.start]:#04x} is not UTF-8",
                allowed="text in UTF-8",
                file=str(path),
                line=line,
            )
        ) from None


def parsed(path: Path, text: str) -> Raw:
    """The TOML tree, or the line and key where it is broken."""
    try:
        return tomllib.loads(text.replace("\r\n", "\n"))
    except tomllib.TOMLDecodeError as error:
        where = re.search(r"\(at line (\d+), column \d+\)", str(error))
        line = int(where[1]) if where else max(1, len(text.splitlines()))
        reason = re.sub(r"\s*\(at .*\)$", "", str(error)).rstrip(".")
        shown = text.splitlines()[line - 1].strip() if text.splitlines() else ""
        key = broken_key(text, line)
        what = f"this is not TOML: {reason[:1].lower()}{reason[1:]}, at '{shown}'"
        problem = Problem(key, what, allowed=cure(shown), file=str(path), line=line)
        raise BadInput(problem) from None


def cure(line: str) -> str:
    """Cure of a broken line where that is plain; else empty."""
    name, _, value = (part.strip() for part in line.partition("#")[0].partition("="))
    if re.fullmatch(r"[\w\-]+", name) and not name.isascii():
        return "keys of plain letters, digits and _"
    if match := re.fullmatch(r"([-+]?\d+),(\d+)(.*)", value):
        if name in ("seed", "discs", "packings", "bootstrap", "samples"):
            return "a whole number"
        return f"{match[1]}.{match[2]}{match[3]}, with a point"
    unquoted = re.fullmatch(r"(\[[^\]\"']*\]|[-+]?[\d.,]+)\s*[A-Za-z%µ][^\"']*", value)
    return f'put it in quotes: "{value}"' if unquoted else ""


def broken_key(text: str, line: int) -> str:
    """Key on a broken line: before the =, or the first word, or the key it belongs to."""
    key, at = key_at(text, line)
    broken = text.splitlines()[line - 1] if text else ""
    if section := re.match(r"\s*\[+\s*([\w.\-]+)\s*\]+", broken):
        return section[1]
    word = re.match(r"\s*([A-Za-z_][\w\-]*)\s*$", broken)
    return word[1] if word and at != line else key
