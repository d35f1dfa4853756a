"""A case, from TOML text and changes of it; every problem is reported at once, by its key."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args

from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from alphacut.base.errors import RefusedError, cure_of, printable, require
from alphacut.case.types import Quantity, Section
from alphacut.io.files import BadInput, nearest, suggestion
from alphacut.stochastic.particles.csv_columns import text_of

KINDS = {
    "bool_type": "true or false",
    "string_type": "text in quotes",
    "dict_type": "a table",
    "model_type": "a section",
    "model_attributes_type": "a section",
}
"""What a key takes, by Pydantic's name of the error."""
C = TypeVar("C", bound=Section)
TOML_CURES = {
    r"=\s*[-+]?[\d.]+\s*[A-Za-z%°µμ±]": 'quantities stand in quotes, as "0.01 s"',
    r"=\s*(?!true|false|inf|nan)[A-Za-z]": 'texts stand in quotes, as "auto"',
}
"""Cure by a pattern in a line that is not TOML."""


@dataclass(frozen=True)
class ParsedCase(Generic[C]):
    """A case that was read; `changes` are those of the command line, KEY=VALUE each."""

    path: Path
    text: str
    content: C
    changes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """The file's name without its ending: results go to results/NAME."""
        return self.path.stem


def parse(model: type[C], path: Path | str, changes: Sequence[str] = ()) -> ParsedCase[C]:
    """Read a TOML case file as the content `model`, with changes ``KEY=VALUE``.

    Raises:
        BadInput: With every problem of the case.
    """
    path = Path(path)
    text = text_of(path)
    table = _parse_toml(path, text)
    changed = apply_changes(model, table, changes)
    try:
        content = model.model_validate(table, context={"folder": path.parent})
    except ValidationError as error:
        # Pydantic tries each member of a union, whose errors may be the same: each is told once.
        problems: dict[str, RefusedError] = {}
        for x in _refusals(model, error):
            place = "command line" if _is_below(x.key, changed) else str(path)
            problem = RefusedError(x.key, x.value, x.allowed, x.cure, place)
            problems[str(problem)] = problem
        raise BadInput(problems.values()) from None
    return ParsedCase(path, text, content, tuple(changes))


def _parse_toml(path: Path, text: str) -> dict[str, object]:
    """Return the top table of a TOML text.

    Raises:
        BadInput: The text is not TOML; it names the file and the line.
    """
    # tomllib calls itself for nested brackets, of which a text may have more than the stack holds
    try:
        return tomllib.loads(text)
    except (RecursionError, ValueError) as error:
        shown, place = "the file", str(path)
        # an integer of too many digits has no line
        if match := re.search(r"\(at line (\d+), column \d+\)", str(error)):
            place += f":{match[1]}"
            shown = text.splitlines()[int(match[1]) - 1].strip() or shown
        what = str(error).partition(" (at")[0].lower()
        cure = cure_of(shown, TOML_CURES)
        problem = RefusedError(shown, f"not TOML: {what}", "", cure, place)
        raise BadInput([problem]) from None


def _refusals(model: type[Section], error: ValidationError) -> Iterator[RefusedError]:
    """Yield what is wrong by each error of Pydantic; a misspelt key is not missing as well."""
    # A misspelt key is two errors of Pydantic: an unknown key, and the right one that is missing.
    details = [(_full_key(detail["loc"]), detail) for detail in error.errors(include_url=False)]
    unknown = [key for key, detail in details if detail["type"] == "extra_forbidden"]
    suggested = {key: _suggested_key(model, key) for key in unknown}
    for key, detail in details:
        if key in suggested:
            kind = "section" if isinstance(detail["input"], dict) else "key"
            close = suggested[key].removeprefix(f"{key.rpartition('.')[0]}.")
            if close:
                yield RefusedError(key, f"an unknown {kind}", "", f"did you mean {close}?")
            else:
                names = ", ".join(_sibling_names(model, key))
                yield RefusedError(key, f"an unknown {kind}", names)
        elif key not in suggested.values():
            yield _refusal(model, key, detail)


def _without_indices(key: str) -> str:
    """Return the name of a key without the numbers of its entries, as "study.name"."""
    return re.sub(r"\[\d+\]", "", key)


def _sibling_names(model: type[Section], key: str) -> list[str]:
    """Return the names of all keys of the section that a key stands in."""
    section, _, _ = _without_indices(key).rpartition(".")
    siblings: dict[str, None] = {}
    for full_name, _, _ in _walk_keys("", model):
        inside, _, name = full_name.rpartition(".")
        if inside == section:
            siblings[name] = None
    return list(siblings)


def _suggested_key(model: type[Section], key: str) -> str:
    """Return the full name of the known key nearest to an unknown one; empty if none is near."""
    section, dot, name = key.rpartition(".")
    if close := nearest(name, _sibling_names(model, key)):
        return f"{section}{dot}{close}"
    elsewhere = {x.rpartition(".")[2]: x for x in keys_of(model)}
    return elsewhere.get(nearest(name, elsewhere), "")


def _refusal(model: type[Section], key: str, detail: ErrorDetails) -> RefusedError:
    """Return what is wrong with a key whose value is wrong or missing, by the error of Pydantic."""
    context = detail.get("ctx", {})
    cause = context.get("error")
    kind = detail["type"]
    if isinstance(cause, RefusedError):
        return RefusedError(cause.key or key, cause.value, cause.allowed, cause.cure)
    if kind == "missing":
        about = keys_of(model).get(_without_indices(key))
        words = about.description if about is not None else None
        return RefusedError(key, None, words or "a section")
    given = detail["input"]  # as it stood in the file, near enough
    value = f'"{given}"' if isinstance(given, str) else printable(given).replace("'", '"')
    if kind == "literal_error":
        allowed = str(context["expected"]).replace("'", '"')
        names = re.findall(r'"([^"]+)"', allowed)
        return RefusedError(key, value, allowed, suggestion(str(given), names))
    if kind == "tuple_type":
        cure = f"write {key.rpartition('.')[2]} = [{value}]"
        return RefusedError(key, value, "an array", cure)
    return RefusedError(key, value, str(cause or KINDS.get(kind, detail["msg"])))


def _full_key(location: tuple[int | str, ...]) -> str:
    """Return the full name of a key from its place in Pydantic's errors.

    Entries are counted from 1, and the tags of unions, such as <image>, are left out.
    """
    key = ""
    for part in location:
        if isinstance(part, int):
            key += f"[{part + 1}]"
        elif not part.startswith("<"):
            key += f".{part}"
    return key.lstrip(".")


def _is_below(key: str, changed: Sequence[str]) -> bool:
    """Return whether a key was changed, or is an entry or a key of the table of one."""
    return any(re.match(rf"{re.escape(name)}(?![\w-])", key) for name in changed)


def apply_changes(
    model: type[Section], table: dict[str, object], changes: Sequence[str]
) -> tuple[str, ...]:
    """Put every change KEY=VALUE into the table of a case, in place, and return the keys.

    Raises:
        RefusedError: A change has no value, or its key is unknown or given before.
    """
    full_keys = [key for key in keys_of(model) if not key.startswith("study.")]
    keys: list[str] = []
    for change in changes:
        key, equals, value = [part.strip() for part in change.partition("=")]
        allowed = "KEY=VALUE with a full key, as cell.matrix_modulus='20 GPa'"
        # a key without its section is met by the section that has it
        if key not in full_keys:
            close = [full for full in full_keys if full.endswith(f".{key}")]
            cure = f"did you mean {close[0]}?" if close else suggestion(key, full_keys)
            cure = cure or "docs/case-format.md has all keys"
            raise RefusedError("--set", f"{change}, of an unknown key", allowed, cure)
        require(bool(equals), "--set", f"{change}, without a value", allowed)
        require(key not in keys, "--set", f"{change}, of a key given before", "each key once")
        _set_key(table, key, _parse_value(value))
        keys.append(key)
    return tuple(keys)


def _set_key(table: object, key: str, value: object) -> None:
    """Set a key by its full name in place; nothing is set below a value that is no table."""
    *outer, last = key.split(".")
    for name in outer:
        if not isinstance(table, dict):
            return
        table = table.setdefault(name, {})
    if isinstance(table, dict):
        table[last] = value


def _parse_value(text: str) -> object:
    """Return the value of a text: of TOML, an array of words with commas, or the text itself."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except (RecursionError, ValueError):
        pass
    if re.fullmatch(r"[\w .+-]+(,[\w .+-]+)+", text):
        return [_parse_value(part.strip()) for part in text.split(",")]
    return text


@cache
def keys_of(model: type[Section]) -> dict[str, FieldInfo]:
    """Return all keys below the class of a section by their full names, sections left out."""
    return {name: info for name, info, is_section in _walk_keys("", model) if not is_section}


def _walk_keys(prefix: str, model: type[Section]) -> Iterator[tuple[str, FieldInfo, bool]]:
    """Yield full name, field, and whether it is a section, of each key below a class."""
    for key, info in model.described_fields().items():
        name = f"{prefix}{key}"
        parts = [info.annotation, *_annotation_parts(info.annotation)]
        models = [part for part in parts if isinstance(part, type) and issubclass(part, Section)]
        yield name, info, bool(models)
        for inner in models:
            yield from _walk_keys(f"{name}.", inner)


def quantity_of(info: FieldInfo) -> Quantity | None:
    """Return the quantity of a key, or of the entries of its array."""
    for part in (*info.metadata, *_annotation_parts(info.annotation)):
        if isinstance(part, Quantity):
            return part
    return None


def allowed_values(info: FieldInfo) -> str:
    """Return the allowed values of a key in words; empty where it takes any text."""
    quantity = quantity_of(info)
    if quantity is not None:
        return quantity.allowed
    return ", ".join(part for part in _annotation_parts(info.annotation) if isinstance(part, str))


def _annotation_parts(annotation: Any) -> Iterator[Any]:
    """Yield everything inside an annotation, what is annotated with it too."""
    for part in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        yield part
        yield from _annotation_parts(part)
