"""``alphacut keys``: the keys of case files with meaning, allowed values and defaults."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from typing import TextIO

from pydantic.fields import FieldInfo

from alphacut.base.errors import require
from alphacut.case.content import Content
from alphacut.case.parse import allowed_values, sections_in
from alphacut.case.structures import with_structures
from alphacut.case.types import Section
from alphacut.commands.options import write_answer
from alphacut.io.files import suggestion


def run(options: argparse.Namespace, out: TextIO) -> int:
    """Print the keys of all sections, or of one and the sections inside it."""
    chosen = options.section.strip("[]")
    blocks = list(blocks_of("", "Top level", with_structures(Content, built=True)))
    listed = [text for name, text in blocks if f"{name}.".startswith(f"{chosen}.") or not chosen]
    names = [name for name, _ in blocks if name]
    require(bool(listed), "section", chosen, ", ".join(names), suggestion(chosen, names))
    write_answer(options, {"keys": listed}, out, "\n".join(listed))
    return 0


def blocks_of(name: str, title: str, model: type[Section]) -> Iterator[tuple[str, str]]:
    """Yield the name of a section and its keys in Markdown, then those of the sections inside it.

    Args:
        name: Full name, as "records.spectrum"; empty for the top of the case.
        title: Heading of the section.
        model: The class that reads the section.
    """
    about, _, _ = (model.__doc__ or "").partition("\n\n")
    rows = [f"## {title}", "", about, ""]
    inner = []
    for key, info in model.described_fields().items():
        full = f"{name}.{key}".strip(".")
        found = sections_in(info)
        inner += [(full, f"`[{full}]`", section) for section in found]
        if not found:
            rows.append(f"- `{key}`: {_about(info)}.")
    yield name, "\n".join([*rows, ""])
    for place in inner:
        yield from blocks_of(*place)


def _about(info: FieldInfo) -> str:
    """Return what a key means, its allowed values, and whether it is required or its default."""
    about = " ".join(str(info.description).split()).rstrip(".")
    default = json.dumps(info.default, default=lambda value: getattr(value, "value", None))
    if default in ("null", '""', "[]", "[null]", "{}"):
        default = ""
    last = "required" if info.is_required() else default and f"default {default}"
    return "; ".join(filter(None, [about, allowed_values(info), last]))
