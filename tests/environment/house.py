"""Counts of the house: ``python -m tests.environment.house`` prints them."""

from __future__ import annotations

import ast
import importlib
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("stochastic", "rve", "fuzzy", "frame", "alphacut")
FOLDERS = (*PACKAGES, "tests", "benchmarks", "docs", "demos")
TEXTS = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")


def package_files(pattern: str = "*.py") -> list[Path]:
    """Files of the five packages; the links inside `alphacut` are not followed."""
    return [
        file
        for package in PACKAGES
        for file in sorted((ROOT / package).rglob(pattern))
        if not any(folder.is_symlink() for folder in file.parents)
    ]


@cache
def trees() -> dict[Path, ast.Module]:
    """Syntax trees of all Python files of the project."""
    files = {path.resolve() for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")}
    return {file: ast.parse(file.read_text(encoding="utf-8")) for file in sorted(files)}


def lines(files: Iterable[Path]) -> int:
    """Number of lines in the files."""
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def raising(tree: ast.AST) -> int:
    """Places of a syntax tree that raise something new, list a problem or call `require`."""
    return sum(
        (isinstance(node, ast.Raise) and node.exc is not None)
        or (isinstance(node, ast.Call) and getattr(node.func, "id", "") == "require")
        for node in ast.walk(tree)
    )


def written_docs() -> list[Path]:
    """Pages that a person wrote; nothing generated."""
    pages = [*(ROOT / "docs").rglob("*.md"), *(ROOT / name for name in TEXTS)]
    return [page for page in pages if page.is_file()]


def interface() -> dict[str, int]:
    """Counts of the commands, their options, and the keys of a case."""
    from alphacut.case.content import Content
    from alphacut.case.parse import keys_of
    from alphacut.entry import COMMANDS, build_parsers

    each = build_parsers("alphacut", COMMANDS)[1]
    options = [
        sum(bool(action.option_strings) and action.dest != "help" for action in parser._actions)
        for parser in each.values()
    ]
    return {
        "commands": len(each),
        "options of a command": max(options),
        "case keys": len(keys_of(Content)),
    }


def kinds_of_lines(text: str) -> Counter[str]:
    """Number of lines of code, docstrings and comments, and of empty ones, in a file."""
    documented: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and node.body:
            first = node.body[0]
            if ast.get_docstring(node, clean=False) is not None:
                documented |= set(range(first.lineno, (first.end_lineno or first.lineno) + 1))

    def kind(number: int, line: str) -> str:
        if number in documented:
            return "docstring"
        stripped = line.strip()
        return "empty" if not stripped else "comment" if stripped.startswith("#") else "code"

    return Counter(kind(number, line) for number, line in enumerate(text.splitlines(), 1))


def counts() -> dict[str, int]:
    """Every count by its name."""
    files = package_files()
    folders = Counter(file.parent for file in files)
    texts = [file.read_text(encoding="utf-8") for file in files]
    public = [len(importlib.import_module(f"alphacut.{name}").__all__) for name in PACKAGES[:4]]
    return {
        "lines of the packages": lines(files),
        "files of the packages": len(files),
        "places of fmt: skip": sum(text.count("# fmt: skip") for text in texts),
        "files in the largest folder": max(folders.values()),
        "public names of a package": max(public),
        "lines of tests": lines((ROOT / "tests").rglob("*.py")),
        "lines of benchmarks": lines((ROOT / "benchmarks").rglob("*.py")),
        "lines of README, CHANGELOG and docs": lines(written_docs()),
        "places that raise": sum(raising(ast.parse(text)) for text in texts),
        **interface(),
    }


def table() -> str:
    """Each count on a line, then files and kinds of lines of each package."""
    rows = [f"{name:36} {count:7,}" for name, count in counts().items()]
    for package in PACKAGES:
        files = [file for file in package_files() if file.is_relative_to(ROOT / package)]
        kinds = sum((kinds_of_lines(x.read_text(encoding="utf-8")) for x in files), Counter[str]())
        words = ", ".join(f"{kind} {count:,}" for kind, count in sorted(kinds.items()))
        rows.append(f"{package:12} {kinds.total():7,} lines in {len(files)} files: {words}")
    return "\n".join(rows)


if __name__ == "__main__":
    print(table())
