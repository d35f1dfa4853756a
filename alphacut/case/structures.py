"""The kinds of structures of a case, by the names of their sections.

A new kind is a file with its section, a `StructureSection` that gives a `StructureModel`, and one
entry here.
"""

from __future__ import annotations

from functools import cache
from pkgutil import resolve_name
from typing import Any, TypeVar, cast

from pydantic import create_model

from alphacut.case.cell import CellContent

C = TypeVar("C", bound=CellContent)
STRUCTURES = {
    "frame": "alphacut.case.structure:Frame",
    "pendulum": "alphacut.case.structure:Pendulum",
    "matrices": "alphacut.case.matrices:MatricesSection",
}
"""Module and class of each section. The cell's commands know the names, and import none."""


def with_structures(content: type[C], *, built: bool) -> type[C]:
    """Return a class of cases with a field for the section of each kind of structure.

    Args:
        content: The class without them. They stand after the fields that it inherits.
        built: Whether sections are built, or kept as they stand in the file.
    """
    return cast("type[C]", _whole_case(content, tuple(STRUCTURES.items()), built=built))


@cache  # the class takes 50 ms, and tests read many cases
def _whole_case(
    content: type[CellContent], structures: tuple[tuple[str, str], ...], *, built: bool
) -> type[CellContent]:
    fields: dict[str, Any] = {}
    for name, place in structures:
        fields[name] = (resolve_name(place) | None if built else object, None)
    # Pydantic takes fields from the last base on: those of the cell, of structures, of the rest.
    bases: Any = (content, create_model("Structures", __base__=CellContent, **fields))
    whole: type[CellContent] = create_model(content.__name__, __base__=bases)
    whole.__doc__ = content.__doc__
    return whole
