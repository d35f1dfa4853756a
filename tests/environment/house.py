"""Counts of the house: ``python -m tests.environment.house`` prints them."""

from __future__ import annotations

import ast
from collections import Counter
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("stochastic", "rve", "fuzzy", "frame", "alphacut")
FOLDERS = (*PACKAGES, "tests", "benchmarks", "docs", "demos")


def folder_of_package(name: str) -> Path:
    """Folder of a package: beside alphacut, or within it, as in the source archive."""
    return ROOT / name if (ROOT / name).is_dir() else ROOT / "alphacut" / name


def top_folder(file: Path) -> str:
    """Name of the package or of the folder at the top that a file belongs to."""
    first, *further = file.relative_to(ROOT).parts
    return further[0] if first == "alphacut" and further[0] in PACKAGES else first


@cache
def tree(file: Path) -> ast.Module:
    """Syntax tree of a Python file."""
    return ast.parse(file.read_text(encoding="utf-8"))


@cache
def files() -> list[Path]:
    """All Python files of the project."""
    return sorted({path.resolve() for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")})


def files_in(*folders: str) -> list[Path]:
    """Python files in folders of the project, by their names at the top."""
    return [file for file in files() if top_folder(file) in folders]


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


def table() -> str:
    """Lines and files of each folder, those of packages by their kinds."""
    rows = []
    for name, folders in {**{x: (x,) for x in FOLDERS}, "packages": PACKAGES}.items():
        files = files_in(*folders)
        kinds = sum((kinds_of_lines(x.read_text(encoding="utf-8")) for x in files), Counter[str]())
        words = ", ".join(f"{kind} {count:,}" for kind, count in sorted(kinds.items()))
        rows.append(f"{name:12} {kinds.total():7,} lines in {len(files)} files: {words}")
    return "\n".join(rows)


if __name__ == "__main__":
    print(table())
