"""Imports point one way, and no package imports DOLFINx or its like."""

import ast
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from alphacut.base.extras import EXTRAS
from tests.environment.house import ROOT, files_in, folder_of_package, tree

MAY_IMPORT = {
    "base": set(),
    "fuzzy": {"base"},
    "stochastic": {"base", "fuzzy"},
    "rve": {"base", "fuzzy", "stochastic"},
    "frame": {"base", "fuzzy"},
    "alphacut": {"base", "fuzzy", "stochastic", "rve", "frame"},
}
DOOR = ("alphacut.rve.__main__", "alphacut.__main__")
"""The one file of a room that imports the layer, whose command it is, and what it imports."""
HEAVY = {"pyvista", "sklearn", "scipy.stats"}.union(*EXTRAS.values())
"""What takes long to import, and what pip installs only with an extra."""


def package_of(module: str) -> str:
    """Package of this project that a module belongs to."""
    second = module.removeprefix("alphacut").strip(".").partition(".")[0]
    return second if second in MAY_IMPORT else "alphacut"


def module_of(file: Path) -> str:
    """Full name of a file's module."""
    parts = file.relative_to(ROOT).with_suffix("").parts
    parts = parts if parts[0] == "alphacut" else ("alphacut", *parts)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def uses(module: ast.AST, known: set[str]) -> set[str]:
    """Modules of this project that a module imports, anywhere: lazily or for types alone as well."""
    found: set[str] = set()
    for node in ast.walk(module):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in known else node.module)
    return found & known


@cache
def graph() -> dict[str, set[str]]:
    """The modules of the five packages that each of them imports."""
    packages = {module_of(file): tree(file) for file in files_in(*MAY_IMPORT)}
    return {name: uses(module, set(packages)) - {name} for name, module in packages.items()}


def wrong_directions(imports: dict[str, set[str]]) -> set[tuple[str, str]]:
    """Imports of a package that may not be imported; one door of a room may import the program."""
    return {
        (here, there)
        for here, used in imports.items()
        for there in used
        if package_of(there) not in MAY_IMPORT[package_of(here)] | {package_of(here)}
        and (here, there) != DOOR
    }


def circles(imports: dict[str, set[str]]) -> set[str]:
    """Nodes on a circle: what stays when those that import nothing, or nobody imports, are gone."""
    rest = dict(imports)
    while free := {name for name, found in rest.items() if not found & rest.keys()}:
        rest = {name: found for name, found in rest.items() if name not in free}
    while last := rest.keys() - set().union(*rest.values()):
        rest = {name: found for name, found in rest.items() if name not in last}
    return set(rest)


def folder_of(module: str) -> str:
    """Folder of a module, as "frame.bounds"; a file beside the folders is itself."""
    package = package_of(module)
    parts = module.removeprefix("alphacut.").removeprefix(f"{package}.").split(".")
    return f"{package}.{parts[0]}" if module != f"alphacut.{package}" else package


def folder_imports(imports: dict[str, set[str]]) -> dict[str, set[str]]:
    """The folders that each folder imports, of those that are not doors of a package."""
    folders: dict[str, set[str]] = {}
    for name, used in imports.items():
        here = folder_of(name)
        folders.setdefault(here, set()).update({folder_of(other) for other in used} - {here})
    return folders


def rooms_of(package: str) -> tuple[str, ...]:
    """Folders of a package in the order of CONTRIBUTING's table: each may import those before."""
    table = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^\| in `{package}/` \| (.*) \|$", table, re.MULTILINE)
    return tuple(re.findall(r"`(\w+)`", row))


def backward(imports: dict[str, set[str]], package: str) -> list[str]:
    """Imports of a folder from one that comes after it in CONTRIBUTING's table."""
    order = {f"{package}.{room}": number for number, room in enumerate(rooms_of(package))}
    return [
        f"{here} imports {there}"
        for here, used in folder_imports(imports).items()
        for there in used
        if here in order and order.get(there, -1) > order[here]
    ]


def test_imports_point_one_way():
    assert {package_of(name) for name in graph()} == set(MAY_IMPORT)
    assert wrong_directions(graph()) == set()


def test_no_files_and_no_folders_import_one_another_in_a_circle():
    assert circles(graph()) == set()
    assert circles(folder_imports(graph())) == set()


@pytest.mark.parametrize("package", [x for x in MAY_IMPORT if x != "base"])
def test_rooms_import_in_the_order_of_the_table(package):
    folders = {
        path.name
        for path in folder_of_package(package).iterdir()
        if path.is_dir()
        and path.name not in MAY_IMPORT.keys() - {"base"}
        and any(path.rglob("*.py"))
    }
    assert set(rooms_of(package)) == folders
    assert backward(graph(), package) == []


def modules_after(program: str) -> set[str]:
    """Modules that a new process has after a program."""
    command = [sys.executable, "-c", f"import sys\n{program}\nprint(*sys.modules)"]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_packages_and_the_program_import_nothing_heavy():
    packages = (f"alphacut.{name}" for name in MAY_IMPORT if name != "alphacut")
    assert not HEAVY & modules_after(f"import {', '.join(packages)}, alphacut.entry")


def test_a_case_is_read_without_figures_and_stages():
    program = "from alphacut.case.content import load; load('cases/building.toml')"
    modules = modules_after(program)
    assert "alphacut.case.content" in modules
    wrong = ("matplotlib", "alphacut.figures", "alphacut.stages")
    assert not {name for name in modules if name.startswith(wrong)}


def test_help_and_version_import_no_command():
    program = """
from alphacut.entry import main
for option in ("--help", "--version"):
    try: main([option])
    except SystemExit: pass
"""
    modules = modules_after(program)
    assert "alphacut.commands.table" in modules
    assert not {name for name in modules if name.startswith(("alphacut.case", "pydantic"))}
    assert "alphacut.commands.check" not in modules


def test_a_case_that_is_refused_imports_no_stages_and_a_missing_file_no_sections():
    known = {}
    for words in (["cases/building.toml", "--set=frame.masses=3"], ["no.toml"]):
        program = f"from alphacut.entry import main; assert main(['check', *{words}]) == 2"
        known[words[0]] = modules_after(program)
    assert not {name for name in known["no.toml"] if name.startswith(("alphacut.case", "pydantic"))}
    refused = known["cases/building.toml"]
    assert "alphacut.case.content" in refused
    slow = (
        "scipy",
        "numba",
        "alphacut.stages",
        "alphacut.frame.propagation",
        "alphacut.commands.case",
    )
    assert not {name for name in refused if name.startswith(slow)}


def test_a_case_is_checked_without_what_takes_longer_to_import_than_to_use():
    """Two motions of a building, and records of a suite with their spectral accelerations."""
    slow = {"numba", "pandas", "pint", "xarray", "matplotlib", "scipy", "alphacut.rve.image.study"}
    slow |= {"alphacut.commands.pipeline", "sympy", "h5py"}
    slow |= {"alphacut.frame.methods.proof", "alphacut.frame.methods.dual", "sqlite3"}
    slow |= {"multiprocessing", "joblib", "jinja2"}
    commands = [["check", f"cases/{case}.toml", "--quiet"] for case in ("building", "suite")]
    modules = modules_after(f"from alphacut import main; assert not any(map(main, {commands}))")
    assert "alphacut.frame.dynamics.flow" in modules
    assert not slow & modules


def test_a_picture_is_checked_without_plans_of_samples_and_rare_formats():
    command = ["check", "cases/composite.toml", "--quiet"]
    modules = modules_after(f"from alphacut import main; assert not main({command})")
    assert {"alphacut.rve.image.study", "PIL.PngImagePlugin"} <= modules
    slow = {"alphacut.stages.modulus", "alphacut.fuzzy.propagation", "PIL.TiffImagePlugin"}
    assert not slow & modules
