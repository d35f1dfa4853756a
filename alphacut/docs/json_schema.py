"""The case format as a JSON Schema, for editors; made from the same table as the checks.

python -m alphacut.docs.json_schema > cases/case.schema.json
"""

from __future__ import annotations

import json
import math

from alphacut.case.key import Key, Section, about_of, keys_of
from alphacut.case.schema import SECTIONS
from alphacut.case.values import allowed
from alphacut.io.files import Document
from alphacut.io.units import QUANTITIES

NUMBERS = {"type": "array", "items": {"type": "number"}, "minItems": 1}


def json_schema() -> Document:
    """The schema of a case file."""
    document = section_schema(SECTIONS[""])
    for name, section in SECTIONS.items():
        if name:
            place = document
            for outer in name.split(".")[:-1]:
                place = place["properties"][outer]
            schema = section_schema(section)
            place["properties"][name.rpartition(".")[2]] = (
                {"type": "array", "items": schema} if section.repeated else schema
            )
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "alphacut case",
        **document,
    }


def section_schema(section: type[Section]) -> Document:
    """One table."""
    required = [name for name, key in keys_of(section).items() if key.required]
    ways = [required, *([name] for name in section.unless)]
    return {
        "type": "object",
        "description": about_of(section),
        "properties": {
            name: {"description": f"{key.about}; {allowed(key)}", **value_schema(key)}
            for name, key in keys_of(section).items()
        },
        **(
            {"anyOf": [{"required": way} for way in ways]}
            if section.unless
            else {"required": required}
        ),
        "additionalProperties": False,
    }


def value_schema(key: Key) -> Document:
    """JSON Schema of a key's value, as far as it can tell; units are left to `alphacut check`."""
    if key.kind == "text":
        return {"type": "string"}
    if key.kind == "flag":
        return {"type": "boolean"}
    if key.kind == "choice":
        return {"enum": list(key.choices)}
    if key.kind == "choices":
        return {
            "type": "array",
            "items": {"enum": list(key.choices)} if key.choices else {"type": "string"},
        }
    if key.kind == "integer":
        return {"type": "integer", **limits(key)}
    single = quantity_schema(key)
    if key.kind not in ("numbers", "fuzzy list"):
        return single
    listed = {"type": "array", "items": single, "minItems": 1}
    return {"anyOf": [listed, {"type": ["string", "number"]}]} if key.alone else listed


def quantity_schema(key: Key) -> Document:
    """A quantity: text with its unit, or, where it has none, bare numbers too."""
    text = {"type": "string", "examples": [QUANTITIES[key.unit][1]]}
    if key.unit:
        return text
    return {
        "anyOf": [
            {"type": "number", **limits(key)},
            text,
            *([NUMBERS] if key.kind == "fuzzy" else []),
        ]
    }


def limits(key: Key) -> dict[str, float]:
    """The key's range in JSON Schema's words."""
    if key.allowed is None:
        return {}
    low = "minimum" if key.allowed.closed else "exclusiveMinimum"
    high = "maximum" if key.allowed.closed and not key.allowed.below else "exclusiveMaximum"
    return {
        name: end
        for name, end in ((low, key.allowed.lower), (high, key.allowed.upper))
        if math.isfinite(end)
    }


def text() -> str:
    """The schema as it is stored beside the cases."""
    return json.dumps(json_schema(), indent=2, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    print(text(), end="")
