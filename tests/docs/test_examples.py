"""Examples in the docstrings of public names run, and every public name has one."""

import doctest
import importlib
import inspect

import pytest

PACKAGES = ("alphacut.fuzzy", "alphacut.stochastic")
NAMES = [
    (package, name) for package in PACKAGES for name in importlib.import_module(package).__all__
]


@pytest.mark.parametrize(("package", "name"), NAMES, ids=[name for _, name in NAMES])
def test_the_example_of_a_public_name_runs(package, name):
    value = getattr(importlib.import_module(package), name)
    names = vars(inspect.getmodule(value))
    examples = [
        test
        for test in doctest.DocTestFinder(recurse=False).find(value, name, globs=dict(names))
        if test.examples
    ]
    assert examples, f"{package}.{name} has no example"
    for test in examples:
        said = []
        result = doctest.DocTestRunner().run(test, out=said.append)
        assert not result.failed, "".join(said)
