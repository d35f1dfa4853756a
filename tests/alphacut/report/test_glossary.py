"""Every word on the nature of bounds that a module gives is explained in the glossary."""

import ast
from collections.abc import Iterator
from pathlib import Path

from alphacut.fuzzy.result import Nature
from alphacut.report.glossary import TERMS

ROOT = Path(__file__).parents[3]
WORDS = (ast.Constant, ast.Name, ast.IfExp)


def texts_of(node: ast.AST, constants: dict[str, ast.expr]) -> Iterator[str]:
    """Strings in an expression, those behind names of the module included."""
    for part in ast.walk(node):
        if isinstance(part, ast.Constant) and isinstance(part.value, str):
            yield part.value
        elif isinstance(part, ast.Name) and part.id in constants:
            yield from texts_of(constants[part.id], {})


def natures_of(tree: ast.Module) -> Iterator[str]:
    """Strings that a module gives as natures: keywords, keys, names and answers of functions."""
    constants = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    given: list[tuple[str, ast.AST]] = []
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword):
            given.append((node.arg or "", node.value))
        elif isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
            given.append((node.targets[0].id, node.value))
        elif isinstance(node, ast.Dict):
            names = [str(getattr(key, "value", "")) for key in node.keys]
            given += zip(names, node.values, strict=True)
        elif isinstance(node, ast.FunctionDef):
            returned = [x.value for x in ast.walk(node) if isinstance(x, ast.Return) and x.value]
            given += [(node.name, x) for x in returned if not isinstance(x, ast.Call)]
    for name, value in given:
        if name.strip("_") not in ("nature", "NATURE") or not isinstance(value, WORDS):
            continue
        for one in (value.body, value.orelse) if isinstance(value, ast.IfExp) else (value,):
            yield from texts_of(one, constants)


def test_every_nature_that_can_be_printed_is_in_the_glossary():
    terms = {name.lower() for name in TERMS}
    assert {nature.value for nature in Nature} <= terms
    told = set[str]()
    for package in ("stochastic", "rve", "fuzzy", "frame", "alphacut"):
        for file in (ROOT / package).rglob("*.py"):
            told |= set(natures_of(ast.parse(file.read_text(encoding="utf-8"))))
    assert {"searched", "verified by sampling", "guaranteed enclosure"} <= told
    unknown = {text for text in told if not text.lower().startswith(tuple(terms))}
    assert unknown == set()
