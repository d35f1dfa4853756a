"""Examples in the docstrings of public names run; every public name has one; demos use these.

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
    names = vars(value if inspect.ismodule(value) else inspect.getmodule(value))
    found = doctest.DocTestFinder(recurse=False).find(value, name, globs=dict(names))
    return [test for test in found if test.examples]


@pytest.mark.parametrize(("package", "name"), NAMES, ids=[name for _, name in NAMES])
def test_the_example_of_a_public_name_runs(package, name):
    module = importlib.import_module(package)
    value = getattr(module, name)
    is_constant = not hasattr(value, "__module__")
    examples = examples_of(module if is_constant else value, name)
    sources = [example.source for test in examples for example in test.examples]
    assert sources, f"{package}.{name} has no example"
    assert not is_constant or any(name in source for source in sources)
    for test in examples:
        said = []
        result = doctest.DocTestRunner().run(test, out=said.append)
        assert not result.failed, "".join(said)


@pytest.mark.parametrize("demo", sorted(DEMOS.glob("*.py")), ids=lambda path: path.stem)
def test_demos_import_public_names_only(demo):
    tree = ast.parse(demo.read_text(encoding="utf-8"))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("alphacut"):
            public = importlib.import_module(node.module).__all__
            assert {alias.name for alias in node.names} <= set(public), ast.unparse(node)
