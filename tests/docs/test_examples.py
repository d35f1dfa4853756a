"""Examples in the docstrings of public names run; each package has some; demos use these names.

Constants have theirs in the docstring of their package.
"""

import ast
import doctest
import importlib
import inspect
from pathlib import Path

import pytest

PACKAGES = ("alphacut.fuzzy", "alphacut.stochastic", "alphacut.rve", "alphacut.frame")
DEMOS = Path(__file__).parents[2] / "demos"
NAMES = [
    (package, name) for package in PACKAGES for name in importlib.import_module(package).__all__
]


def examples_of(value, name):
    """Examples in the docstring of a value, with the names of its module."""
    home = value if inspect.ismodule(value) else inspect.getmodule(value)
    names = vars(home) if home else {}
    found = doctest.DocTestFinder(recurse=False).find(value, name, globs=dict(names))
    return [test for test in found if test.examples]


@pytest.mark.parametrize(("package", "name"), NAMES, ids=[name for _, name in NAMES])
def test_the_example_of_a_public_name_runs(package, name):
    module = importlib.import_module(package)
    value = getattr(module, name)
    is_constant = not hasattr(value, "__module__")
    examples = examples_of(module if is_constant else value, name)
    for test in examples:
        said = []
        result = doctest.DocTestRunner().run(test, out=said.append)
        assert not result.failed, "".join(said)


@pytest.mark.parametrize("package", PACKAGES)
def test_the_examples_of_a_package_show_how_it_is_used(package):
    module = importlib.import_module(package)
    shown = [name for name in module.__all__ if examples_of(getattr(module, name), name)]
    assert len(shown) >= 4


@pytest.mark.parametrize("demo", sorted(DEMOS.glob("*.py")), ids=lambda path: path.stem)
def test_demos_import_public_names_only(demo):
    tree = ast.parse(demo.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("alphacut"):
            public = importlib.import_module(node.module).__all__
            assert {alias.name for alias in node.names} <= set(public), ast.unparse(node)
