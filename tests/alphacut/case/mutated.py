"""Cases with one thing changed at random: wrong kinds, signs, sizes, units, keys, or torn text."""

from __future__ import annotations

import re
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

CASES = Path(__file__).parents[3] / "cases"
NAMES = tuple(sorted(path.stem for path in CASES.glob("*.toml")))
ASSIGNED = re.compile(r"^([A-Za-z_]\w*)\s*=\s*(.+?)\s*(?:#.*)?$", re.MULTILINE)
NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e-?\d+)?(?![\w.])")
NONSENSE = ("nan", "inf", "-inf", "[]", '""', "{}", '"banana"', "1979-05-27", "[[1, 2], [3]]")
"""Values that no key takes."""
SIZES = ("1e300", "-1e300", "1e-300", "1000000000000000000000000000000")
UNITS = ("GPa", "kg", "m", "s", "N s/m", "K", "parsec", "%")


@dataclass(frozen=True)
class Mutation:
    """A changed case.

    Args:
        words: What was changed, for messages.
        text: The case.
        wrong: Whether no program may accept it.
    """

    words: str
    text: str
    wrong: bool


def mutation(rng: np.random.Generator) -> Mutation:
    """One change of one shipped case."""
    name = str(rng.choice(NAMES))
    text = (CASES / f"{name}.toml").read_text(encoding="utf-8")
    kinds = (nonsense, nonsense, scaled, scaled, negated, other_unit, renamed, torn, doubled, gone)
    changed = kinds[rng.integers(len(kinds))](text, rng)
    return Mutation(f"{name}: {changed.words}", changed.text, changed.wrong)


CELLS = ("nan", "inf", "", "banana", "1e300", "-1", "0", "1;2", "0,5", "\u2212", "1 m", '"')
"""What may stand in one cell of a table."""


def torn_table(text: str, rng: np.random.Generator) -> str:
    """A table with one cell, line or separator changed."""
    lines = text.splitlines()
    row = int(rng.integers(len(lines)))
    kind = rng.integers(5)
    if kind == 0:
        del lines[row]
    elif kind == 1:
        lines.insert(row, lines[row])
    elif kind == 2:
        lines = lines[:row]
    elif kind == 3:
        lines[row] = lines[row].replace(",", str(rng.choice([";", "", ",,", "\t"])))
    else:
        cells = lines[row].split(",")
        cells[int(rng.integers(len(cells)))] = str(rng.choice(CELLS))
        lines[row] = ",".join(cells)
    return "\n".join(lines) + "\n"


def line_of(text: str, rng: np.random.Generator) -> re.Match[str]:
    """An assignment outside the title and the description."""
    found = [one for one in ASSIGNED.finditer(text) if not one[2].startswith('"""')]
    told = ("title", "about", "source", "schema")
    found = [one for one in found if one[1] not in told and parsed(one[0])]
    return found[rng.integers(len(found))]


def parsed(line: str) -> bool:
    try:
        tomllib.loads(line)
    except tomllib.TOMLDecodeError:
        return False
    return True


def put(text: str, at: re.Match[str], value: str, *, wrong: bool) -> Mutation:
    line = f"{at[1]} = {value}"
    return Mutation(line, text[: at.start()] + line + text[at.end() :], wrong)


def nonsense(text: str, rng: np.random.Generator) -> Mutation:
    """A value of a kind that the key cannot take."""
    at, value = line_of(text, rng), str(rng.choice(NONSENSE))
    free = value in ("[]", '""') or (value == '"banana"' and at[1] in FREE_TEXT)
    return put(text, at, value, wrong=not free)


FREE_TEXT = ("image", "file", "layout", "name")


def scaled(text: str, rng: np.random.Generator) -> Mutation:
    """One number of the value as no quantity of a structure is."""
    at = line_of(text, rng)
    numbers = list(NUMBER.finditer(at[2]))
    if not numbers:
        return nonsense(text, rng)
    one = numbers[rng.integers(len(numbers))]
    value = at[2][: one.start()] + str(rng.choice(SIZES)) + at[2][one.end() :]
    return put(text, at, value, wrong=False)


def negated(text: str, rng: np.random.Generator) -> Mutation:
    """All numbers of the value with the other sign."""
    at = line_of(text, rng)
    value = NUMBER.sub(lambda one: one[0][1:] if one[0].startswith("-") else f"-{one[0]}", at[2])
    return put(text, at, value, wrong=False)


def other_unit(text: str, rng: np.random.Generator) -> Mutation:
    """A quantity with a unit of another kind."""
    at = line_of(text, rng)
    found = re.search(r"(?<=[\d\]] )[A-Za-z%][\w %/^]*(?=\")", at[2])
    if found is None:
        return nonsense(text, rng)
    unit = str(rng.choice([unit for unit in UNITS if unit != found[0]]))
    value = at[2][: found.start()] + unit + at[2][found.end() :]
    return put(text, at, value, wrong=unit == "parsec")


def renamed(text: str, rng: np.random.Generator) -> Mutation:
    """A key with two letters swapped."""
    at = line_of(text, rng)
    name = at[1][0] + at[1][2:3] + at[1][1:2] + at[1][3:]
    name = name if name != at[1] else at[1] + "x"
    line = f"{name} = {at[2]}"
    return Mutation(line, text[: at.start()] + line + text[at.end() :], True)


def torn(text: str, rng: np.random.Generator) -> Mutation:
    """The file cut within a value."""
    at = line_of(text, rng)
    cut = at.end() - int(rng.integers(1, max(len(at[2]), 2)))
    return Mutation(f"cut after {text[cut - 10 : cut]!r}", text[:cut], False)


def doubled(text: str, rng: np.random.Generator) -> Mutation:
    """A line twice."""
    at = line_of(text, rng)
    return Mutation(f"{at[1]} twice", f"{text[: at.end()]}\n{at[0]}{text[at.end() :]}", True)


def gone(text: str, rng: np.random.Generator) -> Mutation:
    """A line left out."""
    at = line_of(text, rng)
    return Mutation(f"{at[1]} left out", text[: at.start()] + text[at.end() :], False)
