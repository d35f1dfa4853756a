"""Changes of a case from the command line: one key and its new value each."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from typing import Any

from alphacut.case.keys import every_key
from alphacut.fuzzy.refused import RefusedError
from alphacut.io.problem import suggestion

Table = dict[str, Any]


def apply_changes(table: Table, changes: Sequence[str]) -> tuple[str, ...]:
    """Puts every change into the table of a case; returns the keys' full names.

    Raises:
        RefusedError: A key is unknown, or changed twice.
    """
    names: list[str] = []
    for change in changes:
        name, equals, value = change.partition("=")
        if not equals:
            raise RefusedError("--set", change, "KEY=VALUE, as cell.matrix_modulus='20 GPa'")
        full = _full_name(name.strip().replace("-", "_"), table)
        if full in names:
            raise RefusedError("--set", change, "each key once")
        _put(table, full, _value(value.strip()))
        names.append(full)
    return tuple(names)


def _full_name(name: str, table: Table) -> str:
    """The one key of a name: of several, the one that the case has already."""
    known = [key for key in every_key() if not key.startswith("study.")]
    full = [name] if name in known else [key for key in known if key.rpartition(".")[2] == name]
    if len(full) > 1:
        full = [key for key in full if _has(table, key)]
    if len(full) != 1:
        near = suggestion(name, [x.rpartition(".")[2] for x in known]) or suggestion(name, known)
        raise RefusedError("--set", name, "the full name of a key", near)
    return full[0]


def _has(table: Table, key: str) -> bool:
    for name in key.split("."):
        if not isinstance(table, dict) or name not in table:
            return False
        table = table[name]
    return True


def _put(table: Table, key: str, value: object) -> None:
    *outer, last = key.split(".")
    for name in outer:
        table = table.setdefault(name, {})
        if not isinstance(table, dict):
            return
    table[last] = value


def _value(text: str) -> object:
    """Value of a change: TOML where it is TOML, names with commas as an array, else text."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except RecursionError:
        raise RefusedError("--set", text, "a value", "it is nested too deeply") from None
    except tomllib.TOMLDecodeError:
        pass
    if re.fullmatch(r"[\w .+-]+(,[\w .+-]+)+", text):
        return [_value(part.strip()) for part in text.split(",")]
    return text
