"""Checks of the house that a person need not read: public types, kinds, imports, length of help.

No kind is compared by identity, as a worker has copies; nothing is checked by assertions.
"""

import argparse
import ast
import os
from collections.abc import Iterator
from functools import cache
from itertools import pairwise

from tests.environment.house import PACKAGES, ROOT, files_in, trees

ANY = 18  # public functions with Any, for FEniCSx, Gmsh and keywords of Matplotlib


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
    assert sum(len(signatures_with_any(trees()[file])) for file in files_in(*PACKAGES)) <= ANY


def test_a_signature_with_any_would_be_seen():
    assert signatures_with_any(ast.parse("def f(x: dict[str, Any]) -> int: ...")) == ["f"]


def test_help_fits_on_one_screen():
    from alphacut.entry import COMMANDS, build_parsers

    os.environ["COLUMNS"] = "80"
    whole, each = build_parsers("alphacut", COMMANDS)
    pages: dict[str, argparse.ArgumentParser] = {"alphacut": whole, **each}
    lines = {name: len(parser.format_help().splitlines()) for name, parser in pages.items()}
    assert not {name: count for name, count in lines.items() if count > 40}


def program_trees() -> dict[str, ast.Module]:
    """Syntax trees of all files but tests and pages, by their names."""
    names = {file.relative_to(ROOT).as_posix(): tree for file, tree in trees().items()}
    return {name: x for name, x in names.items() if not name.startswith(("tests/", "docs/"))}


@cache
def enumerations() -> set[str]:
    """Names of the classes of the packages whose members are one object each."""
    classes = (x for file in files_in(*PACKAGES) for x in trees()[file].body)
    return {
        node.name
        for node in classes
        if isinstance(node, ast.ClassDef) and any("Enum" in ast.unparse(x) for x in node.bases)
    }


def is_unique(node: ast.expr) -> bool:
    """Whether a process has one object of this value, as of None and members of enumerations."""
    if isinstance(node, ast.Attribute):
        return isinstance(node.value, ast.Name) and node.value.id in enumerations()
    return isinstance(node, ast.Constant)


def identities(tree: ast.Module) -> Iterator[str]:
    """Comparisons by `is` of attributes and constants, whose values a copy does not share."""
    for node in ast.walk(tree):
        if not isinstance(node, ast.Compare):
            continue
        sides = [node.left, *node.comparators]
        for operator, pair in zip(node.ops, pairwise(sides), strict=True):
            by_identity = isinstance(operator, ast.Is | ast.IsNot)
            copied = [isinstance(x, ast.Attribute) or getattr(x, "id", "").isupper() for x in pair]
            if by_identity and any(copied) and not any(map(is_unique, pair)):
                yield ast.unparse(node)


def test_kinds_are_compared_by_value():
    found = {file: list(identities(tree)) for file, tree in program_trees().items()}
    assert not {file: places for file, places in found.items() if places}


def test_assertions_only_tell_mypy_a_type():
    for file in files_in(*PACKAGES):
        for node in filter(lambda x: isinstance(x, ast.Assert), ast.walk(trees()[file])):
            text = ast.unparse(node.test)
            assert text.endswith("is not None") or text.startswith("isinstance("), (file, text)


def test_a_comparison_by_identity_would_be_seen():
    assert "Nature" in enumerations()
    assert len(program_trees()) > 200
    lines = ("def f(): return shape is DISCS", "x is not BOX", "x.shape is y.shape")
    more = ("Nature.ATTAINED is x.nature", "a is None", "panel is axes")
    seen = set(identities(ast.parse("\n".join((*lines, *more)))))
    assert seen == {"shape is DISCS", "x is not BOX", "x.shape is y.shape"}


def test_all_imports_begin_with_alphacut():
    """Else a class exists twice, as a package can be reached by two paths in a checkout."""
    for file, tree in trees().items():
        for node in ast.walk(tree):
            names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                assert not node.level, file
                names.append(node.module or "")
            assert not {name.partition(".")[0] for name in names} & set(PACKAGES[:4]), file
