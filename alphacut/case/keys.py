"""Every key of the case format, and its JSON Schema, from the models."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from typing import Any, get_args

from pydantic.fields import FieldInfo

from alphacut.case.content import Content
from alphacut.case.types import Quantity, Section

SectionModels = list[type[Section]]
"""Classes of a section; one that may have several kinds has a class for each."""


@cache
def every_key() -> dict[str, FieldInfo]:
    """All keys by their full names, sections left out."""
    return {name: info for name, info, models in _walk("", Content) if not models}


@cache
def sections() -> dict[str, SectionModels]:
    """The models of every section by its name; that of an image and of a round cell have one."""
    models_by_section: dict[str, SectionModels] = {"": [Content]}
    return models_by_section | {name: models for name, _, models in _walk("", Content) if models}


def _walk(prefix: str, model: type[Section]) -> Iterator[tuple[str, FieldInfo, SectionModels]]:
    """Yields each key below a section's class: full name, field, classes of a section or none."""
    for key, info in model.model_fields.items():
        name, parts = f"{prefix}{key}", [info.annotation, *_parts(info.annotation)]
        models = [x for x in parts if isinstance(x, type) and issubclass(x, Section)]
        yield name, info, models
        for inner in models:
            yield from _walk(f"{name}.", inner)


def _parts(annotation: Any) -> Iterator[Any]:
    """Everything inside an annotation, what is annotated with it too."""
    for part in (*get_args(annotation), *getattr(annotation, "__metadata__", ())):
        yield part
        yield from _parts(part)


def quantity_of(info: FieldInfo) -> Quantity | None:
    """The quantity of a key, or of the entries of its array."""
    parts = [*info.metadata, *_parts(info.annotation)]
    return next((part for part in parts if isinstance(part, Quantity)), None)


def allowed(info: FieldInfo) -> str:
    """Allowed values of a key in words; empty where it takes any text."""
    quantity = quantity_of(info)
    choices = [part for part in _parts(info.annotation) if isinstance(part, str)]
    return quantity.allowed if quantity else ", ".join(choices)


def json_schema() -> str:
    """The JSON Schema of a case file, for editors."""
    schema = Content.model_json_schema(by_alias=True)
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    print(json_schema(), end="")
