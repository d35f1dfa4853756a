"""Limits of outputs, and the sections of the questions that are about them.

A limit is a text such as "drift1 <= 40 mm", "drift1 <= 0.5 %", "q3 <= 80 mm".
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field, PlainValidator

from alphacut.case.structure import Structure
from alphacut.case.types import Quantity, Section, Some
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io import quantity


@dataclass(frozen=True)
class Limit:
    """Largest magnitude allowed of an output.

    Args:
        output: Of the structure.
        value: In the SI unit of the output, or as a share of the storey's height.
        share: Whether it is such a share.
        text: The limit as the user wrote it.
    """

    output: str
    value: float
    share: bool
    text: str

    def si(self, structure: Structure, key: str) -> float:
        """Limit in the SI unit of its output.

        Raises:
            RefusedError: The structure has no height of the storey.
        """
        number = structure.numbers.get(self.output.replace("drift", "l"))
        if self.share and number is None:
            raise RefusedError(
                key, self.text, "a storey of the frame, whose length the share is of"
            )
        return self.value * number.modal if self.share and number else self.value


def parse_limit(value: object) -> Limit:
    """Limit that a text such as "drift1 <= 40 mm" states.

    Raises:
        RefusedError: The text is no output, "<=" and a positive quantity.
    """
    name, separator, text = (part.strip() for part in str(value).partition("<="))
    allowed = "an output, <= and a quantity, as 'drift1 <= 40 mm' or 'drift1 <= 0.5 %'"
    share = name.startswith("drift") and text.endswith("%")
    number, cure = 0.0, ""
    try:
        number = quantity.number(text, "" if share else Output(name).unit)
    except (ValueError, KeyError) as error:
        cure = str(error) if separator else ""
    is_limit = bool(separator) and re.fullmatch(r"\w+", name) is not None and number > 0
    require(is_limit, "", value=value, allowed=allowed, cure=cure)
    return Limit(name, number, share, str(value))


AnyLimit = Annotated[Limit, PlainValidator(parse_limit, json_schema_input_type=str)]
Limits = Annotated[tuple[AnyLimit, ...], Some]


class QuestionSection(Section):
    """A question about limits of outputs, as a section of the case.

    Its attributes are the name of the section, and whether the answer is read from the peaks of
    the limited outputs.
    """

    key: ClassVar[str]
    reads_peaks: ClassVar[bool] = False
    limits: Limits = Field(description="limits of outputs, 'drift1 <= 0.5 %', 'a3 <= 2 m/s^2'")

    def in_si(self, structure: Structure) -> dict[str, float]:
        """The limit of each output in its SI unit.

        Raises:
            RefusedError: The structure has no such output, or an output has two limits.
        """
        key = f"{self.key}.limits"
        values = {limit.output: limit.si(structure, key) for limit in self.limits}
        structure.observing(key, tuple(values))
        texts = ", ".join(limit.text for limit in self.limits)
        require(
            len(values) == len(self.limits), key, value=texts, allowed="one limit for each output"
        )
        return values

    def check(self, structure: Structure) -> None:
        """Refuses what the structure does not have.

        Raises:
            RefusedError: It has no such output or input.
        """
        self.in_si(structure)


class DecisionSection(QuestionSection):
    """Possibility and necessity that limits are exceeded."""

    key = "decision"
    reads_peaks = True


class ProbabilitySection(QuestionSection):
    """Fuzzy probability that limits are exceeded; inputs that are not random stay fuzzy."""

    key = "probability"

    random: tuple[str, ...] = Field(
        default=(), description="inputs that are random, with the shape of their membership"
    )
    samples: Annotated[int, Quantity(least=1, most=10_000, is_integer=True)] = Field(
        default=200, description="random draws at each fuzzy point"
    )

    def check(self, structure: Structure) -> None:
        """Refuses limits and random inputs that the structure does not have.

        Raises:
            RefusedError: It has no such output or input.
        """
        super().check(structure)
        structure.inputs([name for name in self.random if name != "E"], "probability.random")


class TolerancesSection(QuestionSection):
    """Largest scale of the supports of the fuzzy inputs at which no limit is exceeded."""

    key = "tolerances"
    reads_peaks = True

    most: Annotated[float, Quantity(above=0, most=100)] = Field(
        default=2.0, description="largest scale that is tried; 1 is that of the case"
    )


class FragilitySection(QuestionSection):
    """Share of the suite's records under which limits are exceeded, over a measure of records."""

    key = "fragility"
    reads_peaks = True

    measure: Literal["Sa(T1)", "PGA", "scale"] = Field(
        default="Sa(T1)", description="measure of a record; T1 and ζ are the nominal structure's"
    )
    independent: bool = Field(
        default=False, description="whether records count as independent draws: 95 % limits"
    )

    def check(self, structure: Structure) -> None:
        """Refuses structures that do not scale with their record.

        Raises:
            RefusedError: The structure is not linear, or moves without its record.
        """
        super().check(structure)
        moves = structure.linear is None or any(
            np.any(x)
            for x in (getattr(structure.linear, "q0", 0), getattr(structure.linear, "v0", 0))
        )
        moves = moves or bool(structure.linear and structure.linear.loads)
        allowed = "linear structures that start at rest, without forces: they scale with records"
        require(not moves, "fragility", value="of another motion", allowed=allowed)
