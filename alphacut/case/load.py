"""A whole case: its keys, its sections and its JSON Schema."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from pydantic.fields import FieldInfo

from alphacut.case.content import Content
from alphacut.case.parse import (
    ParsedCase,
    SectionModels,
    annotation_parts,
    keys_of,
    parse,
    sections_of,
)
from alphacut.case.types import Quantity

Case = ParsedCase[Content]


def load(path: Path | str, changes: Sequence[str] = ()) -> Case:
    """Reads a TOML case file, with changes ``KEY=VALUE`` such as ``cell.matrix_modulus=20 GPa``.

    Raises:
        BadInput: With every problem of the case.
    """
    return parse(Content, path, changes)


def every_key() -> dict[str, FieldInfo]:
    """All keys by their full names, sections left out."""
    return keys_of(Content)


def sections() -> dict[str, SectionModels]:
    """The models of every section by its name; that of an image and of a round cell have one."""
    return sections_of(Content)


def quantity_of(info: FieldInfo) -> Quantity | None:
    """The quantity of a key, or of the entries of its array."""
    parts = [*info.metadata, *annotation_parts(info.annotation)]
    return next((part for part in parts if isinstance(part, Quantity)), None)


def allowed(info: FieldInfo) -> str:
    """Allowed values of a key in words; empty where it takes any text."""
    quantity = quantity_of(info)
    choices = [part for part in annotation_parts(info.annotation) if isinstance(part, str)]
    return quantity.allowed if quantity else ", ".join(choices)


def json_schema() -> str:
    """The JSON Schema of a case file, for editors."""
    schema = Content.model_json_schema(by_alias=True)
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    print(json_schema(), end="")
