"""From a TOML file to a checked case; every problem is found before anything is computed."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from alphacut.case.case import Case
from alphacut.case.checks import checks
from alphacut.case.dependent_checks import undoubted
from alphacut.case.key import Key, Section
from alphacut.case.line_numbers import key_at, lines_of_keys
from alphacut.case.overrides import Raw, apply_changes, table_of
from alphacut.case.schema import IMPLIED, SECTIONS, dotted, every_key
from alphacut.case.values import Unfit, allowed, nearest, read
from alphacut.io.output_paths import hint
from alphacut.io.problem import BadInput, Problem


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
    values: dict[str, object] = {}
    written: dict[str, object] = {}
    single = list(checked(raw, values, written))
    case = Case(path, values, written, lines, frozenset(changed))
    problems = [*single, *together(case, single, modal=modal)]
    if problems:
        raise BadInput(
            sorted(
                (located(problem, path, lines, changed) for problem in problems),
                key=lambda problem: problem.line,
            )
        )
    return case


def together(case: Case, single: Sequence[Problem], *, modal: bool) -> Iterator[Problem]:
    """Problems of a case as a whole that do not rest on wrong single values."""
    # a section or the stages: there is no telling what was meant
    if any("." not in problem.key for problem in single):
        return
    broken = {problem.key for problem in single}
    broken |= {
        dotted(problem.key.rpartition(".")[0], problem.nearest)
        for problem in single
        if problem.nearest
    }
    for check in checks(modal=modal):
        yield from undoubted(check, case, broken)


def contents(path: Path) -> str:
    """Text of a file, or what is wrong with it: missing, a folder, not UTF-8."""
    try:
        data = path.read_bytes()
    except OSError as error:
        reason = {
            FileNotFoundError: "there is no such file",
            IsADirectoryError: "this is a folder",
        }.get(type(error), error.strerror)
        raise BadInput(
            Problem(
                str(path), f"{reason}", allowed=hint(path) or "a case file such as cases/paper.toml"
            )
        ) from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8")
        line = before.count("\n") + 1
        key, _ = key_at(data.decode("utf-8", "replace"), line)
        raise BadInput(
            Problem(
                key,
                f"byte {data[error.start]:#04x} is not UTF-8",
                allowed="text in UTF-8",
                file=str(path),
                line=line,
            )
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


def checked(raw: Raw, values: dict[str, object], written: dict[str, object]) -> Iterator[Problem]:
    """Check the tree against the schema; fills `values` and `written` on the way."""
    for name in raw:
        if name not in SECTIONS and name not in SECTIONS[""].keys:
            yield unknown(name, "", raw[name])
    raw = flattened(raw)
    top = {key: value for key, value in raw.items() if key in SECTIONS[""].keys}
    yield from checked_section("", SECTIONS[""], top, values, written)
    for name, section in SECTIONS.items():
        if name and name in raw:
            yield from checked_table(name, section, raw[name], values, written)
        elif IMPLIED.get(name) in raw:
            yield from checked_section(name, section, {}, values, written)


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
    name: str,
    section: Section,
    table: object,
    values: dict[str, object],
    written: dict[str, object],
) -> Iterator[Problem]:
    """Check ``[name]``, or every ``[[name]]``."""
    tables = table if section.repeated and isinstance(table, list) else [table]
    if section.repeated:
        values[name] = len(tables)
    for index, entry in enumerate(tables):
        full = f"{name}[{index}]" if section.repeated else name
        if isinstance(entry, dict) and isinstance(table, list) == section.repeated:
            yield from checked_section(full, section, entry, values, written)
        else:
            yield Problem(
                full,
                "this is a section",
                str(entry),
                f"[[{name}]]" if section.repeated else f"[{name}] with its keys below",
            )


def checked_section(
    name: str,
    section: Section,
    table: Mapping[str, object],
    values: dict[str, object],
    written: dict[str, object],
) -> Iterator[Problem]:
    """Check the keys of one table, and that none is missing."""
    needed = not any(key in table for key in section.unless)
    strangers = [
        unknown(key, name, value) for key, value in table.items() if key not in section.keys
    ]
    if len(strangers) == 1 and not strangers[0].nearest:
        missing = [
            key
            for key, entry in section.keys.items()
            if entry.required and needed and key not in table
        ]
        strangers = [replace(strangers[0], nearest=missing[0])] if len(missing) == 1 else strangers
    yield from strangers
    # a misspelt key is one problem, not a missing one besides
    meant = {problem.nearest for problem in strangers}
    for key, entry in section.keys.items():
        full = dotted(name, key)
        if key not in table:
            if entry.required and needed and key not in meant:
                yield Problem(full, f"missing: {entry.about}", allowed=allowed(entry))
            values[full] = entry.default
            continue
        written[full] = table[key]
        try:
            values[full] = read(table[key], entry)
        except Unfit as unfit:
            yield Problem(
                full,
                unfit.what,
                as_written(table[key]),
                unfit.allowed or allowed(entry),
                unfit.nearest,
            )


def unknown(key: str, section: str, value: object) -> Problem:
    """The problem of a key or section that does not exist, with the nearest that does."""
    plain = section.partition("[")[0]
    here = SECTIONS[plain].keys
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


def located(
    problem: Problem, path: Path, lines: Mapping[str, int], changed: Collection[str]
) -> Problem:
    """The problem with its file and line; a missing key points at its section."""
    if problem.key in changed:
        return Problem(
            problem.key,
            problem.what,
            problem.value,
            problem.allowed,
            problem.nearest,
            "command line",
        )
    section = problem.key.rpartition(".")[0]
    line = lines.get(problem.key) or lines.get(section) or 0
    return Problem(
        problem.key, problem.what, problem.value, problem.allowed, problem.nearest, str(path), line
    )


def describe(key: Key) -> str:
    """One line of help for a key: what it is and what it may hold."""
    return f"{key.about}; {allowed(key)}"
