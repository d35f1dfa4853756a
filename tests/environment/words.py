"""Words of the project that a person reads: ``python -m tests.environment.words`` prints the worst.

It measures the sentences of README, docs and messages, the names of functions and variables, and
the first words of docstrings.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from statistics import median

from tests.environment.house import ROOT, package_files, written_docs

LONGEST, MEDIAN = 35, 15
VAGUE = ("found", "told", "asked", "wanted", "given", "handed")
FIRST = ("What", "Whether", "That", "Where")
ERRORS = ("RefusedError", "FailedError")
FENCE = re.compile(r"^(```|:::).*?^\1", re.MULTILINE | re.DOTALL)
MATHS = re.compile(r"\$\$.*?\$\$|\$[^$]*\$|`[^`]*`|\]\([^)]*\)", re.DOTALL)
SKIPPED = ("|", "#", "    ", "<", "!", "(", "+++", "---")


def paragraphs(markdown: str) -> Iterator[str]:
    """Paragraphs and list items of a page as one line each; no code, tables, heads or formulas."""
    text = FENCE.sub("\n\n", re.sub(r"\A---\n.*?\n---\n", "", markdown, flags=re.DOTALL))
    text = re.sub(r"^(?:[-*]|\d+\.) ", "\n\n", text, flags=re.MULTILINE)
    for block in re.split(r"\n\s*\n", text):
        rows = [row for row in block.splitlines() if row and not row.startswith(SKIPPED)]
        if rows:
            yield MATHS.sub("x", " ".join(row.strip() for row in rows))


def sentences(paragraph: str) -> list[str]:
    """Sentences of a paragraph; a colon or a full stop before a capital ends one."""
    return [part for part in re.split(r"(?<=[.!?:;])\s+(?=[A-ZΑ-Ω`x\"])", paragraph) if part]


def words(sentence: str) -> int:
    """Number of words with a letter."""
    return sum(any(letter.isalpha() for letter in word) for word in sentence.split())


def messages(tree: ast.AST) -> Iterator[str]:
    """Texts of the errors that a file raises; what is put into them counts as one word."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ERRORS:
            for argument in node.args:
                if isinstance(argument, ast.JoinedStr):
                    yield "".join(
                        getattr(part, "value", "x") if isinstance(part, ast.Constant) else "x"
                        for part in argument.values
                    )
                elif isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield argument.value


def every_sentence() -> list[tuple[int, str, str]]:
    """Words, place and text of each sentence of the documentation and the messages."""
    rows = [
        (str(page.relative_to(ROOT)), sentence)
        for page in written_docs()
        for paragraph in paragraphs(page.read_text(encoding="utf-8"))
        for sentence in sentences(paragraph)
    ]
    rows += [
        (str(file.relative_to(ROOT)), sentence)
        for file in package_files()
        for message in messages(ast.parse(file.read_text(encoding="utf-8")))
        for sentence in sentences(message)
    ]
    return sorted(((words(text), place, text) for place, text in rows), reverse=True)


def vague_names(tree: ast.AST) -> list[str]:
    """Names of functions, arguments and variables that begin with one of `VAGUE`."""
    names = []
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            names.append(node.name)
        elif isinstance(node, ast.arg):
            names.append(node.arg)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names.append(node.id)
    return [name for name in names if name.lstrip("_").split("_")[0] in VAGUE]


def odd_docstrings(tree: ast.AST) -> list[str]:
    """First lines of docstrings that begin with one of `FIRST`."""
    kinds = (ast.FunctionDef, ast.ClassDef, ast.Module)
    texts = [ast.get_docstring(node) or "" for node in ast.walk(tree) if isinstance(node, kinds)]
    return [text.splitlines()[0] for text in texts if text.split()[:1] and text.split()[0] in FIRST]


def in_packages(of: object) -> dict[str, list[str]]:
    """What a function of a syntax tree returns for each file of the packages, if anything."""
    assert callable(of)
    every = {
        str(file.relative_to(ROOT)): of(ast.parse(file.read_text(encoding="utf-8")))
        for file in package_files()
    }
    return {file: names for file, names in every.items() if names}


def long_pages() -> dict[str, int]:
    """Lines of the pages that are too long: README 130, CHANGELOG 80, any other 150."""
    limits = {"README.md": 130, "CHANGELOG.md": 80}
    counts = {page: len(page.read_text(encoding="utf-8").splitlines()) for page in written_docs()}
    return {p.name: n for p, n in counts.items() if n > limits.get(p.name, 150)}


def main() -> None:
    """Print the longest sentences, the median, and every vague name and odd docstring."""
    rows = every_sentence()
    for count, place, text in rows[:20]:
        print(f"{count:3} words, {place}: {text}")
    print(f"{len(rows)} sentences, median {median(row[0] for row in rows):g} words")
    print("pages too long:", long_pages())
    for title, of in (("vague names", vague_names), ("odd docstrings", odd_docstrings)):
        places = in_packages(of)
        print(f"{title}: {sum(map(len, places.values()))} in {len(places)} files")
        print("\n".join(f"  {file}: {', '.join(sorted(set(n)))}" for file, n in places.items()))


if __name__ == "__main__":
    main()
