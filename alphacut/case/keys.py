"""Every key of the case format, with its JSON Schema and its page, from the models."""

from __future__ import annotations

import json
import sys
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


HEAD = """# The case format

A case is a TOML file. Quantities are text with their unit, `"80 GPa"`; Pint reads the units.
Numbers without a unit stand bare. One value is crisp, `"[75, 85] GPa"` an interval,
`"[75, 80, 85] GPa"` a triangle (lower, most plausible, upper), four values are a trapezoid;
`"80 GPa ± 5 %"` is an interval. `alphacut check` prints what each value was read as. Files that a
case names are looked for from the case's own folder. `python -m alphacut.case.keys` makes this
page from the models.
"""


def page() -> str:
    """The page of the case format in Markdown."""
    return "\n".join([HEAD, *(_section(name, models) for name, models in sections().items())])


def _section(name: str, models: list[type[Section]]) -> str:
    text = f"## {f'[{name}]' if name else 'Top of the file'}\n"
    for model in models:
        about = " ".join((model.__doc__ or "").split())
        rows = [_row(info.alias or key, info) for key, info in model.model_fields.items()]
        table = ["| key | meaning | allowed |", "|---|---|---|", *filter(None, rows)]
        text += f"\n{about}\n\n" + "\n".join(table) + "\n"
    return text


def _row(key: str, info: FieldInfo) -> str:
    if next(_models(info.annotation), None) is not None:
        return ""
    of = quantity_of(info)
    allowed = of.allowed if of else ", ".join(map(str, _choices(info.annotation)))
    need = " (needed)" if info.is_required() else ""
    return f"| `{key}` | {info.description}{need} | {allowed} |"


def _choices(annotation: Any) -> Iterator[object]:
    """Names that a key may hold."""
    for part in get_args(annotation):
        if isinstance(part, str):
            yield part
        else:
            yield from _choices(part)


if __name__ == "__main__":
    print(json_schema() if "schema" in sys.argv[1:] else page(), end="")
