"""Every key of the case format, and its JSON Schema, from the models."""

from __future__ import annotations

import json
from collections.abc import Iterator
from functools import cache
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from alphacut.case.content import CONTENT
from alphacut.case.types import Quantity, Section

Keys = dict[str, FieldInfo]


@cache
def every_key() -> Keys:
    """All keys by their full names, sections left out."""
    return dict(_keys("", CONTENT))


def sections() -> dict[str, list[type[Section]]]:
    """The models of every section by its name; that of an image and of a round cell have one."""
    models: dict[str, list[type[Section]]] = {"": [CONTENT]}
    for name, model in _nested("", CONTENT):
        models.setdefault(name, []).append(model)
    return models


def _keys(prefix: str, model: type[Section]) -> Iterator[tuple[str, FieldInfo]]:
    for name, info in model.model_fields.items():
        full = f"{prefix}{info.alias or name}"
        inner = list(_models(info.annotation))
        if not inner:
            yield full, info
        for one in inner:
            yield from _keys(f"{full}.", one)


def _nested(prefix: str, model: type[Section]) -> Iterator[tuple[str, type[Section]]]:
    for name, info in model.model_fields.items():
        for inner in _models(info.annotation):
            yield f"{prefix}{name}", inner
            yield from _nested(f"{prefix}{name}.", inner)


def _models(annotation: Any) -> Iterator[type[Section]]:
    """Models in an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        yield annotation
    elif get_origin(annotation) in (Union, UnionType, Annotated, tuple):
        for part in get_args(annotation):
            yield from _models(part)


def quantity_of(info: FieldInfo) -> Quantity | None:
    """The quantity of a key, or of the entries of its array."""
    pending: list[Any] = [*info.metadata, info.annotation]
    while pending:
        part = pending.pop(0)
        if isinstance(part, Quantity):
            return part
        pending += [*getattr(part, "__metadata__", ()), *get_args(part)]
    return None


def json_schema() -> str:
    """The JSON Schema of a case file, for editors."""
    schema = CONTENT.model_json_schema(by_alias=True)
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"


def allowed(info: FieldInfo) -> str:
    """Allowed values of a key in words; empty where it takes any text."""
    of = quantity_of(info)
    return of.allowed if of else ", ".join(map(str, _choices(info.annotation)))


def _choices(annotation: Any) -> Iterator[object]:
    """Names that a key may hold."""
    for part in get_args(annotation):
        if isinstance(part, str):
            yield part
        else:
            yield from _choices(part)


if __name__ == "__main__":
    print(json_schema(), end="")
