"""Checks of the house that a person need not read: public types and the length of help."""

import argparse
import ast
import os

from tests.environment import house

ANY = 18  # public functions with Any, for FEniCSx, Gmsh and keywords of Matplotlib
TREES = {file: ast.parse(file.read_text(encoding="utf-8")) for file in house.package_files()}


def uses_any(node: ast.expr | None) -> bool:
    return node is not None and any(
        isinstance(part, ast.Name) and part.id == "Any" for part in ast.walk(node)
    )


def signatures_with_any(tree: ast.Module) -> list[str]:
    """Names of public functions and methods that take or give Any."""
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            args = node.args
            every = [*args.posonlyargs, *args.args, *args.kwonlyargs, args.vararg, args.kwarg]
            types = [argument.annotation for argument in every if argument]
            if any(map(uses_any, [*types, node.returns])):
                names.append(node.name)
    return names


def test_no_public_signature_has_any():
    assert sum(len(signatures_with_any(tree)) for tree in TREES.values()) <= ANY


def test_what_the_counts_look_for_would_be_seen():
    assert signatures_with_any(ast.parse("def f(x: dict[str, Any]) -> int: ...")) == ["f"]
    raising = "raise ValueError(1)\nraise\nInputProblem('a')\nrequire(x)\n"
    assert house.raising(ast.parse(raising)) == 3


def test_help_fits_on_one_screen():
    from alphacut.entry import COMMANDS, parsers

    os.environ["COLUMNS"] = "80"
    whole, each = parsers("alphacut", COMMANDS)
    pages: dict[str, argparse.ArgumentParser] = {"alphacut": whole, **each}
    lines = {name: len(parser.format_help().splitlines()) for name, parser in pages.items()}
    assert not {name: count for name, count in lines.items() if count > 40}
