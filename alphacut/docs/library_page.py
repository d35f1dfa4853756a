"""Public names of the packages as a page, from their own docstrings.

python -m alphacut.docs.library_page > docs/library.md
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from types import ModuleType

PACKAGES = ("alphacut.fuzzy", "alphacut.stochastic", "alphacut.rve", "alphacut.frame")
RESULTS = (
    ("What `propagate()` returns", "alphacut.fuzzy.samples.result", "FuzzyResult"),
    ("What `decide()` returns", "alphacut.fuzzy.decisions.limits", "Decision"),
)
INNER = ("proving", "confronted", "charged")  # methods that plans call
HEAD = """# Library

Four packages, typed, each imported in a fraction of a second without DOLFINx; `./enter python FILE.py` runs a program with them, and after
`pip install .` any Python does. [How to propagate your own function](howto/own-function.md) begins with ten lines. Results convert to
xarray datasets with `.to_dataset()`. `help(alphacut.fuzzy.propagate)` and the like give arguments with shapes, units, ranges and errors; `make docs`
builds them as pages into `build/docs`.
"""


def page() -> str:
    """The page in Markdown."""
    return (
        "\n".join([HEAD, *(section(import_module(name)) for name in PACKAGES)])
        + "".join(result(said, getattr(import_module(room), name)) for said, room, name in RESULTS)
        + "\nMade by `python -m alphacut.docs.library_page`.\n"
    )


def section(package: ModuleType) -> str:
    """One package: classes, functions, tables."""
    about = first_sentence(package)
    return (
        f"## {package.__name__}\n\n{about}\n\n| name | what it is |\n|---|---|\n"
        + "\n".join(rows(package))
        + "\n"
    )


def rows(package: ModuleType) -> Iterator[str]:
    """A row for each public class or function, the functions first: they are what one calls."""
    found = [(name, getattr(package, name)) for name in package.__all__]
    for name, thing in sorted(found, key=lambda item: inspect.isclass(item[1])):
        if inspect.isclass(thing) or inspect.isfunction(thing):
            yield (
                f"| `{name}{'()' if inspect.isfunction(thing) else ''}` | {first_sentence(thing)} |"
            )


def result(said: str, kind: type) -> str:
    """Public attributes of a result, from its docstring, then its properties and methods."""
    listed = re.findall(
        r"^    (\w+): (.+(?:\n {8}.+)*)", (inspect.getdoc(kind) or "").partition("Args:")[2], re.M
    )
    told = [(name, " ".join(text.split()).replace("|", "\\|")) for name, text in listed]
    for name, thing in vars(kind).items():
        if isinstance(thing, property) and not name.startswith("_"):
            told.append((name, first_sentence(thing)))
        elif inspect.isfunction(thing) and not name.startswith("_") and name not in INNER:
            told.append((f"{name}()", first_sentence(thing)))
    return (
        f"\n## {kind.__name__}\n\n{said}: {first_sentence(kind)}\n\n| name | what it is |\n|---|---|\n"
        + "".join(f"| `{name}` | {text} |\n" for name, text in told)
    )


def first_sentence(thing: object) -> str:
    """The first paragraph of a docstring's head, on one line."""
    return (
        " ".join((inspect.getdoc(thing) or "").split("\n\n")[0].split())
        .replace("|", "\\|")
        .replace("``", "`")
    )


if __name__ == "__main__":
    print(page(), end="")
