"""The kinds of structures of a case, by the names of their sections.

A new kind is a file with its section, a `StructureSection` that gives a `StructureModel`, and one
entry here; of another distribution, an entry point in the group "alphacut.structures".
`demos/templates/structure.py` is one to copy.
"""

from __future__ import annotations

from collections.abc import Collection
from functools import cache, partial
from typing import Annotated, Any, TypeVar, cast

from pydantic import create_model

from alphacut.base.entry_points import registered
from alphacut.case.analyses import ANALYSES
from alphacut.case.cell import CellContent
from alphacut.case.types import FirstUse, Section

C = TypeVar("C", bound=CellContent)
STRUCTURES = {
    "frame": "alphacut.case.structure:Frame",
    "pendulum": "alphacut.case.structure:Pendulum",
    "matrices": "alphacut.case.matrices:MatricesSection",
}
"""Module and class of each section. The cell's commands know the names, and import none."""


def with_structures(content: type[C], names: Collection[str] = (), *, built: bool) -> type[C]:
    """Return a class of cases that also has a field for each kind of structure and each analysis.

    Args:
        content: The class without them.
        names: Names of the sections of the case. Structures of other distributions are looked for
            where one of them is none of the project's own.
        built: Whether the sections are validated and built, for which their modules are imported
            once a case has the section; otherwise they are kept as the tables that stand in the
            file.

    Returns:
        The class. The fields of structures stand after the fields that `content` inherits, and
        before its own; those of analyses stand behind. Errors are reported in this order.
    """
    analyses = {key: analysis.section for key, analysis in ANALYSES.items() if analysis.section}
    structures = dict(STRUCTURES)
    unknown = set(names) - set(content.model_fields) - set(analyses) - set(structures)
    if unknown:
        others = registered("alphacut.structures")
        structures |= {name: others[name] for name in unknown & set(others)}
    places = tuple(structures.items()), tuple(analyses.items())
    return cast("type[C]", _whole_case(content, *places, built=built))


@cache  # Pydantic takes 50 ms for the class, and tests read many cases
def _whole_case(
    content: type[CellContent],
    structures: tuple[tuple[str, str], ...],
    analyses: tuple[tuple[str, str], ...],
    *,
    built: bool,
) -> type[CellContent]:
    """Return a class of cases with a field for the section of each structure and analysis.

    The class is created once for each set of arguments. Its name and docstring are those of
    `content`.

    Args:
        content: Class of cases without sections of structures.
        structures: Pairs of the name of a section, such as "frame", and of the place "module:Class"
            of its class.
        analyses: The same of each analysis.
        built: Whether the fields take sections of these classes, or any value. Each may be left
            out, and is None then.

    """
    fields: list[dict[str, Any]] = []  # of structures, and of analyses
    for places in (structures, analyses):
        kinds: dict[str, Any] = dict.fromkeys(dict(places), object)
        if built:
            for name, place in places:
                kinds[name] = Annotated[object, FirstUse(partial(_section_at, name, place))] | None
        fields.append({name: (kind, None) for name, kind in kinds.items()})

    # Pydantic takes fields from the last base on: of the cell, of the structures, of the rest, and
    # at last those of analyses.
    of_structures = create_model("Structures", __base__=CellContent, **fields[0])
    bases: Any = (content, of_structures)
    whole: type[CellContent] = create_model(content.__name__, __base__=bases, **fields[1])
    whole.__doc__ = content.__doc__
    return whole


def _section_at(key: str, place: str) -> type[Section]:
    """Return the section of a case with a key, from its place "module:Class"."""
    from alphacut.case.generated import section_at  # imports the rooms, which a cell does without

    return section_at(key, place)
