"""Limits of outputs as a case writes them: "drift1 <= 40 mm", "drift1 <= 0.5 %", "q3 <= 80 mm"."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

from pydantic import PlainValidator

from alphacut.case.structure import Structure
from alphacut.case.types import Some
from alphacut.frame.structures.quantities import Output
from alphacut.fuzzy.refused import RefusedError, require
from alphacut.io import quantity
from alphacut.io.units import engineering


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


def _limit(value: object) -> Limit:
    """Limit that a text says."""
    if isinstance(value, Limit):
        return value
    name, bound, text = (part.strip() for part in str(value).partition("<="))
    allowed = "an output, <= and a quantity, as 'drift1 <= 40 mm' or 'drift1 <= 0.5 %'"
    share = name.startswith("drift") and text.endswith("%")
    number, reason = 0.0, ""
    try:
        number = quantity.number(text, "" if share else Output(name).unit)
    except (ValueError, KeyError) as error:
        reason = str(error)
    whole = bool(bound) and re.fullmatch(r"\w+", name) is not None and number > 0
    require(whole, "", value, allowed, reason * bool(bound))
    return Limit(name, number, share, str(value))


One = Annotated[Limit, PlainValidator(_limit, json_schema_input_type=str)]
Limits = Annotated[tuple[One, ...], Some]


def in_words(output: str, limit: float, unit: str) -> str:
    """A limit for people: "|drift1| > 40.00 mm"; the event's name where it has no unit."""
    return f"|{output}| > {engineering(limit, unit)}" if unit else f"{output} exceeded"
