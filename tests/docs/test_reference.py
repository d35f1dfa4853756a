"""Public names have an entry in the built reference, and stand in `dir()` and tab completion."""

import ast
import importlib
import rlcompleter
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGES = ("alphacut", "alphacut.fuzzy", "alphacut.stochastic", "alphacut.rve", "alphacut.frame")
DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_are_listed_and_completed(package):
    module = importlib.import_module(package)
    assert set(module.__all__) <= set(dir(module))
    completer = rlcompleter.Completer({"module": module})
    for name in module.__all__:
        assert completer.complete(f"module.{name}", 0).startswith(f"module.{name}")


@pytest.mark.parametrize("package", PACKAGES)
def test_a_name_is_public_where_it_is_imported_and_says_its_module(package):
    module = importlib.import_module(package)
    names = {}  # of the imports: all, and those for type checkers alone, with their modules
    for node in ast.walk(ast.parse(Path(module.__file__).read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and not node.module.endswith("first_use"):
            names |= {alias.name: node.module.removeprefix(f"{package}.") for alias in node.names}
    names.pop("TYPE_CHECKING")
    assert sorted(names) == sorted(module.__all__)
    assert module.AT_FIRST_USE.items() <= names.items()
    assert all(hasattr(module, name) for name in names)


def test_names_are_listed_without_importing_them():
    program = (
        "import sys, alphacut.rve; dir(alphacut.rve); print('alphacut.rve.prism' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], check=True, capture_output=True, text=True
    )
    assert done.stdout == "False\n"


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """Return the folder of the reference pages, built without the other pages."""
    target = tmp_path_factory.mktemp("reference")
    others = "conf.py,**/__pycache__,demos/*,howto/*,theory/*,*.md"
    settings = ["-D", f"exclude_patterns={others}", "-D", "root_doc=reference/index"]
    subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", *settings, str(DOCS), str(target)], check=True
    )
    return target / "reference"


@pytest.mark.slow
@pytest.mark.parametrize("package", PACKAGES)
def test_each_public_name_has_an_entry_in_the_built_reference(reference, package):
    page = (reference / f"{package.rpartition('.')[2]}.html").read_text(encoding="utf-8")
    missing = [
        name
        for name in importlib.import_module(package).__all__
        if f'id="{package}.{name}"' not in page
    ]
    assert not missing
    assert "float64" not in page  # types of arrays have a short name
