"""Imports point one way, and no package imports DOLFINx or its like."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
MAY_IMPORT = {
    "fuzzy": set(),
    "stochastic": {"fuzzy"},
    "rve": {"stochastic", "fuzzy"},
    "frame": {"stochastic", "fuzzy"},
    "alphacut": {"stochastic", "fuzzy", "rve", "frame"},
}
HEAVY = {
    "dolfinx",
    "petsc4py",
    "mpi4py",
    "basix",
    "ufl",
    "gmsh",
    "pyvista",
    "matplotlib",
    "xarray",
    "pandas",
    "sklearn",
    "skimage",
    "scipy.stats",
}


def package_of(module: str) -> str:
    """Package of this project that a module belongs to; empty where it is none of them."""
    first, _, rest = module.partition(".")
    if first != "alphacut":
        return ""
    second = rest.partition(".")[0]
    return second if second in MAY_IMPORT else "alphacut"


def imported(tree: ast.AST) -> set[str]:
    """Packages of this project that a syntax tree imports."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {package_of(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
            found |= {package_of(name) for name in names}
    return found - {""}


def wrong_directions(package: str, file_name: str, tree: ast.AST) -> set[str]:
    """Packages of this project that a file imports and may not."""
    entry = {"alphacut"} if file_name == "__main__.py" else set()
    return imported(tree) - MAY_IMPORT[package] - {package} - entry


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_imports_point_one_way(package):
    files = sorted((ROOT / package).rglob("*.py"))
    assert files
    wrong = {
        file.name: wrong_directions(package, file.name, ast.parse(file.read_text(encoding="utf-8")))
        for file in files
    }
    assert not {name: found for name, found in wrong.items() if found}


ROOMS = {
    "alphacut": ("io", "records", "case", "stages", "export", "figures", "report", "commands"),
    "fuzzy": ("sets", "knowledge", "campaign", "plans"),
    "frame": ("calculus", "structures", "response", "dynamics", "modal", "certificate", "methods"),
    "rve": ("mesh", "planar", "slices", "series", "table"),
}
"""Rooms of each package, in the order in which they may import: each those before it."""


def module_of(path: Path) -> str:
    """Full name of a file's module."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "alphacut" else ("alphacut", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def project_files() -> dict[str, Path]:
    """Every file of the five packages by its module; links are not followed."""
    return {
        module_of(path): path
        for package in MAY_IMPORT
        for path in (ROOT / package).rglob("*.py")
        if package != "alphacut" or path.relative_to(ROOT).parts[1] not in MAY_IMPORT
    }


def uses(tree: ast.AST, known: set[str]) -> set[str]:
    """Modules of this project that a tree imports, anywhere: lazily or for types alone as well."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in known else node.module)
    return found & known


def graph() -> dict[str, set[str]]:
    """The modules that each module imports."""
    files = project_files()
    return {
        name: uses(ast.parse(path.read_text(encoding="utf-8")), set(files)) - {name}
        for name, path in files.items()
    }


def circles(of: dict[str, set[str]]) -> set[str]:
    """Modules that lie on a circle: what is left once those without imports are taken away."""
    left = dict(of)
    while free := {name for name, found in left.items() if not found & left.keys()}:
        left = {name: found for name, found in left.items() if name not in free}
    while last := {name for name in left if not any(name in found for found in left.values())}:
        left = {name: found for name, found in left.items() if name not in last}
    return set(left)


def backward(of: dict[str, set[str]]) -> list[str]:
    """Imports from a room of one that comes after it."""
    wrong = []
    for package, rooms in ROOMS.items():
        place = {room: number for number, room in enumerate(rooms)}
        prefix = "alphacut." if package == "alphacut" else f"alphacut.{package}."
        for name, found in of.items():
            here = name.removeprefix(prefix).partition(".")[0] if name.startswith(prefix) else ""
            for other in found if here in place else ():
                there = other.removeprefix(prefix).partition(".")[0]
                if other.startswith(prefix) and place.get(there, -1) > place[here]:
                    wrong.append(f"{name} imports {other}")
    return wrong


def test_no_files_import_one_another_in_a_circle():
    assert circles(graph()) == set()


def test_rooms_import_in_one_direction():
    assert backward(graph()) == []


def test_a_circle_and_a_backward_import_would_be_seen():
    lazy = ast.parse("def f():\n    from alphacut.case import load\n")
    assert uses(lazy, {"alphacut.case.load"}) == {"alphacut.case.load"}
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == {"b", "c"}
    assert backward({"alphacut.io.files": {"alphacut.case.load"}, "alphacut.case.load": set()}) == [
        "alphacut.io.files imports alphacut.case.load"
    ]


def test_a_wrong_direction_would_be_seen():
    assert wrong_directions(
        "fuzzy", "plan.py", ast.parse("def f():\n    from alphacut.rve.cell import Phase\n")
    ) == {"rve"}
    assert wrong_directions("rve", "cell.py", ast.parse("import alphacut.entry")) == {"alphacut"}
    assert not wrong_directions("rve", "__main__.py", ast.parse("import alphacut.entry"))


@pytest.mark.parametrize(
    "package", [f"alphacut.{name}" for name in (*MAY_IMPORT, "entry") if name != "alphacut"]
)
def test_a_package_imports_nothing_heavy(package):
    program = f"import sys, {package}; print(*sys.modules)"
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert not HEAVY & set(run.stdout.split())
