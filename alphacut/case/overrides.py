"""Changes of a case from the command line: one key and its new value each."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from typing import Any

from alphacut.case.key import Key, keys_of
from alphacut.case.schema import SECTIONS, every_key
from alphacut.case.values import nearest
from alphacut.io.problem import BadInput, Problem
from alphacut.io.quantity import NUMBER

Raw = dict[str, Any]
ARRAY = r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]"  # whose first bracket its last one closes
COMMA = r",(?![^\[]*\])"  # between quantities, not within one such as [1, 2, 3] t
ARRAYS = ("fuzzy list", "numbers", "choices")  # kinds of keys that hold arrays


def apply_changes(raw: Raw, changes: Sequence[str]) -> dict[str, str]:
    """Put every change into the tree; returns the keys' full names with their changes.

    Raises:
        BadInput: A key is unknown, or changed twice.
    """
    made: dict[str, str] = {}
    for change in changes:
        key = apply_change(raw, change)
        if key in made:
            raise BadInput.of(
                key, f"changed twice: {made[key]} and {change}", allowed="one of them"
            )
        made[key] = change
    return made


def apply_change(raw: Raw, change: str) -> str:
    """Put one ``KEY=VALUE`` into the tree; returns the key's full name."""
    name, equals, value = change.partition("=")
    name = name.strip().replace("-", "_")
    known = every_key()
    full = [name] if name in known else [key for key in known if key.rpartition(".")[2] == name]
    _require_sense(name, equals, change)
    if not full:
        raise BadInput(no_key(name, change, raw))
    place = _place(raw, full)
    if place is None:
        raise BadInput.of(
            "--set", f"the key {name} is not clear", change, "one of " + ", ".join(full)
        )
    section, _, key = place.rpartition(".")
    table = table_of(raw, section, make=True)
    if table is not None:
        table[key] = toml_or_text(value.strip(), known[place])
    return place


def _require_sense(name: str, equals: str, change: str) -> None:
    if not equals:
        raise BadInput.of(
            "--set",
            "there is no = in it",
            change,
            "KEY=VALUE, for example cell.matrix_modulus='20 GPa'",
        )
    if re.match(r"study\b", name):
        raise BadInput.of(
            "--set", "a [[study]] is changed in the case file", change, "keys of the other sections"
        )


def _place(raw: Raw, full: Sequence[str]) -> str | None:
    """The one key meant: of several with the name, the one that the case has already."""

    def given(key: str) -> bool:
        section, _, last = key.rpartition(".")
        return last in (table_of(raw, section) or {})

    present = [key for key in full if len(full) == 1 or given(key)]
    present = [key for key in present if not key.startswith("study.")]
    return present[0] if len(present) == 1 else None


def no_key(name: str, change: str, raw: Raw) -> Problem:
    """The problem of a change of what is no key: nothing at all, a section, a misspelling."""
    if not name:
        return Problem("--set", "there is no key before the =", change, "any key of the case")
    if name in SECTIONS:
        return Problem(
            "--set",
            f"{name} is a section",
            change,
            ", ".join(f"{name}.{key}" for key in keys_of(SECTIONS[name])),
        )
    # keys of the case's own sections come first
    here = [key for key in every_key() if table_of(raw, key.rpartition(".")[0]) is not None]
    return Problem(
        "--set",
        f"there is no key {name}",
        change,
        "any key of the case",
        nearest(name, here) or nearest(name, every_key()),
    )


def table_of(raw: Raw, section: str, *, make: bool = False) -> Raw | None:
    """Table of a section, ``microstructure.packing`` for a nested one, or None."""
    table: Any = raw
    for name in section.split(".") if section else ():
        if name not in table and make:
            table[name] = {}
        table = table.get(name)
        if not isinstance(table, dict):
            return None
    return table  # type: ignore[no-any-return]


def toml_or_text(value: str, key: Key) -> object:
    """Value from a command line: TOML where it is TOML, else text or an array, ``E,m``."""
    try:
        found = tomllib.loads(f"x = {value}")["x"]
    except tomllib.TOMLDecodeError:
        # .3 and 3. are no TOML
        found = float(value) if re.fullmatch(r"[+-]?(\d+\.|\.\d+)([eE][+-]?\d+)?", value) else value
    inner = found if isinstance(found, str) else value.strip()
    inner = inner[1:-1] if re.fullmatch(ARRAY, inner) else inner
    items = [item.strip() for item in re.split(COMMA, inner) if item.strip()]
    one_for_all = key.alone and len(items) < 2
    if key.kind in ARRAYS and not isinstance(found, list) and not one_for_all:
        plain = key.kind == "numbers" and not key.unit
        return [float(item) if plain and re.fullmatch(NUMBER, item) else item for item in items]
    return str(found) if key.kind == "text" else found
