"""Imports point one way, and no package imports DOLFINx or its like."""

import ast
import re
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


TABLE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def rooms_of(package: str) -> tuple[str, ...]:
    """Folders of a package in the order of CONTRIBUTING's table: each may import those before."""
    rows = re.findall(rf"^\| in `{package}/` \| (.*) \|$", TABLE, re.MULTILINE)
    assert len(rows) == 1, f"CONTRIBUTING.md has {len(rows)} rows of the rooms in {package}"
    return tuple(re.findall(r"`(\w+)`", rows[0]))


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


def circles(imports: dict[str, set[str]]) -> set[str]:
    """Nodes on a circle: what stays when those that import nothing, or nobody imports, are gone."""
    rest = dict(imports)
    while free := {name for name, found in rest.items() if not found & rest.keys()}:
        rest = {name: found for name, found in rest.items() if name not in free}
    while last := {name for name in rest if not any(name in found for found in rest.values())}:
        rest = {name: found for name, found in rest.items() if name not in last}
    return set(rest)


def folder_of(module: str) -> str:
    """Folder of a module within its package, as "frame.bounds"; a file beside the folders is itself."""
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


def backward(imports: dict[str, set[str]], package: str) -> list[str]:
    """Imports of a folder from one that comes after it in CONTRIBUTING's table."""
    order = {f"{package}.{room}": number for number, room in enumerate(rooms_of(package))}
    return [
        f"{here} imports {there}"
        for here, used in folder_imports(imports).items()
        for there in used
        if here in order and order.get(there, -1) > order[here]
    ]


def test_no_files_import_one_another_in_a_circle():
    assert circles(graph()) == set()


def test_no_folders_import_one_another_in_a_circle():
    assert circles(folder_imports(graph())) == set()


@pytest.mark.parametrize("package", MAY_IMPORT)
def test_rooms_import_in_the_order_of_the_table(package):
    folders = {
        path.name
        for path in (ROOT / package).iterdir()
        if path.is_dir() and not path.is_symlink() and any(path.rglob("*.py"))
    }
    assert set(rooms_of(package)) == folders
    assert backward(graph(), package) == []


def test_a_circle_and_a_backward_import_would_be_seen():
    lazy = ast.parse("def f():\n    from alphacut.case import content\n")
    assert uses(lazy, {"alphacut.case.content"}) == {"alphacut.case.content"}
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == {"b", "c"}
    wrong = {"alphacut.io.files": {"alphacut.case.content"}, "alphacut.case.content": set()}
    assert backward(wrong, "alphacut") == ["alphacut.io imports alphacut.case"]
    pair = {"alphacut.frame.bounds.level": {"alphacut.frame.boxes"}}
    pair["alphacut.frame.boxes"] = {"alphacut.frame.bounds.box"}
    pair["alphacut.frame.bounds.box"] = set()
    assert circles(pair) == set()
    assert circles(folder_imports(pair)) == {"frame.bounds", "frame.boxes"}


def test_a_wrong_direction_would_be_seen():
    assert wrong_directions(
        "fuzzy", "plan.py", ast.parse("def f():\n    from alphacut.rve.cell.cell import Phase\n")
    ) == {"rve"}
    assert wrong_directions("rve", "cell.py", ast.parse("import alphacut.entry")) == {"alphacut"}
    assert not wrong_directions("rve", "__main__.py", ast.parse("import alphacut.entry"))


@pytest.mark.parametrize(
    "package", [f"alphacut.{name}" for name in (*MAY_IMPORT, "entry") if name != "alphacut"]
)
def test_a_package_imports_nothing_heavy(package):
    program = f"import sys, {package}; print(*sys.modules)"
    assert not HEAVY & modules_after(program)


def modules_after(program: str) -> set[str]:
    """What a program prints, word by word."""
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    return set(run.stdout.split())


def test_a_case_is_read_without_matplotlib():
    program = "import sys; from alphacut.case.content import load; load('cases/building.toml')"
    modules = modules_after(f"{program}; print(*sys.modules)")
    assert "alphacut.case.content" in modules
    assert not {name for name in modules if name.partition(".")[0] == "matplotlib"}
    assert not {
        name for name in modules if name.startswith(("alphacut.figures", "alphacut.questi"))
    }
