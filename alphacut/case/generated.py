"""Sections of a case that are made from the options of an analysis in Python."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import MISSING, asdict, fields
from functools import cache, reduce
from operator import or_
from pkgutil import resolve_name
from types import UnionType
from typing import Annotated, Any, Union, cast, get_args, get_origin, get_type_hints

from pydantic import Field, create_model

from alphacut.base import quantity
from alphacut.base.errors import RefusedError
from alphacut.case.limits import AnalysisSection, AnyLimit, QuestionSection
from alphacut.case.structure import Structure
from alphacut.case.types import Levels, Names, Quantity, Section
from alphacut.frame.analyses.question import Asked, Question

KINDS: dict[str, Any] = {"fuzzy": Names, "outputs": Names, "alpha": Levels}
"""Types of keys that all sections read alike."""


@cache
def section_at(key: str, place: str) -> type[Section]:
    """Return the section of a case with a key.

    Args:
        key: Name of the section.
        place: "module:Class" of a `Section`; or of a `Question`, whose fields are the keys.
    """
    found = resolve_name(place)
    if issubclass(found, Section):
        return cast("type[Section]", found)
    return section_of(key, found)


def section_of(key: str, question: type[Question]) -> type[AnalysisSection]:
    """Return the section whose keys are the fields of a question, a frozen dataclass.

    Units and ranges are those of the fields' `Quantity`, descriptions those of the docstring below
    "Args:". Limits are read as in [decision].
    """
    hints = get_type_hints(question, include_extras=True)
    described = descriptions(question)
    keys: dict[str, Any] = {}
    for x in fields(cast("Any", question)):
        default: Any = ... if x.default is MISSING else x.default
        if x.default_factory is not MISSING:
            default = x.default_factory()
        if x.name != "limits":
            kind = KINDS.get(x.name) or _in_a_case(hints[x.name])
            keys[x.name] = (kind, Field(default, description=described[x.name]))
        elif default is not ...:
            keys[x.name] = (tuple[AnyLimit, ...], Field((), description=described[x.name]))
    base = GeneratedQuestion if "limits" in hints else GeneratedSection
    made: type[AnalysisSection] = create_model(question.__name__, __base__=base, **keys)
    made.__doc__ = inspect.getdoc(question)
    made.key = key
    made.made_from = question  # type: ignore[attr-defined]
    made.reads_peaks = question.reads_peaks
    made.needs_magnitudes = question.needs_magnitudes  # type: ignore[attr-defined]
    made.records = question.records
    return made


def _in_a_case(hint: Any) -> Any:
    """Return the type of a key from that of a field: quantities are read with their units."""
    if isinstance(hint, quantity.Quantity):
        return Quantity(**asdict(hint))
    arguments = get_args(hint)
    origin = get_origin(hint)
    if origin is Annotated:
        return Annotated[tuple(map(_in_a_case, arguments))]
    if origin in (tuple, dict):
        return origin[tuple(map(_in_a_case, arguments))]
    if origin in (Union, UnionType):
        return reduce(or_, map(_in_a_case, arguments))
    return hint


def descriptions(of: type) -> dict[str, str]:
    """Return what the docstring of a class says of each argument below "Args:", by name."""
    _, _, text = (inspect.getdoc(of) or "").partition("Args:\n")
    found = re.findall(r"^    (\w+): ((?:.+\n?)(?:^ {8}.+\n?)*)", text, re.MULTILINE)
    return {name: " ".join(about.split()) for name, about in found}


class GeneratedSection(AnalysisSection):
    """Keys that are the fields of a question."""

    def question(self, structure: Structure) -> Question:
        """Return the question, with limits in the units of the outputs of the structure."""
        values = {name: getattr(self, name) for name in type(self).model_fields}
        if isinstance(self, QuestionSection) and self.limits:
            values["limits"] = self.limits_of(structure)
        made_from: type[Question] = type(self).made_from  # type: ignore[attr-defined]
        return made_from(**values)

    def require_answerable(self, structure: Structure, components: int) -> None:
        """Refuse what the question refuses of the nominal structure."""
        with self._by_its_keys():
            self.question(structure).require(structure.model)

    def require_computable(self, structure: Structure, fuzzy: Sequence[str]) -> None:
        """Refuse what the question refuses of the inputs."""
        asked = Asked(structure.model, structure.inputs(fuzzy), (0.0,))
        with self._by_its_keys():
            self.question(structure).require_computable(asked)

    @contextmanager
    def _by_its_keys(self) -> Iterator[None]:
        """Replace the name of a field in a RefusedError raised in the block by its key."""
        try:
            yield
        except RefusedError as error:
            key = error.key if error.key.startswith(f"{self.key}.") else f"{self.key}.{error.key}"
            raise RefusedError(key, error.value, error.allowed, error.cure) from None


class GeneratedQuestion(GeneratedSection, QuestionSection):
    """Keys that are the fields of a question, with limits."""
