"""Examples in the docstrings of public names run, and every public name has one.

Constants have theirs in the docstring of their package.
"""

import doctest
import importlib
import inspect

import pytest

PACKAGES = ("alphacut.fuzzy", "alphacut.stochastic", "alphacut.rve", "alphacut.frame")
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
