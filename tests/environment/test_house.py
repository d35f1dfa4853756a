"""Checks of the house that a person need not read: public types, length of help.

Nothing is checked by assertions.
"""

import ast
import re

import pytest

from alphacut import main
from tests.environment.house import PACKAGES, files_in, tree

ANY = 19  # public functions with Any, for FEniCSx, Gmsh and keywords of Matplotlib


def uses_any(node: ast.expr | None) -> bool:
    return node is not None and any(
        isinstance(part, ast.Name) and part.id == "Any" for part in ast.walk(node)
    )


def signatures_with_any(module: ast.Module) -> list[str]:
    """Names of public functions and methods that take or give Any."""
    names = []
    for node in ast.walk(module):
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            args = node.args
            every = [*args.posonlyargs, *args.args, *args.kwonlyargs, args.vararg, args.kwarg]
            types = [argument.annotation for argument in every if argument]
            if any(map(uses_any, [*types, node.returns])):
                names.append(node.name)
    return names


def test_no_public_signature_has_any():
    assert sum(len(signatures_with_any(tree(file))) for file in files_in(*PACKAGES)) <= ANY


def test_help_fits_on_one_screen(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    lines = {}
    waiting = [()]
    while waiting:
        words = waiting.pop()
        with pytest.raises(SystemExit):
            main([*words, "--help"])
        shown = capsys.readouterr().out
        lines[words] = len(shown.splitlines())
        if not words:
            waiting += [(name,) for name in re.findall(r"^    (\w+) ", shown, re.MULTILINE)]
    assert len(lines) > 5
    assert not {words: count for words, count in lines.items() if count > 40}


def test_assertions_only_tell_mypy_a_type():
    for file in files_in(*PACKAGES):
        for node in filter(lambda x: isinstance(x, ast.Assert), ast.walk(tree(file))):
            text = ast.unparse(node.test)
            assert text.endswith("is not None") or text.startswith("isinstance("), (file, text)
