"""From TOML text with the lines of its keys to a checked case; every problem is found at once."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeVar

from alphacut.case.case import Case, Sections
from alphacut.case.checks import checks
from alphacut.case.key import Key, Section, UnknownValueError, keys_of
from alphacut.case.overrides import Raw, apply_changes, table_of
from alphacut.case.schema import IMPLIED, SECTIONS, Top, dotted, every_key
from alphacut.case.sections.material import Cell
from alphacut.case.sections.picture import PICTURES, Picture
from alphacut.case.sections.vibration import Study
from alphacut.case.values import Unfit, allowed, nearest, read
from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput, Problem

S = TypeVar("S", bound=Section)
Tables = dict[str, dict[str, object]]
"""Values of the keys of each section, by the section's full name: ``study[0]``."""


def load(
    path: Path | str,
    changes: Sequence[str] = (),
    *,
    modal: bool = False,
    without: Sequence[str] = (),
) -> Case:
    """Read and check a case file.

    Args:
        path: TOML file.
        changes: ``KEY=VALUE`` each; the key in full (``cell.matrix_modulus``) or alone where that
            is clear.
        modal: Only modal values are wanted: fuzzy inputs need not fit together over their whole
            supports.
        without: Keys of the file that are passed over.

    Raises:
        BadInput: With every problem found.
    """
    path = Path(path)
    text = contents(path)
    raw = parsed(path, text)
    lines = lines_of_keys(text)
    for section, _, key in (name.rpartition(".") for name in without):
        (table_of(raw, section) or {}).pop(key, None)
    changed = apply_changes(raw, changes)
    tables: Tables = {}
    written: dict[str, object] = {}
    single = list(checked(raw, tables, written))
    broken = unsound(single)
    case = Case(
        path, built(tables, written, broken), written, lines, frozenset(changed), frozenset(broken)
    )
    problems = [*single, *together(case, single, modal=modal)]
    if problems:
        raise BadInput(sorted(map(case.located, problems), key=lambda problem: problem.line))
    return replace(case, broken=frozenset())


def unsound(problems: Sequence[Problem]) -> set[str]:
    """Keys whose values are wrong, or may stand under a misspelt name."""
    meant = (
        dotted(problem.key.rpartition(".")[0], problem.nearest)
        for problem in problems
        if problem.nearest
    )
    return {*(problem.key for problem in problems), *meant}


def built(tables: Tables, written: Collection[str], broken: Collection[str]) -> Sections:
    """The sections of a case; what is broken is left out of them."""
    sound = {
        name: {key: value for key, value in table.items() if dotted(name, key) not in broken}
        for name, table in tables.items()
    }
    pictured = any(f"cell.{name}" in written for name in PICTURES)

    kinds = {**SECTIONS, "cell": Picture if pictured else Cell}
    made: dict[str, Any] = {
        "picture" if name == "cell" and pictured else name: section_of(kinds[name], name, sound)
        for name in sound
        if name and name.isidentifier()  # those inside others, and studies, have names of their own
    }
    studies = (section_of(Study, name, sound) for name in sound if name.startswith("study["))
    return Sections(top=section_of(Top, "", sound), study=tuple(studies), **made)


def section_of(section: type[S], name: str, tables: Tables) -> S:
    """A section and those inside it; a field whose value is missing stays unset."""
    made = object.__new__(section)
    for field in fields(section):
        inner = dotted(name, field.name)
        if inner in SECTIONS:
            value = section_of(SECTIONS[inner], inner, tables) if inner in tables else None
            object.__setattr__(made, field.name, value)
        elif field.name in tables[name]:
            object.__setattr__(made, field.name, tables[name][field.name])
    return made


def together(case: Case, single: Sequence[Problem], *, modal: bool) -> Iterator[Problem]:
    """Problems of a case as a whole that do not rest on wrong single values."""
    # a section or the stages: there is no telling what was meant
    if any("." not in problem.key for problem in single):
        return
    for check in checks(modal=modal):
        try:
            yield from check(case)
        except UnknownValueError:  # what the check goes on to rests on a wrong value
            continue


def checked(raw: Raw, tables: Tables, written: dict[str, object]) -> Iterator[Problem]:
    """Check the tree against the schema; fills `tables` and `written` on the way."""
    for name in raw:
        if name not in SECTIONS and name not in keys_of(Top):
            yield unknown(name, "", raw[name])
    raw = flattened(raw)
    top = {key: value for key, value in raw.items() if key in keys_of(Top)}
    yield from checked_section("", Top, top, tables, written)
    for name, section in SECTIONS.items():
        if name and name in raw:
            yield from checked_table(name, section, raw[name], tables, written)
        elif IMPLIED.get(name) in raw:
            yield from checked_section(name, section, {}, tables, written)


def flattened(raw: Raw) -> Raw:
    """Tree with nested sections, ``[microstructure.packing]``, beside their parents."""
    flat = dict(raw)
    for name in SECTIONS:
        outer, _, inner = name.rpartition(".")
        table = flat.get(outer)
        if outer and isinstance(table, dict) and inner in table:
            flat[name] = table[inner]
            flat[outer] = {key: value for key, value in table.items() if key != inner}
    return flat


def checked_table(
    name: str, section: type[Section], table: object, tables: Tables, written: dict[str, object]
) -> Iterator[Problem]:
    """Check ``[name]``, or every ``[[name]]``."""
    entries = table if section.repeated and isinstance(table, list) else [table]
    for index, entry in enumerate(entries):
        full = f"{name}[{index}]" if section.repeated else name
        if isinstance(entry, dict) and isinstance(table, list) == section.repeated:
            yield from checked_section(full, section, entry, tables, written)
        else:
            yield Problem(
                full,
                "this is a section",
                str(entry),
                f"[[{name}]]" if section.repeated else f"[{name}] with its keys below",
            )


def checked_section(
    name: str,
    section: type[Section],
    table: Mapping[str, object],
    tables: Tables,
    written: dict[str, object],
) -> Iterator[Problem]:
    """Check the keys of one table, and that none is missing."""
    needed = required_keys(section, table)
    strangers = [
        unknown(key, name, value) for key, value in table.items() if key not in keys_of(section)
    ]
    if len(strangers) == 1 and not strangers[0].nearest:
        missing = [key for key in needed if key not in table]
        strangers = [replace(strangers[0], nearest=missing[0])] if len(missing) == 1 else strangers
    yield from strangers
    # a misspelt key is one problem, not a missing one besides
    meant = {problem.nearest for problem in strangers}
    values = tables.setdefault(name, {})
    for key, entry in keys_of(section).items():
        full = dotted(name, key)
        if key not in table:
            if key in needed and key not in meant:
                yield Problem(full, f"missing: {entry.about}", allowed=allowed(entry))
            if not entry.required:
                values[key] = entry.default
            continue
        written[full] = table[key]
        try:
            values[key] = read(table[key], entry)
        except Unfit as unfit:
            yield Problem(
                full,
                unfit.what,
                as_written(table[key]),
                unfit.allowed or allowed(entry),
                unfit.nearest,
            )


def required_keys(section: type[Section], table: Mapping[str, object]) -> list[str]:
    """Names of the keys that a section with these keys cannot do without."""
    keys = keys_of(section)
    lifted = any(key in table for key in section.unless)

    def required(entry: Key) -> bool:
        if entry.beside is None:
            return entry.required and not lifted
        other, value = entry.beside
        return table.get(other, keys[other].default) == value

    return [name for name, entry in keys.items() if required(entry)]


def unknown(key: str, section: str, value: object) -> Problem:
    """The problem of a key or section that does not exist, with the nearest that does."""
    plain = section.partition("[")[0]
    here = keys_of(SECTIONS[plain])
    close = nearest(key, [*here, *(() if section else filter(None, SECTIONS))])
    if not close:
        elsewhere = {name.rpartition(".")[2]: name for name in every_key()}
        close = elsewhere.get(nearest(key, elsewhere), "")
    kind = "section" if isinstance(value, dict | list) and not section else "key"
    shown = "" if kind == "section" else as_written(value)
    return Problem(
        dotted(section, key),
        f"there is no such {kind}",
        shown,
        "" if close else ", ".join(here),
        close,
    )


def as_written(value: object) -> str:
    """A value as it stood in the file, near enough."""
    return f'"{value}"' if isinstance(value, str) else str(value).replace("'", '"')


def section_from(section: type[S], table: Mapping[str, object]) -> S:
    """A section from a table that this program wrote; what it leaves out holds its default."""
    keys = keys_of(section)
    values = {
        name: read(table[name], key) if name in table else key.default for name, key in keys.items()
    }
    return section_of(section, "", {"": values})


HEADER = re.compile(r"\s*(\[\[?)\s*([^\[\]]*?)\s*\]\]?")
ASSIGNMENT = re.compile(r"""\s*([A-Za-z0-9_.\-"' ]+?)\s*=""")


def lines_of_keys(text: str) -> dict[str, int]:
    """Full key name (``study[1].name`` in repeated tables) to its line, from 1."""
    found: dict[str, int] = {}
    counts: dict[str, int] = {}
    prefix, inside = "", ""
    for number, line in enumerate(text.splitlines(), start=1):
        if inside:
            inside = "" if inside in line else inside
            continue
        if header := HEADER.match(line):
            name = header[2].strip().strip("\"'")
            if header[1] == "[[":
                counts[name] = counts.get(name, -1) + 1
                name = f"{name}[{counts[name]}]"
            prefix = name + "."
            found.setdefault(name, number)
        elif match := ASSIGNMENT.match(line):
            key = re.sub(r"[\"' ]", "", match[1])
            found.setdefault(prefix + key, number)
            inside = opened(line[match.end() :])
    return found


def opened(rest: str) -> str:
    """Closing mark of a value that goes on over the next lines, or an empty text."""
    for quotes in ('"""', "'''"):
        if rest.count(quotes) % 2:
            return quotes
    return ""


def key_at(text: str, line: int) -> tuple[str, int]:
    """The key that `line` belongs to, and the line it starts on: the last one at or above it."""
    best, at = "the file", 0
    for key, number in lines_of_keys(text).items():
        if at < number <= line:
            best, at = key, number
    return best, at or line


def contents(path: Path) -> str:
    """Text of a file, or what is wrong with it: missing, a folder, not UTF-8."""
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = {
            FileNotFoundError: "there is no such file",
            IsADirectoryError: "this is a folder",
        }.get(type(error), error.strerror)
        raise BadInput.of(
            str(path), f"{reason}", allowed=hint(path) or "a case file such as cases/paper.toml"
        ) from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8")
        line = before.count("\n") + 1
        key, _ = key_at(data.decode("utf-8", "replace"), line)
        raise BadInput.of(
            key,
            f"byte {data[error.start]:#04x} is not UTF-8",
            allowed="text in UTF-8",
            file=str(path),
            line=line,
        ) from None


def parsed(path: Path, text: str) -> Raw:
    """The TOML tree, or the line and key where it is broken."""
    try:
        return tomllib.loads(text.replace("\r\n", "\n"))
    except tomllib.TOMLDecodeError as error:
        where = re.search(r"\(at line (\d+), column \d+\)", str(error))
        line = int(where[1]) if where else max(1, len(text.splitlines()))
        reason = re.sub(r"\s*\(at .*\)$", "", str(error)).rstrip(".")
        shown = text.splitlines()[line - 1].strip() if text.splitlines() else ""
        key = broken_key(text, line)
        what = f"this is not TOML: {reason[:1].lower()}{reason[1:]}, at '{shown}'"
        problem = Problem(key, what, allowed=cure(shown), file=str(path), line=line)
        raise BadInput(problem) from None


def cure(line: str) -> str:
    """Cure of a broken line where that is plain; else empty."""
    name, _, value = (part.strip() for part in line.partition("#")[0].partition("="))
    if re.fullmatch(r"[\w\-]+", name) and not name.isascii():
        return "keys of plain letters, digits and _"
    if match := re.fullmatch(r"([-+]?\d+),(\d+)(.*)", value):
        if name in ("seed", "discs", "packings", "bootstrap", "samples"):
            return "a whole number"
        return f"{match[1]}.{match[2]}{match[3]}, with a point"
    unquoted = re.fullmatch(r"(\[[^\]\"']*\]|[-+]?[\d.,]+)\s*[A-Za-z%µ][^\"']*", value)
    return f'put it in quotes: "{value}"' if unquoted else ""


def broken_key(text: str, line: int) -> str:
    """Key on a broken line: before the =, or the first word, or the key it belongs to."""
    key, at = key_at(text, line)
    broken = text.splitlines()[line - 1] if text else ""
    if section := re.match(r"\s*\[+\s*([\w.\-]+)\s*\]+", broken):
        return section[1]
    word = re.match(r"\s*([A-Za-z_][\w\-]*)\s*$", broken)
    return word[1] if word and at != line else key
