"""No kind is compared by identity, as a worker has copies; nothing is checked by assertions."""

import ast
from collections.abc import Iterator
from itertools import pairwise

from tests.environment.house import ROOT, package_files

FILES = [*package_files(), *(ROOT / "benchmarks").rglob("*.py"), *(ROOT / "demos").rglob("*.py")]
TREES = {file: ast.parse(file.read_text(encoding="utf-8")) for file in FILES}


def is_enumeration(node: ast.AST) -> bool:
    return isinstance(node, ast.ClassDef) and any("Enum" in ast.unparse(x) for x in node.bases)


ENUMERATIONS = {
    node.name for tree in TREES.values() for node in ast.walk(tree) if is_enumeration(node)
}


def module_names(tree: ast.Module) -> set[str]:
    """Names that a module binds at its top level: values, functions and imports."""
    names: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            names.add(node.name)
        elif isinstance(node, ast.Import | ast.ImportFrom):
            names |= {alias.asname or alias.name for alias in node.names}
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {x.id for y in targets for x in ast.walk(y) if isinstance(x, ast.Name)}
    return names


def is_unique(node: ast.expr) -> bool:
    """Whether a process has one object of this value, as of None and members of enumerations."""
    if isinstance(node, ast.Attribute):
        return isinstance(node.value, ast.Name) and node.value.id in ENUMERATIONS
    return isinstance(node, ast.Constant)


def identities(tree: ast.Module) -> Iterator[str]:
    """Comparisons by `is` of values that a copy does not share."""
    names = module_names(tree)
    for node in ast.walk(tree):
        if not isinstance(node, ast.Compare):
            continue
        sides = [node.left, *node.comparators]
        for operator, pair in zip(node.ops, pairwise(sides), strict=True):
            by_identity = isinstance(operator, ast.Is | ast.IsNot)
            copied = [isinstance(x, ast.Attribute) or getattr(x, "id", "") in names for x in pair]
            if by_identity and any(copied) and not any(map(is_unique, pair)):
                yield ast.unparse(node)


def test_kinds_are_compared_by_value():
    found = {file.relative_to(ROOT): list(identities(tree)) for file, tree in TREES.items()}
    assert not {file: places for file, places in found.items() if places}


def test_assertions_only_tell_mypy_a_type():
    for file in package_files():
        for node in filter(lambda x: isinstance(x, ast.Assert), ast.walk(TREES[file])):
            text = ast.unparse(node.test)
            assert text.endswith("is not None") or text.startswith("isinstance("), (file, text)


def test_a_comparison_by_identity_would_be_seen():
    assert "Nature" in ENUMERATIONS
    assert len(TREES) > 200
    lines = ("from m import DISCS", "BOX = object()", "def f(): return shape is DISCS")
    more = ("x is not BOX", "x.shape is y.shape", "Nature.ATTAINED is x.nature", "a is None")
    seen = set(identities(ast.parse("\n".join((*lines, *more)))))
    assert seen == {"shape is DISCS", "x is not BOX", "x.shape is y.shape"}
