"""A case, from TOML text and changes of it; every problem is reported at once, by its key."""

from __future__ import annotations

import itertools
import re
import tomllib
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Generic, TypeVar, get_args, get_origin

from numpy.linalg import LinAlgError
from pydantic import ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from alphacut.base.csv_columns import text_of
from alphacut.base.errors import RefusedError, cure_of, printable, require
from alphacut.case.types import FirstUse, Quantity, Section
from alphacut.io.files import BadInput, nearest, suggestion

C = TypeVar("C", bound=Section)
MAX_KEY_PARTS = 30
"""Most parts of a name in a TOML file, ten times those of any key."""
MAX_PROBLEMS = 50
"""Most problems of a case that are told at once."""


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


def parse(
    model_of: Callable[[Collection[str]], type[C]], path: Path | str, changes: Sequence[str] = ()
) -> ParsedCase[C]:
    """Read a TOML case file as a content, with changes of the command line.

    Args:
        model_of: Function of the names of its sections and keys that returns the class of the
            content, whose fields are the sections and keys that are allowed.
        path: The file. Files that the case names are looked for in its folder.
        changes: Texts "KEY=VALUE" that replace keys of the file.

    Returns:
        The path, the text of the file, the validated content, and the changes as they were given.

    Raises:
        BadInput: The file is not TOML; or, with every problem at once, keys are missing, unknown or
            have wrong values.
        RefusedError: The file cannot be read; or a change is no "KEY=VALUE", or its key is unknown
            or given twice.
    """
    path = Path(path)
    text = text_of(path)
    table = _parse_toml(path, text)
    model = model_of(table)
    changed = apply_changes(model, table, changes) if changes else ()
    try:
        content = model.model_validate(table, context={"folder": path.parent})
    except ValidationError as error:
        # Pydantic tries each member of a union, whose errors may be the same: each text is kept
        # once. All problems are reported together, so that a case is mended in one round.
        problems: dict[str, RefusedError] = {}
        for x in _refusals(model, error):
            # a key that was changed, or an entry or a key of the table of one
            is_changed = any(re.match(rf"{re.escape(name)}(?![\w-])", x.key) for name in changed)
            place = "command line" if is_changed else str(path)
            problem = RefusedError(x.key, x.value, x.allowed, x.cure, place)
            problems[str(problem)] = problem
        if (n_further := error.error_count() - MAX_PROBLEMS) > 0:
            problem = RefusedError(
                "the case", f"of {n_further} further problems", "", "", str(path)
            )
            problems[str(problem)] = problem
        raise BadInput(problems.values()) from None
    return ParsedCase(path, text, content, tuple(changes))


def _parse_toml(path: Path, text: str) -> dict[str, object]:
    """Return the top table of a TOML text.

    Args:
        path: File of the text, for messages.
        text: The text.

    Raises:
        BadInput: The text is not TOML. The message names the file, the line if it is known, and the
            cure of two usual mistakes.
    """
    # tomllib calls itself for nested brackets, of which a text may have more than the stack holds:
    # that is RecursionError, and means bad input here.
    # tomllib takes the square of the parts of a key in time and memory.
    part = r"""(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*"""
    if found := re.search(rf"(?<![\w-])(?:{part}){{{MAX_KEY_PARTS}}}", text):
        line = text.count("\n", 0, found.start()) + 1
        value = f"a name of more than {MAX_KEY_PARTS} parts"
        problem = RefusedError(found[0][:20], value, "names as frame.masses", "", f"{path}:{line}")
        raise BadInput([problem])
    try:
        return tomllib.loads(text)
    except (RecursionError, ValueError) as error:
        shown = "the file"
        place = str(path)
        # An integer of more digits than Python converts raises a ValueError without a line.
        if match := re.search(r"\(at line (\d+), column \d+\)", str(error)):
            place += f":{match[1]}"
            shown = text.splitlines()[int(match[1]) - 1].strip() or shown
        what = str(error).partition(" (at")[0].lower()
        # The two mistakes that TOML's own messages do not name: a quantity and a text unquoted.
        cures = {
            r"=\s*[-+]?[\d.]+\s*[A-Za-z%°µμ±]": 'quantities stand in quotes, as "0.01 s"',
            r"=\s*(?!true|false|inf|nan)[A-Za-z]": 'texts stand in quotes, as "auto"',
        }
        problem = RefusedError(shown, f"not TOML: {what}", "", cure_of(shown, cures), place)
        raise BadInput([problem]) from None


def _refusals(model: type[Section], error: ValidationError) -> Iterator[RefusedError]:
    """Yield a problem for each error of Pydantic, by the key that has it.

    A misspelt key makes two errors of Pydantic: an unknown key, and the right one that is missing.
    They become one problem of the unknown key, which names the key that may be meant. If no known
    key is near, it lists the keys of the section.

    Args:
        model: Class of the content that was validated.
        error: Its errors.
    """
    # Of each unknown key the nearest known one is looked for, which takes some milliseconds.
    errors = error.errors(include_url=False)[:MAX_PROBLEMS]
    details = [(_full_key(detail["loc"]), detail) for detail in errors]
    unknown = [key for key, detail in details if detail["type"] == "extra_forbidden"]
    suggested = {key: _suggested_key(model, key) for key in unknown}
    for key, detail in details:
        if key in suggested:
            kind = "section" if isinstance(detail["input"], dict) else "key"
            # The suggestion is the full name of a known key; the key itself if it is known, though
            # not allowed here; or "". In the same section its last name alone is shown.
            close = suggested[key].removeprefix(f"{key.rpartition('.')[0]}.")
            what = f"an unknown {kind}"
            names = _sibling_names(model, key)
            if suggested[key] == key:  # as cell.matrix_modulus of a cell whose mesh is a file
                what = f"a {kind} of another kind of section"
                close = ""
            elif close and "." not in close:  # of another section the keys of this one are listed
                names = []
            cure = f"did you mean {close}?" if close else ""
            yield RefusedError(key, what, ", ".join(names), cure)
        elif key not in suggested.values():
            yield _refusal(model, key, detail)


def _without_indices(key: str) -> str:
    """Return the name of a key without the numbers of its entries, as "study.name"."""
    return re.sub(r"\[\d+\]", "", key)


def _sibling_names(model: type[Section], key: str) -> list[str]:
    """Return the names of all keys of the section that a key stands in, in their order.

    Args:
        model: Class of the whole content.
        key: Full name, such as "study[2].fuzy"; the numbers of array entries do not matter, and the
            key itself need not be known. A name without a dot belongs to the top table.

    Returns:
        Names without the section; none if there is no such section.
    """
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
    """Return the problem of a key whose value is wrong or missing.

    Args:
        model: Class of the content that was validated.
        key: Full name of the key, such as "study[2].fuzzy".
        detail: Pydantic's error: its kind, the input, and in "ctx" the exception that a validator
            raised.

    Returns:
        RefusedError: The error that a validator of this project raised, with `key` if it has no key
        itself; else a new one with the value, the allowed values (of a missing key its
        description), and a hint.
    """
    context = detail.get("ctx", {})
    cause = context.get("error")
    kind = detail["type"]
    if isinstance(cause, LinAlgError):
        # Its text is one of LAPACK, and the input of a whole section is no value to show.
        cure = "is a unit wrong?"
        return RefusedError(key or "the case", f"of matrices without modes ({cause})", "", cure)
    if isinstance(cause, RefusedError):
        return RefusedError(cause.key or key, cause.value, cause.allowed, cause.cure)
    if kind == "missing":
        about = keys_of(model).get(_without_indices(key))
        words = "a section"
        if about is not None and about.description:
            words = about.description
        return RefusedError(key, None, words)
    given = detail["input"]
    # The value is shown as TOML has it, which is near enough to how it stood in the file.
    value = printable(given).replace("'", '"')
    if isinstance(given, str):
        value = f'"{given}"'
    if kind == "literal_error":
        allowed = str(context["expected"]).replace("'", '"')
        names = re.findall(r'"([^"]+)"', allowed)
        return RefusedError(key, value, allowed, suggestion(str(given), names))
    if kind == "tuple_type":  # one entry without the brackets of an array
        return RefusedError(key, value, "an array", f"write {key.rpartition('.')[2]} = [{value}]")
    # What a key takes, by the kind of Pydantic's error; its own messages speak of Python's types.
    allowed_kinds = {
        "bool_type": "true or false",
        "string_type": "text in quotes",
        "dict_type": "a table",
        "model_type": "a section",
        "model_attributes_type": "a section",
    }
    return RefusedError(key, value, str(cause or allowed_kinds.get(kind, detail["msg"])))


def _full_key(location: tuple[int | str, ...]) -> str:
    """Return the full name of a key from its place in Pydantic's errors.

    Args:
        location: Names and indices from the outside in, such as ("study", 0, "<tag>", "fuzzy").
            Indices become numbers from 1, and the tags of unions, which begin with "<", are left
            out: this is "study[1].fuzzy".
    """
    key = ""
    for part in location:
        if isinstance(part, int):
            key += f"[{part + 1}]"
        elif not part.startswith("<"):
            key += f".{part}"
    return key.lstrip(".")


def apply_changes(
    model: type[Section], table: dict[str, object], changes: Sequence[str]
) -> tuple[str, ...]:
    """Put every change KEY=VALUE into the table of a case, in place, and return the changed keys.

    Args:
        model: Class of the content, for the known keys.
        table: The parsed case. Sections that a key needs are added.
        changes: Texts "KEY=VALUE" with full keys such as "cell.matrix_modulus". VALUE is TOML,
            words separated by commas, or a text without quotes. Of a table whose names the case
            chooses, entries are changed, as "matrices.parameters.E". Keys of [[study]] cannot be
            changed.

    Raises:
        RefusedError: A change has no value, or its key is unknown or given before.
    """
    # Studies are entries of an array, which a key without an index does not tell apart.
    # Only sections that are named are made ready, which takes time.
    sections = {re.split("[.=]", change)[0].strip() for change in changes}
    walked = list(_walk_keys("", model, sections=sections))
    known = {key for key, _, is_section in walked if not is_section and key[:6] != "study."}
    tables = tuple(f"{key}." for key, info, _ in walked if _has_free_names(info))
    keys: list[str] = []
    for change in changes:
        key, equals, value = [part.strip() for part in change.partition("=")]
        allowed = "KEY=VALUE with a full key, as cell.matrix_modulus='20 GPa'"
        # For a key without its section the first section that has it is suggested; for any other
        # unknown key the known one that is spelt most alike.
        if key not in known and not key.startswith(tables):
            full_keys = [name for name in keys_of(model) if not name.startswith("study.")]
            close = [full for full in full_keys if full.endswith(f".{key}")]
            cure = suggestion(key, full_keys) or "docs/case-format.md has all keys"
            if close:
                cure = f"did you mean {close[0]}?"
            raise RefusedError("--set", f"{change}, of an unknown key", allowed, cure)
        require(bool(equals), "--set", f"{change}, without a value", allowed)
        require(key not in keys, "--set", f"{change}, of a key given before", "each key once")
        _set_key(table, key, _parse_value(value))
        keys.append(key)
    return tuple(keys)


def _set_key(table: object, key: str, value: object) -> None:
    """Set a key by its full name, such as "cell.fraction", in a table, in place.

    Missing tables are added. If an outer name has a value that is no table, nothing is set:
    validation refuses that value.
    """
    names = key.split(".")
    for name in names[:-1]:
        if not isinstance(table, dict):
            return
        table = table.setdefault(name, {})
    if isinstance(table, dict):
        table[names[-1]] = value


def _parse_value(text: str) -> object:
    """Return the value of a text of the command line.

    It is the TOML value that the text is, such as 0.5, true or [1, 2]; else a list if the text is
    words separated by commas, such as "E,m1"; else the text itself.
    """
    try:
        return tomllib.loads(f"x = {text}")["x"]
    except (RecursionError, ValueError):
        # Quotes around a text would need quotes of the shell around them: it is taken without.
        pass
    # Quantities with brackets or quotes in them are no lists of words: "[75, 80] GPa" stays a text.
    if re.fullmatch(r"[\w .+-]+(,[\w .+-]+)+", text):
        return [_parse_value(part.strip()) for part in text.split(",")]
    return text


@cache  # the walk reads the source of all sections
def keys_of(model: type[Section]) -> dict[str, FieldInfo]:
    """Return all keys below the class of a section by their full names, sections left out.

    The fields have descriptions.
    """
    every = _walk_keys("", model, described=True)
    return {name: info for name, info, is_section in every if not is_section}


def _walk_keys(
    prefix: str,
    model: type[Section],
    *,
    described: bool = False,
    sections: Collection[str] | None = None,
) -> Iterator[tuple[str, FieldInfo, bool]]:
    """Yield the keys below a class of sections, each before the keys inside it.

    Args:
        prefix: Beginning of the full names, empty or with its dot, such as "cell.".
        model: The class. A key may take sections of several classes: their keys all follow.
        described: Whether the fields get their descriptions, for which sources are read.
        sections: Keys of the class that are walked; all if left out.

    Yields:
        Full name such as "cell.fraction", Pydantic's field, and whether the key takes a section.
    """
    fields = model.described_fields() if described else model.model_fields
    for key, info in fields.items():
        if sections is not None and key not in sections:
            continue
        name = f"{prefix}{key}"
        models = sections_in(info)
        yield name, info, bool(models)
        for inner in models:
            yield from _walk_keys(f"{name}.", inner, described=described)


def sections_in(info: FieldInfo) -> list[type[Section]]:
    """Return the classes of the sections that a key takes; empty for a key with a value."""
    # the annotation itself and all types inside it, as in tuple[ForceSection, ...]
    parts = [info.annotation, *info.metadata, *_annotation_parts(info.annotation)]
    parts = [x.load() if isinstance(x, FirstUse) and x.load else x for x in parts]
    found = [part for part in parts if isinstance(part, type) and issubclass(part, Section)]
    return list(dict.fromkeys(found))


def _has_free_names(info: FieldInfo) -> bool:
    """Return whether a key takes a table whose names the case chooses."""
    return any(
        get_origin(x) is dict for x in (info.annotation, *_annotation_parts(info.annotation))
    )


def quantity_of(info: FieldInfo) -> Quantity | None:
    """Return the quantity of a key, or of the entries of its array."""
    # Pydantic moves what annotates the key itself into `metadata`, and leaves what is deeper.
    for part in itertools.chain(info.metadata, _annotation_parts(info.annotation)):
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
    for part in get_args(annotation) + getattr(annotation, "__metadata__", ()):
        yield part
        yield from _annotation_parts(part)
