"""The kinds of structures of a case, by the names of their sections.

A new kind is a file with its section, a `StructureSection` that gives a `StructureModel`, and one
entry here.
"""

from __future__ import annotations

from functools import cache
from pkgutil import resolve_name
from typing import Annotated, Any, TypeVar, cast

from pydantic import create_model

from alphacut.case.cell import CellContent
from alphacut.case.types import FirstUse

C = TypeVar("C", bound=CellContent)
STRUCTURES = {
    "frame": "alphacut.case.structure:Frame",
    "pendulum": "alphacut.case.structure:Pendulum",
    "matrices": "alphacut.case.matrices:MatricesSection",
}
"""Module and class of each section. The cell's commands know the names, and import none."""


def with_structures(content: type[C], *, built: bool) -> type[C]:
    """Return a class of cases that also has a field for the section of each kind of structure.

    Args:
        content: The class without them.
        built: Whether the sections are validated and built, for which the modules of the structures
            are imported; otherwise they are kept as the tables that stand in the file.

    Returns:
        The class. The new fields stand after the fields that `content` inherits, and before its
        own. Errors are reported in this order.
    """
    return cast("type[C]", _whole_case(content, tuple(STRUCTURES.items()), built=built))


@cache  # Pydantic takes 50 ms for the class, and tests read many cases
def _whole_case(
    content: type[CellContent], structures: tuple[tuple[str, str], ...], *, built: bool
) -> type[CellContent]:
    """Return a class of cases with a field for the section of each kind of structure.

    The class is created once for each set of arguments. Its name and docstring are those of
    `content`.

    Args:
        content: Class of cases without sections of structures.
        structures: Pairs of the name of a section, such as "frame", and of the place "module:Class"
            of its class.
        built: Whether the fields take sections of these classes, or any value. Each may be left
            out, and is None then.

    Raises:
        ImportError: A class is to be built and its module cannot be imported.
    """
    fields: dict[str, Any] = {}
    for name, place in structures:
        kind: Any = object
        if built:
            section: Any = resolve_name(place)
            kind = Annotated[section, FirstUse()] | None
        fields[name] = (kind, None)  # the type of the field, and its default
    # Pydantic takes fields from the last base on: of the cell, of the structures, of the rest.
    bases: Any = (content, create_model("Structures", __base__=CellContent, **fields))
    whole: type[CellContent] = create_model(content.__name__, __base__=bases)
    whole.__doc__ = content.__doc__
    return whole
