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

from alphacut.base.errors import RefusedError, printable, require
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
Refusal = tuple[str, object, str, str]
"""Key, value, allowed values and cure of a `RefusedError`."""


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
    """Reads a TOML case file as the content `model`, with changes ``KEY=VALUE``.

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
        problems = (
            RefusedError(*refusal, "command line" if _is_below(refusal[0], changed) else str(path))
            for refusal in _refusals(model, error)
        )
        raise BadInput({str(problem): problem for problem in problems}.values()) from None
    return ParsedCase(path, text, content, tuple(changes))


def _parse_toml(path: Path, text: str) -> dict[str, object]:
    """The top table of a TOML text; an error of syntax is raised with the file and the line."""
    try:
        return tomllib.loads(text.replace("\r\n", "\n"))
    except (RecursionError, ValueError) as error:
        what, place = str(error).partition(" (at")[0].lower(), str(path)
        shown = ""  # an integer of too many digits has no line
        if match := re.search(r"\(at line (\d+), column \d+\)", str(error)):
            place += f":{match[1]}"
            shown = text.splitlines()[int(match[1]) - 1].strip()
        raise BadInput(
            [RefusedError(shown or "the file", f"not TOML: {what}", "", "", place)]
        ) from None


def _refusals(model: type[Section], error: ValidationError) -> Iterator[Refusal]:
    """What is wrong by each error of Pydantic; a misspelt key is not missing as well."""
    details = [(_full_key(detail["loc"]), detail) for detail in error.errors(include_url=False)]
    unknown = [key for key, detail in details if detail["type"] == "extra_forbidden"]
    suggested = {key: _suggested_key(model, key) for key in unknown}
    for key, detail in details:
        if key in suggested:
            kind = "section" if isinstance(detail["input"], dict) else "key"
            close = suggested[key].removeprefix(f"{key.rpartition('.')[0]}.")
            names = "" if close else ", ".join(_sibling_names(model, key))
            yield key, f"an unknown {kind}", names, f"did you mean {close}?" if close else ""
        elif key not in suggested.values():
            yield _refusal(model, key, detail)


def _without_indices(key: str) -> str:
    return re.sub(r"\[\d+\]", "", key)


def _sibling_names(model: type[Section], key: str) -> list[str]:
    section, _, _ = _without_indices(key).rpartition(".")
    names = (name.rpartition(".") for name, _, _ in _walk_keys("", model))
    return [*dict.fromkeys(name for inside, _, name in names if inside == section)]


def _suggested_key(model: type[Section], key: str) -> str:
    """Full name of the known key nearest to an unknown one; empty where none is near."""
    section, dot, name = key.rpartition(".")
    if close := nearest(name, _sibling_names(model, key)):
        return f"{section}{dot}{close}"
    elsewhere = {x.rpartition(".")[2]: x for x in keys_of(model)}
    return elsewhere.get(nearest(name, elsewhere), "")


def _refusal(model: type[Section], key: str, detail: ErrorDetails) -> Refusal:
    """What is wrong with a key whose value is wrong or missing, by the error of Pydantic."""
    context = detail.get("ctx", {})
    cause, kind = context.get("error"), detail["type"]
    if isinstance(cause, RefusedError):
        return cause.key or key, cause.value, cause.allowed, cause.cure
    about = keys_of(model).get(_without_indices(key))
    words = (about and about.description) or "a section"
    if kind == "missing":
        return key, None, words, ""
    given = detail["input"]  # as it stood in the file, near enough
    value = f'"{given}"' if isinstance(given, str) else printable(given).replace("'", '"')
    if kind == "literal_error":
        allowed = str(context["expected"]).replace("'", '"')
        names = re.findall(r'"([^"]+)"', allowed)
        return key, value, allowed, suggestion(str(given), names)
    if kind == "tuple_type":
        return key, value, "an array", f"write {key.rpartition('.')[2]} = [{value}]"
    return key, value, str(cause or KINDS.get(kind, detail["msg"])), ""


def _full_key(location: tuple[int | str, ...]) -> str:
    """Full name of a key, entries counted from 1, without the tags of unions, as <image>."""
    parts = (f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(part for part in parts if not part.startswith(".<")).lstrip(".")


def _is_below(key: str, changed: Sequence[str]) -> bool:
    """True for a changed key, one of its entries, or a key of its table."""
    return any(re.match(rf"{re.escape(name)}(?![\w-])", key) for name in changed)


def apply_changes(
    model: type[Section], table: dict[str, object], changes: Sequence[str]
) -> tuple[str, ...]:
    """Puts every change KEY=VALUE into the table of a case; returns the keys, each known."""
    full_keys = [key for key in keys_of(model) if not key.startswith("study.")]
    keys: list[str] = []
    for change in changes:
        key, _, value = (part.strip() for part in change.partition("="))
        endings = (f"did you mean {full}?" for full in full_keys if full.endswith(f".{key}"))
        cure = next(endings, suggestion(key, full_keys)) or "docs/case-format.md has all keys"
        allowed = "KEY=VALUE with a full key, as cell.matrix_modulus='20 GPa'"
        has_value = "=" in change
        require(has_value or key not in full_keys, "--set", f"{change}, without a value", allowed)
        require(key in full_keys, "--set", f"{change}, of an unknown key", allowed, cure)
        require(key not in keys, "--set", f"{change}, of a key given before", "each key once")
        _set_key(table, key, _parse_value(value))
        keys.append(key)
    return tuple(keys)


def _set_key(table: object, key: str, value: object) -> None:
    *outer, last = key.split(".")
    for name in outer:
        table = table.setdefault(name, {}) if isinstance(table, dict) else None
    if isinstance(table, dict):
        table[last] = value


def _parse_value(text: str) -> object:
    """Value that a text states: as TOML if it is TOML, words with commas as an array, else text."""
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except (RecursionError, ValueError):
        pass
    if re.fullmatch(r"[\w .+-]+(,[\w .+-]+)+", text):
        return [_parse_value(part.strip()) for part in text.split(",")]
    return text


@cache
def keys_of(model: type[Section]) -> dict[str, FieldInfo]:
    """All keys below a section's class by their full names, sections left out."""
    return {name: info for name, info, is_section in _walk_keys("", model) if not is_section}


def _walk_keys(prefix: str, model: type[Section]) -> Iterator[tuple[str, FieldInfo, bool]]:
    """Yields each key below a section's class: full name, field, whether it is a section."""
    for key, info in model.model_fields.items():
        name, parts = f"{prefix}{key}", [info.annotation, *_annotation_parts(info.annotation)]
        models = [x for x in parts if isinstance(x, type) and issubclass(x, Section)]
        yield name, info, bool(models)
        for inner in models:
            yield from _walk_keys(f"{name}.", inner)


def quantity_of(info: FieldInfo) -> Quantity | None:
    """The quantity of a key, or of the entries of its array."""
    parts = [*info.metadata, *_annotation_parts(info.annotation)]
    return next((part for part in parts if isinstance(part, Quantity)), None)


def allowed_values(info: FieldInfo) -> str:
    """Allowed values of a key in words; empty where it takes any text."""
    quantity = quantity_of(info)
    choices = [part for part in _annotation_parts(info.annotation) if isinstance(part, str)]
    return quantity.allowed if quantity else ", ".join(choices)


def _annotation_parts(annotation: Any) -> Iterator[Any]:
    """Yields everything inside an annotation, what is annotated with it too."""
    for part in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        yield part
        yield from _annotation_parts(part)
