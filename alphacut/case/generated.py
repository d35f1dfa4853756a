"""Sections of a case that are made from the options of an analysis in Python."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import MISSING, asdict, fields, replace
from functools import cache, reduce
from operator import or_
from pkgutil import resolve_name
from types import UnionType
from typing import Annotated, Any, ClassVar, Self, Union, cast, get_args, get_origin, get_type_hints

from pydantic import Field, ValidationInfo, create_model

from alphacut.base import quantity
from alphacut.base.errors import by_keys, require
from alphacut.case.limits import AnyLimit, CaseLimit, Limits
from alphacut.case.structure import Structure
from alphacut.case.types import Levels, Names, OneOrMany, Quantity, Section, case_file, text
from alphacut.frame import Limit, TargetSpectrum, read_spectrum
from alphacut.frame.analyses.limits import limits_by_name
from alphacut.frame.analyses.question import Asked, Question
from alphacut.frame.structures.storey import yields

KINDS: dict[str, Any] = {"fuzzy": Names, "outputs": Names, "alpha": Levels}
"""Types of keys that all sections read alike."""


def _read_spectrum(value: object, info: ValidationInfo) -> TargetSpectrum:
    """Return the spectrum in a file that the case names."""
    return read_spectrum(case_file(value, info))


@cache
def section_at(key: str, place: str) -> type[Section]:
    """Return the section of a case with a key.

    Args:
        key: Name of the section.
        place: "module:Class" of a `Section`; or of a dataclass, whose fields are the keys.
    """
    found = resolve_name(place)
    if issubclass(found, Section):
        return cast("type[Section]", found)
    return section_of(key, found)


def section_of(key: str, of: type) -> type[MadeSection]:
    """Return the section whose keys are the fields of a frozen dataclass, as of a question.

    Units and ranges are those of the fields' `Quantity`, descriptions those of the docstring below
    "Args:". Limits are read as in [decision].
    """
    hints = get_type_hints(of, include_extras=True)
    keys: dict[str, Any] = {}
    for x in fields(of):
        default: Any = ... if x.default is MISSING else x.default
        if x.default_factory is not MISSING:
            default = x.default_factory()
        if x.name != "limits":
            kind = KINDS.get(x.name) or _in_a_case(hints[x.name])
            keys[x.name] = (kind, default)
        elif default is not ...:
            keys[x.name] = (tuple[AnyLimit, ...], ())
    base: type[MadeSection] = AnalysisSection if issubclass(of, Question) else MadeSection
    if "limits" in hints:
        base = QuestionSection
    made: type[MadeSection] = create_model(of.__name__, __base__=base, **keys)
    made.__doc__ = inspect.getdoc(of)
    made.key = key
    made.made_from = of
    return made


def _in_a_case(hint: Any) -> Any:
    """Return the type of a key from that of a field: quantities are read with their units."""
    if isinstance(hint, quantity.Quantity):
        return Quantity(**asdict(hint))
    if hint is TargetSpectrum:
        return Annotated[TargetSpectrum, text(_read_spectrum)]
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


class MadeSection(Section):
    """Keys that are the fields of a frozen dataclass; `key` is the name of the section."""

    key: ClassVar[str]

    @property
    def stated(self) -> dict[str, object]:
        """The values of all keys."""
        return {name: getattr(self, name) for name in type(self).model_fields}

    @property
    def made(self) -> object:
        """The object of the dataclass."""
        return self.made_from(**self.stated)

    def require_consistent(self) -> None:
        """Refuse what fields forbid each other."""
        super().require_consistent()
        with by_keys(self.key_of):
            _ = self.made

    def key_of(self, argument: str) -> str:
        """Return the key of the case for an argument.

        Fields are keys of the section, and "limit of …" is one of its limits. What is no key, as
        "structure", stands behind the name of the section. Keys of other sections have a point.
        """
        name = "limits" if argument.startswith("limit of") else argument
        if name in type(self).model_fields:
            return f"{self.key}.{name}"
        if "." in name or name == self.key:
            return name
        return f"{self.key}: {name}"


class AnalysisSection(MadeSection):
    """A section that asks for an analysis of the structure, or of its response.

    Its keys are the fields of a question, and so are `reads_peaks`, `needs_magnitudes`, `records`,
    `all_angles` and `of_learned_set` the facts of it.
    """

    made_from: ClassVar[type[Question]]

    def with_storeys(self, structure: Structure) -> Self:
        """Return the section with what it says of every storey said of each."""
        return self

    def question(self, structure: Structure) -> Question:
        """Return the question, with limits in the units of the outputs of the structure."""
        return self.made_from(**self.stated)

    def require_consistent(self) -> None:
        """Refuse what fields forbid each other, and fields beside the one that replaces them."""
        for key, others in self.made_from.replaced.items():
            given = ", ".join(x for x in others if self.has_key(x) and getattr(self, key))
            require(not given, f"{self.key}.{key}", f"beside {given}", "one of them")
        super().require_consistent()

    def require_answerable(self, structure: Structure, components: int) -> None:
        """Refuse what the structure cannot answer.

        Args:
            structure: Structure of the case.
            components: Number of components of the records that will move it; 0 without records.
        """
        with by_keys(self.key_of):
            self.question(structure).require(structure.model, components)
        # A modulus E that stage modulus computes is still crisp here, and may be random in the run.
        random = [name for name in getattr(self, "random", ()) if name != "E"]
        structure.inputs(random, f"{self.key}.random")
        for name in self.made_from.of_yielding:
            is_used = yields(structure.model) or not self.has_key(name)
            require(is_used, f"{self.key}.{name}", getattr(self, name), "beside columns that yield")

    def require_all_angles(self) -> None:
        """Refuse what is not answered over all angles of incidence of two components."""
        require(self.made_from.all_angles, self.key, "over all angles", "an angle in records.angle")

    def require_computable(self, structure: Structure, fuzzy: Sequence[str]) -> None:
        """Refuse what cannot be computed, once the structure has its materials.

        Args:
            structure: The structure; what a stage computes is fuzzy in it, of a width that is not
                known yet.
            fuzzy: Names of the fuzzy inputs of [envelope].
        """
        asked = Asked(structure.model, structure.inputs(fuzzy), (0.0,))
        with by_keys(self.key_of):
            self.question(structure).require_computable(asked)


class QuestionSection(AnalysisSection):
    """Keys of a question about limits of outputs, and perhaps about states, of limits each."""

    limits: Limits = Field(
        description="limits of outputs, 'drift1 <= 40 mm', 'max q3 <= 80 mm', 'min q3 >= -60 mm';"
        " 'drift <= 1 %' or 'drift <= 1/200' of the height of every storey, 'base_shear <= 8 %' of"
        " the weight"
    )

    def with_storeys(self, structure: Structure) -> Self:
        """Return the section with each limit of every storey as one limit for each storey.

        The limits of states are among them, each with its state as its event.
        """
        limits = [x for limit in self.limits for x in limit.by_storey(structure)]
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

    def limits_of(self, structure: Structure) -> tuple[Limit, ...]:
        """Return the limits of this question in SI units, in the order of the case.

        Args:
            structure: The structure. It gives units, heights of storeys and the weight, and says
                which outputs it can have; it need not observe them.

        Raises:
            RefusedError: The structure cannot have an output; a unit, height or weight does not
                fit; a limit is given twice; a limit of a magnitude is not positive; or there are
                others than one limit of the magnitude of each output, if the question needs this.
        """
        key = f"{self.key}.limits"
        limits = tuple(limit.limit(structure, key) for limit in self.limits)
        structure.require_quantities(key, list(dict.fromkeys(x.output for x in self.limits)))
        # Refuses limits that do not fit each other or the question; () stands for any outputs.
        with by_keys(self.key_of):
            limits_by_name(limits, (), magnitudes=self.made_from.needs_magnitudes)
        return limits

    def require_all_angles(self) -> None:
        """Refuse limits of one side over all angles, where only magnitudes are bounded."""
        super().require_all_angles()
        sides = ", ".join(limit.text for limit in self.limits if limit.side in ("max", "min"))
        allowed = "magnitudes over all angles, as roof <= 40 mm"
        require(not sides, f"{self.key}.limits", sides, allowed)
