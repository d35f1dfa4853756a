"""Types of the keys of a case: quantities with their unit and range, levels, files."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self, TypeVar

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    PlainValidator,
    Tag,
    ValidationInfo,
    model_validator,
)
from pydantic.annotated_handlers import GetCoreSchemaHandler
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, core_schema

from alphacut.base import quantity as base
from alphacut.base.errors import RefusedError, is_number, require
from alphacut.base.seen_folders import unseen
from alphacut.fuzzy import FuzzyNumber
from alphacut.io import quantity
from alphacut.io.quantity import QUANTITIES
from alphacut.rve.cell.cell import VoigtPhase


class Section(BaseModel):
    """One table of a case file; built, it does not change.

    What a key is stands below "Args:" in the docstring of its class.
    """

    # An unknown key is refused, since it is a misspelt one, whose default would act in silence.
    # Sections are frozen because stages are kept by the digest of what they were made from.
    model_config = ConfigDict(
        extra="forbid", frozen=True, arbitrary_types_allowed=True, defer_build=True
    )

    made_from: ClassVar[Any] = object
    """The dataclass that a section is made from, which describes its keys then."""

    @classmethod
    def described_fields(cls) -> dict[str, FieldInfo]:
        """Return the fields of the section by key, each with a description of what the key is.

        Those that no field has stand below "Args:" in docstrings, and are added in place.
        """
        # They are read where they are shown: each command would wait for texts that few show.
        for of in (*cls.made_from.__mro__, *cls.__mro__):
            for key, about in descriptions(of).items():
                info = cls.model_fields.get(key)
                if info is not None and info.description is None:
                    info.description = about
        return cls.model_fields

    def has_key(self, key: str) -> bool:
        """True if the file gives the key, so that no default stands in."""
        return key in self.model_fields_set

    def require_consistent(self) -> None:
        """Refuses values that do not fit each other, once each key has its value."""

    @model_validator(mode="after")
    def _validate(self) -> Self:
        self.require_consistent()
        return self


def descriptions(of: type) -> dict[str, str]:
    """Return what the docstring of a class says of each argument below "Args:", by name."""
    _, _, text = (inspect.getdoc(of) or "").partition("Args:\n")
    found = re.findall(r"^    (\w+): ((?:.+\n?)(?:^ {8}.+\n?)*)", text, re.MULTILINE)
    return {name: " ".join(about.split()).rstrip(".") for name, about in found}


class Quantity(base.Quantity):
    """Type of a key that holds a quantity: its unit and range, and how it is read from a case."""

    @property
    def allowed(self) -> str:
        """Return the allowed values in words, such as 'a length above 0, as "2 m"'.

        The words are the dimension or "whole number", then each finite bound of the range in SI
        units, and an example with a unit if there is one. The bounds `above` and `below` are not
        allowed values themselves, `minimum` and `maximum` are.
        """
        dimension = QUANTITIES[self.si]
        words = dimension.name
        if self.is_integer:
            words = "whole number"
        bounds = {
            "above": self.above,
            "from": self.minimum,
            "below": self.below,
            "up to": self.maximum,
        }
        for word, bound in bounds.items():
            if math.isfinite(bound):
                words += f" {word} {bound:g}"
        if self.si:
            words += f', as "{dimension.example}"'
        return words

    def parse(self, value: object) -> FuzzyNumber | float | int:
        """Return the quantity in SI that a value of the case states, such as "80 GPa ± 5 %".

        Args:
            value: Text with a unit; a number or a list of numbers where no unit is needed.

        Returns:
            A fuzzy number if `fuzzy` is set, an int if `is_integer` is, else a float.

        Raises:
            RefusedError: The value is no such quantity, or it leaves the range at either end of its
                support. The hint of the quantity, `cure`, is part of the message if it has one.
        """
        number: FuzzyNumber | float | int
        reason = "write a number without quotes and without a unit"
        try:
            # True is an int in Python, but no number in TOML.
            if self.is_integer and isinstance(value, int) and not isinstance(value, bool):
                number = value
            elif self.is_integer:
                raise ValueError(reason)
            elif not self.si and isinstance(value, str) and "%" not in value and "[" not in value:
                raise ValueError(f'{reason}, or "5 %" for 0.05')
            elif self.fuzzy:
                number = quantity.parse_fuzzy(value, self.si)
            else:
                number = quantity.parse_number(value, self.si)
        except ValueError as error:
            cure = str(error)
            if self.cure:
                cure += f"; {self.cure}"
            raise RefusedError("", value, self.allowed, cure) from None
        # A value that is possible at all must be allowed: the whole support lies in the range if
        # both its ends do.
        ends: list[float] = []
        if isinstance(number, FuzzyNumber):
            ends.extend(number.support)
        else:
            ends.append(number)
        if not self.admits(min(ends), max(ends)):
            cure = self.cure or self._cure_of_percentage(value, ends)
            raise RefusedError("", value, self.allowed, cure)
        return number

    def _cure_of_percentage(self, value: object, ends: Sequence[float]) -> str:
        """Return what to write for a ratio that is too large, but would fit as a percentage.

        Args:
            value: The refused value, of any type.
            ends: The number, or the ends of its support.

        Returns:
            A text such as 'write "5 %" or 0.05' for a value without a unit whose hundredth part is
            positive and in the range. Empty for all other values, for quantities with a unit and
            for whole numbers.
        """
        if self.si or self.is_integer or "%" in str(value):
            return ""
        # 5 for 5 % is the usual slip: it is named where the hundredth part would be allowed.
        is_meant = min(ends) > 0 and self.admits(min(ends) / 100, max(ends) / 100)
        if not is_meant:
            return ""
        if is_number(value):
            return f'write "{value} %" or {ends[0] / 100:g}'
        return f'write "{value} %"'

    def __get_pydantic_core_schema__(
        self, source: object, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema by which Pydantic calls `parse`."""
        return core_schema.no_info_plain_validator_function(self.parse)


@dataclass(frozen=True)
class FirstUse:
    """Metadata of the class of a section, which is made ready once a case has the section.

    Without it Pydantic makes the validators of all sections before it reads a case, in .05 s.

    Args:
        load: Function that imports the class, and returns it; None where it is the annotated one.
    """

    load: Callable[[], type[Section]] | None = None

    def __get_pydantic_core_schema__(
        self, source: type[Section], _: GetCoreSchemaHandler
    ) -> CoreSchema:
        """Return the schema by which Pydantic calls the class, and takes its errors as its own."""

        def read(value: object, info: ValidationInfo) -> Section:
            """Return the section that a table of the case states."""
            section = source if self.load is None else self.load()
            return section.model_validate(value, context=info.context)

        return core_schema.with_info_plain_validator_function(read)


text = PlainValidator
"""A key whose text a function reads, from the text and the context of the case."""


def _not_empty(value: object) -> object:
    require(bool(value) or not isinstance(value, list | tuple), "", "[]", "one entry or more")
    return value


def _as_array(value: object) -> object:
    return _not_empty(value) if isinstance(value, list | tuple) else [value]


T = TypeVar("T")
AtFirstUse = Annotated[T, FirstUse()]
"""A section that many cases leave out."""
OneOrMany = Annotated[tuple[T, ...], BeforeValidator(_as_array)]
"""An array of which one entry may stand without brackets."""
NotEmpty = BeforeValidator(_not_empty)


def rising(values: tuple[float, ...]) -> tuple[float, ...]:
    """The numbers as they are, if they rise strictly."""
    is_rising = bool(values) and list(values) == sorted(set(values))
    require(is_rising, "", list(values), "numbers in rising order")
    return values


def case_file(value: object, info: ValidationInfo) -> Path:
    """Return the path of a file that the case names, relative to the folder of the case.

    Args:
        value: Name of the file as the case has it.
        info: Context of the validation, whose "folder" is the folder of the case.

    Raises:
        RefusedError: The value is no text, or names no file that can be reached.
    """
    folder: Path = (info.context or {}).get("folder", Path())
    reason = ""
    try:
        is_file = isinstance(value, str) and (folder / value).is_file()
    except OSError as error:  # of a name that is too long, or a folder that may not be entered
        is_file = False
        reason = (error.strerror or str(error)).lower()
    if not isinstance(value, str) or not is_file:
        reason = reason or unseen(folder / str(value))
        raise RefusedError("", value, f"a file, from the folder {folder.absolute()}", reason)
    return folder / value


def case_path(value: object, info: ValidationInfo) -> Path:
    """As `case_file`, of a file or a folder."""
    folder: Path = (info.context or {}).get("folder", Path())
    with suppress(OSError):  # which `case_file` says
        if isinstance(value, str) and value and (folder / value).is_dir():
            return folder / value
    return case_file(value, info)


def distinct(values: tuple[str, ...]) -> tuple[str, ...]:
    """The names as they are, if no two are the same."""
    require(len(set(values)) == len(values), "", ", ".join(values), "each name once")
    return values


def require_alone(key: str, is_there: bool, other: str) -> None:
    """Refuses a key or section that stands beside another one for the same thing."""
    require(not is_there, key, f"beside {other}", "one of them")


after = AfterValidator
"""A check of a value that has its type."""
CaseFile = Annotated[Path, text(case_file)]
CasePath = Annotated[Path, text(case_path)]
Names = Annotated[OneOrMany[str], after(distinct)]

Modulus = Annotated[FuzzyNumber, Quantity("Pa", above=0, fuzzy=True)]


def _stiffness(rows: list[list[object]]) -> VoigtPhase:
    """Return the phase with a plane-strain stiffness that three rows of three moduli state.

    Args:
        rows: Moduli as texts with units, such as "90 GPa", in the order 11, 22, 12 of Voigt's
            notation, whose third strain is 2 ε12.

    Raises:
        RefusedError: There are other rows, a unit is wrong, or the stiffness is not symmetric and
            positive definite.
    """
    try:
        moduli = [tuple(quantity.parse_number(entry, "Pa") for entry in row) for row in rows]
        return VoigtPhase(tuple(moduli))
    except (TypeError, ValueError) as error:
        allowed = 'three rows as ["90 GPa", "20 GPa", "0 GPa"], symmetric positive definite'
        # Other reasons, such as the length of a row, are said by the allowed values.
        cure = ""
        if "the unit" in str(error):
            cure = str(error)
        raise RefusedError("", rows, allowed, cure) from None


Stiffness = Annotated[VoigtPhase, PlainValidator(_stiffness)]
ModulusOrStiffness = Annotated[
    Annotated[Modulus, Tag("<modulus>")] | Annotated[Stiffness, Tag("<stiffness>")],
    Discriminator(lambda value: "<stiffness>" if isinstance(value, list) else "<modulus>"),
]
Loss = Annotated[FuzzyNumber, Quantity(minimum=0, maximum=0.5, fuzzy=True)]
# An isotropic solid has positive bulk and shear moduli for −1 < ν < 1/2 alone.
Ratio = Annotated[FuzzyNumber, Quantity(above=-1, below=0.5, fuzzy=True)]

Time = Annotated[float, Quantity("s", above=0)]
Length = Annotated[float, Quantity("m", above=0)]
Fraction = Annotated[float, Quantity(above=0, below=1)]
Level = Annotated[float, Quantity(minimum=0, maximum=1)]
Levels = Annotated[tuple[Level, ...], after(rising)]
ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)
"""α-levels where a case names none."""
