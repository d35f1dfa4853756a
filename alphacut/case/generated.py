"""Sections of a case that are made from the options of an analysis in Python."""

from __future__ import annotations

import inspect
import re
from collections.abc import Sequence
from dataclasses import MISSING, asdict, fields, replace
from functools import cache, reduce
from operator import or_
from pkgutil import resolve_name
from types import UnionType
from typing import Annotated, Any, ClassVar, Self, Union, cast, get_args, get_origin, get_type_hints

from pydantic import Field, create_model

from alphacut.base import quantity
from alphacut.base.errors import require
from alphacut.case.limits import AnalysisSection, AnyLimit, CaseLimit, Limits, QuestionSection
from alphacut.case.structure import Structure
from alphacut.case.types import Levels, Names, OneOrMany, Quantity, Section
from alphacut.frame import Limit
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.structures.storey import yields

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
    made: type[GeneratedSection] = create_model(question.__name__, __base__=base, **keys)
    made.__doc__ = inspect.getdoc(question)
    made.key = key
    made.made_from = question
    for fact in ("reads_peaks", "needs_magnitudes", "records", "all_angles"):
        setattr(made, fact, getattr(question, fact))
    return made


def _in_a_case(hint: Any) -> Any:
    """Return the type of a key from that of a field: quantities are read with their units."""
    if isinstance(hint, quantity.Quantity):
        return Quantity(**asdict(hint))
    arguments = get_args(hint)
    origin = get_origin(hint)
    if origin is Annotated:
        return Annotated[tuple(map(_in_a_case, arguments))]
    if origin is tuple and arguments[0] is Limit:
        return Limits
    # One quantity may stand without the brackets of its array.
    if origin is tuple and get_origin(arguments[0]) is Annotated and arguments[-1] is ...:
        return cast("Any", OneOrMany)[_in_a_case(arguments[0])]
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

    made_from: ClassVar[type[Question]]

    @property
    def stated(self) -> dict[str, Any]:
        """The values of all keys."""
        return {name: getattr(self, name) for name in type(self).model_fields}

    def question(self, structure: Structure) -> Question:
        """Return the question, with limits in the units of the outputs of the structure."""
        return self.made_from(**self.stated)

    def require_consistent(self) -> None:
        """Refuse what fields forbid each other, and fields beside the one that replaces them."""
        super().require_consistent()
        for key, others in self.made_from.replaced.items():
            given = ", ".join(x for x in others if self.has_key(x) and getattr(self, key))
            require(not given, f"{self.key}.{key}", f"beside {given}", "one of them")
        with self.by_its_keys():
            self.made_from(**self.stated)

    def require_answerable(self, structure: Structure, components: int) -> None:
        """Refuse what the question refuses of the nominal structure."""
        with self.by_its_keys():
            self.question(structure).require(structure.model, components)
        # A modulus E that stage modulus computes is still crisp here, and may be random in the run.
        random = [name for name in getattr(self, "random", ()) if name != "E"]
        structure.inputs(random, f"{self.key}.random")
        for name in self.made_from.of_yielding:
            is_used = yields(structure.model) or not self.has_key(name)
            value = getattr(self, name)
            require(is_used, f"{self.key}.{name}", value, "beside columns that yield")

    def require_computable(self, structure: Structure, fuzzy: Sequence[str]) -> None:
        """Refuse what the question refuses of the inputs."""
        asked = Asked(structure.model, structure.inputs(fuzzy), (0.0,))
        with self.by_its_keys():
            self.question(structure).require_computable(asked)


class GeneratedQuestion(GeneratedSection, QuestionSection):
    """Keys that are the fields of a question, with limits and perhaps states, of limits each."""

    def with_storeys(self, structure: Structure) -> Self:
        """Return the section with each limit of every storey as one limit for each storey.

        The limits of states are among them, each with its state as its event.
        """
        limits = list(super().with_storeys(structure).limits)
        for name, members in self._states_of(structure).items():
            limits += [replace(limit, event=name) for limit in members]
        return self.model_copy(update={"limits": tuple(limits)})

    def _states_of(self, structure: Structure) -> dict[str, list[CaseLimit]]:
        """Return the limits of each state by its name, one for each storey."""
        states: dict[str, tuple[CaseLimit, ...]] = getattr(self, "states", {})
        return {
            name: [x for limit in members for x in limit.by_storey(structure)]
            for name, members in states.items()
        }

    def question(self, structure: Structure) -> Question:
        """Return the question, with limits in the units of the outputs of the structure."""
        values = self.stated
        key = f"{self.key}.limits"
        if self.limits:
            values["limits"] = self.limits_of(structure)
        if states := self._states_of(structure):
            limits = {name: [x.limit(structure, key) for x in y] for name, y in states.items()}
            values |= {"limits": (), "states": limits}
        return self.made_from(**values)
