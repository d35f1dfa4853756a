"""Every import has a provider that the environment's package list names."""

import ast
import re
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

from alphacut.base.extras import EXTRAS
from tests.environment.house import FOLDERS, PACKAGES, ROOT, files, files_in, tree

SAME = (
    "distributed dolfinx gmsh hypothesis jinja2 matplotlib meshio mpi4py numba numpy pint "
    "pytest pydantic pyvista scipy skimage sympy threadpoolctl xarray"
)
"""Packages that are named python3- and as they are imported."""
DIRECT = {name: f"python3-{name}" for name in SAME.split()} | {
    "PIL": "python3-matplotlib",  # which depends on Pillow, by pip too
    "basix": "python3-dolfinx",
    "mpmath": "python3-sympy",  # which depends on it
    "pandas": "python3-xarray",  # which depends on it
    "petsc4py": "python3-petsc4py-real",
    "pydantic_core": "python3-pydantic",  # which depends on it
    "tifffile": "python3-skimage",  # which depends on it
    "ufl": "python3-dolfinx",
    "vtkmodules": "python3-pyvista",  # which depends on VTK
}
LOCAL = {"_typeshed", "mpl_toolkits", "plane"}
"""Names within others: of mypy, of Matplotlib, and meshes/plane.py."""
INDIRECT = {  # imported by others on this project's behalf
    "cffi": "python3-cffi",  # DOLFINx, to compile forms
    "h5py": "python3-h5py",  # meshio, to write .xdmf
    "ipykernel": "python3-ipykernel",  # the notebook
    "joblib": "python3-joblib",
    "myst_parser": "python3-myst-parser",  # Sphinx, for the pages of docs
    "jupytext": "python3-jupytext",  # Sphinx, to read demos
    "myst_nb": "python3-myst-nb",  # Sphinx, to run demos
    "nbclient": "python3-nbclient",
    "netCDF4": "python3-netcdf4",  # xarray, to write results
    "notebook": "python3-notebook",
    "pip": "python3-pip",  # enter, to install ruff
    "pytest_cov": "python3-pytest-cov",  # pytest, for make coverage
    "pytest_timeout": "python3-pytest-timeout",  # pytest, to end and name a test that hangs
    "xdist": "python3-pytest-xdist",  # pytest, for make test
    "sphinx": "python3-sphinx",
}
FROM_PYPI = {  # each is needed by one comparison, or is an optional extra
    "ansys": "frame/structures/mapdl.py",
    "array_api_compat": "rve/image/fields/grid.py",
    "cupy": "rve/image/fields/grid.py",
    "eurocodepy": "tests/frame/spectra/test_other_packages.py",
    "obspy": "frame/records/read.py",
    "openseespylinux": "benchmarks/frame/opensees.py",
    "pyyeti": "frame/structures/nastran.py",
}

IN_WHEELS = dict.fromkeys(
    ("basix", "cffi", "dolfinx", "mpi4py", "petsc4py", "ufl"), "dolfinx-solver-real"
) | {
    "PIL": "pillow",
    "ansys": "ansys-mapdl-reader",
    "cupy": "cupy-cuda13x",
    "pydantic_core": "pydantic",
    "skimage": "scikit-image",
}
"""Distributions at PyPI, or those that depend on them, whose names are not those of the imports."""


def imports_of(tree: ast.Module) -> set[str]:
    """Top-level names that a file imports, by statement or by a name given to pytest or importlib."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
        elif isinstance(node, ast.Call) and node.args:
            function = node.func
            called = getattr(function, "attr", getattr(function, "id", ""))
            first = node.args[0]
            if called in ("importorskip", "import_module") and isinstance(first, ast.Constant):
                found.add(first.value)
    return {name.partition(".")[0] for name in found}


def foreign_imports(*folders: str) -> set[str]:
    """Names that files of the project, or of folders, import and that neither it nor Python has."""
    chosen = files_in(*folders) if folders else files()
    names = set().union(*(imports_of(tree(file)) for file in chosen))
    return names - sys.stdlib_module_names - set(FOLDERS) - LOCAL


def environment_packages(*lists: str) -> set[str]:
    """Debian packages in lists of `enter`, by the names of these."""
    text = (ROOT / "enter").read_text(encoding="utf-8")
    names = set[str]()
    for name in lists:
        listed = re.search(rf"^{name}=\((.*?)^\)", text, re.MULTILINE | re.DOTALL)
        assert listed
        names |= set(re.sub(r"#.*", "", listed[1]).split())
    return names


def test_every_import_has_a_provider():
    assert foreign_imports() - set(INDIRECT) == {*DIRECT, *FROM_PYPI} - set(INDIRECT)


def test_every_provider_is_in_the_package_list():
    listed = environment_packages("packages", "tool_packages")
    assert {*DIRECT.values(), *INDIRECT.values()} <= listed
    for name, file in FROM_PYPI.items():
        assert name in (ROOT / file).read_text(encoding="utf-8").lower()


def test_what_cases_import_is_in_the_smaller_of_both_trees():
    providers = DIRECT | INDIRECT
    imported = foreign_imports(*PACKAGES) - set(FROM_PYPI)
    assert {providers[name] for name in imported} <= environment_packages("packages")


def test_the_environment_has_all_outside_the_home_folder():
    for name in {*DIRECT, *INDIRECT}:
        spec = find_spec(name)
        assert spec, name
        assert not Path(spec.origin or Path.home()).is_relative_to(Path.home()), name


def names_of(requirements: list[str]) -> set[str]:
    """Names of distributions without their versions."""
    return {re.split("[<>=]", requirement.replace("-", "_"))[0] for requirement in requirements}


def test_pip_brings_what_the_packages_import():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    assert set(EXTRAS) == set(extras) - {"test"}
    for extra, libraries in EXTRAS.items():
        wheels = {IN_WHEELS.get(library, library).replace("-", "_") for library in libraries}
        assert wheels == names_of(extras[extra]), extra
    always = names_of(project["dependencies"])
    assert foreign_imports(*PACKAGES) <= always.union(*EXTRAS.values())
