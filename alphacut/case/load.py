"""A case, from TOML text and changes of it; every problem is reported at once, by its key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from alphacut.case.content import Content
from alphacut.case.keys import every_key, sections
from alphacut.fuzzy.refused import RefusedError, printable, require
from alphacut.io.problem import BadInput, InputProblem, nearest, suggestion
from alphacut.stochastic.particles.csv_columns import text_of

KINDS = {
    "tuple_type": "an array",
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "dict_type": "a table",
    "model_type": "a section",
    "model_attributes_type": "a section",
}
"""What a key takes, by Pydantic's name of the error."""


@dataclass(frozen=True)
class Case:
    """A case that was read.

    Args:
        path: File that it comes from.
        text: The file as it stands.
        content: The sections of the file, built.
        changes: Changes from the command line, KEY=VALUE each.
    """

    path: Path
    text: str
    content: Content
    changes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The file's name without its ending: results go to results/NAME."""
        return self.path.stem


def load(path: Path | str, changes: Sequence[str] = ()) -> Case:
    """Reads a case file.

    Args:
        path: TOML file.
        changes: ``KEY=VALUE`` each, as ``cell.matrix_modulus=20 GPa``.

    Raises:
        BadInput: With every problem of the case.
    """
    path = Path(path)
    text = text_of(path)
    table = _parsed(path, text)
    changed = apply_changes(table, changes)
    try:
        content = Content.model_validate(table, context={"folder": path.parent})
    except ValidationError as error:
        files = {True: "command line", False: str(path)}
        problems = [replace(x, file=files[_is_below(x.key, changed)]) for x in _problems(error)]
        raise BadInput([*dict.fromkeys(problems)]) from None
    return Case(path, text, content, tuple(changes))


def _parsed(path: Path, text: str) -> dict[str, object]:
    """The table of a TOML text; the file and line of what is no TOML are told."""
    try:
        return tomllib.loads(text.replace("\r\n", "\n"))
    except (RecursionError, ValueError) as error:  # of an integer too long, without a line
        where = re.search(r"\(at line (\d+), column \d+\)", str(error))
        line, lines = int(where[1]) if where else 0, text.splitlines()
        shown = lines[line - 1].strip() if 0 < line <= len(lines) else ""
        what = f"is not TOML: {str(error).partition(' (at')[0].lower()}"
        raise BadInput(InputProblem(shown or "the file", what, file=str(path), line=line)) from None


def _problems(error: ValidationError) -> Iterator[InputProblem]:
    """The problem of each error that Pydantic reports; what is misspelt is not missing too."""
    details = [(_key(entry["loc"]), entry) for entry in error.errors(include_url=False)]
    extra = {
        key: _suggested_key(key) for key, entry in details if entry["type"] == "extra_forbidden"
    }
    for key, detail in details:
        if key in extra:
            kind = "section" if isinstance(detail["input"], dict) else "key"
            close = extra[key].removeprefix(f"{_section(key)}.")
            names = ", ".join(_names(key))
            cure = f"did you mean {close}?" if close else ""
            yield InputProblem(key, f"is an unknown {kind}", "", "" if close else names, cure)
        elif key not in extra.values():
            yield _problem(key, detail)


def _section(key: str) -> str:
    return key.rpartition(".")[0]


def _names(key: str) -> list[str]:
    """Keys and sections beside a key."""
    inside = re.sub(r"\[\d+\]", "", _section(key))
    names = (*every_key(), *sections())
    return [name.rpartition(".")[2] for name in names if name and _section(name) == inside]


def _suggested_key(key: str) -> str:
    """Full name of the known key that comes nearest to one that is not; empty where none does."""
    name = key.rpartition(".")[2]
    if close := nearest(name, _names(key)):
        return f"{_section(key)}.{close}".lstrip(".")
    elsewhere = {x.rpartition(".")[2]: x for x in every_key()}
    return elsewhere.get(nearest(name, elsewhere), "")


def _problem(key: str, detail: ErrorDetails) -> InputProblem:
    """What is wrong with the value of a key, which may be missing, and what is allowed."""
    cause = detail.get("ctx", {}).get("error")
    if isinstance(cause, RefusedError):
        return replace(InputProblem.from_error(cause), key=cause.key or key)
    what, value, cure = "", _written(detail["input"]), ""
    allowed = str(cause or KINDS.get(detail["type"], detail["msg"]))
    if detail["type"] == "missing":
        about = every_key().get(re.sub(r"\[\d+\]", "", key))
        what, value, allowed = "is missing", "", (about and about.description) or "a section"
    if detail["type"] == "literal_error":
        allowed = str(detail["ctx"]["expected"]).replace("'", '"')
        cure = suggestion(str(detail["input"]), re.findall(r'"([^"]+)"', allowed))
    return InputProblem(key, what, value, allowed, cure)


def _key(location: tuple[int | str, ...]) -> str:
    """Full name of a key, without the tags of unions, which stand in angle brackets."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(part for part in parts if not part.startswith(".<")).lstrip(".")


def _written(value: object) -> str:
    """A value as it stood in the file, near enough."""
    return f'"{value}"' if isinstance(value, str) else printable(value).replace("'", '"')


def _is_below(key: str, changed: Sequence[str]) -> bool:
    """True for a changed key, one of its entries, or a key of its table."""
    return any(re.match(rf"{re.escape(name)}(?![\w-])", key) for name in changed)


def apply_changes(table: dict[str, object], changes: Sequence[str]) -> tuple[str, ...]:
    """Puts every change into the table of a case; returns the keys.

    Raises:
        RefusedError: A key is unknown, or changed twice.
    """
    full_keys = [key for key in every_key() if not key.startswith("study.")]
    keys: list[str] = []
    for change in changes:
        key, _, value = (part.strip() for part in change.partition("="))
        alike = (f"did you mean {full}?" for full in full_keys if full.endswith(f".{key}"))
        cure = next(alike, suggestion(key, full_keys))
        allowed = "KEY=VALUE, each full key once, as cell.matrix_modulus='20 GPa'"
        require(
            key in full_keys and key not in keys, "--set", value=change, allowed=allowed, cure=cure
        )
        _put(table, key, _value(value))
        keys.append(key)
    return tuple(keys)


def _put(table: object, key: str, value: object) -> None:
    *outer, last = key.split(".")
    for name in outer:
        table = table.setdefault(name, {}) if isinstance(table, dict) else None
    if isinstance(table, dict):
        table[last] = value


def _value(text: str) -> object:
    """Value of a change: TOML where it is TOML, names with commas as an array, else text."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except (RecursionError, ValueError):
        pass
    if re.fullmatch(r"[\w .+-]+(,[\w .+-]+)+", text):
        return [_value(part.strip()) for part in text.split(",")]
    return text
