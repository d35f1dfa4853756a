"""Counts of the house, and the bound of each: ``python -m tests.environment.house`` prints them."""

from __future__ import annotations

import ast
import importlib
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("stochastic", "rve", "fuzzy", "frame", "alphacut")
TEXTS = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md")
BOUNDS = {
    "lines of the packages": 33_500,
    "files of the packages": 235,
    "lines of C": 700,
    "files of C": 1,
    "places of fmt: skip": 10,
    "files in the largest folder": 14,
    "public names of a package": 30,
    "lines of tests": 15_500,
    "lines of benchmarks": 3_000,
    "lines of README, CHANGELOG and docs": 2_800,
    "commands": 8,
    "options of a command": 12,
    "case keys": 118,
    "places that raise": 350,
}


def package_files(pattern: str = "*.py") -> list[Path]:
    """Files of the five packages; the links inside `alphacut` are not followed."""
    return [
        file
        for package in PACKAGES
        for file in sorted((ROOT / package).rglob(pattern))
        if not any(folder.is_symlink() for folder in file.parents)
    ]


def lines(files: Iterable[Path]) -> int:
    """Number of lines in the files."""
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def raising(tree: ast.AST) -> int:
    """Places of a syntax tree that raise something new, list a problem or call `require`."""
    return sum(
        (isinstance(node, ast.Raise) and node.exc is not None)
        or (
            isinstance(node, ast.Call)
            and getattr(node.func, "id", "") in ("InputProblem", "require")
        )
        for node in ast.walk(tree)
    )


def written_docs() -> list[Path]:
    """Pages that a person wrote; nothing generated."""
    pages = [*(ROOT / "docs").rglob("*.md"), *(ROOT / name for name in TEXTS)]
    return [page for page in pages if page.is_file()]


def interface() -> dict[str, int]:
    """Counts of the commands, their options, and the keys of a case."""
    from alphacut.case.load import every_key
    from alphacut.entry import COMMANDS, parsers

    each = parsers("alphacut", COMMANDS)[1]
    options = [
        sum(bool(action.option_strings) and action.dest != "help" for action in parser._actions)
        for parser in each.values()
    ]
    return {
        "commands": len(each),
        "options of a command": max(options),
        "case keys": len(every_key()),
    }


def counts() -> dict[str, int]:
    """Every count by its name in `BOUNDS`."""
    files, compiled = package_files(), package_files("*.c")
    folders = Counter(
        file.parent
        for file in [*files, *(ROOT / "tests").rglob("*.py"), *(ROOT / "benchmarks").rglob("*.py")]
    )
    texts = [file.read_text(encoding="utf-8") for file in files]
    public = [len(importlib.import_module(f"alphacut.{name}").__all__) for name in PACKAGES[:4]]
    return {
        "lines of the packages": lines(files),
        "files of the packages": len(files),
        "lines of C": lines(compiled),
        "files of C": len(compiled),
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
    """Each count beside its bound, a line each."""
    present = counts()
    rows = [f"{name:36} {present[name]:7,} of {bound:7,}" for name, bound in BOUNDS.items()]
    per = {
        name: lines(f for f in package_files() if f.is_relative_to(ROOT / name))
        for name in PACKAGES
    }
    return "\n".join([*rows, ", ".join(f"{name} {count:,}" for name, count in per.items())])


if __name__ == "__main__":
    print(table())
