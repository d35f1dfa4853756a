"""Unit and range of a field of a public dataclass, as metadata of `Annotated`."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A quantity with its unit and range, `Annotated[float, Quantity("m", above=0)]`.

    In Python the field is a number in the SI unit. A case states it with a unit, from which the
    number is read. Every value that the quantity may take lies in the range: all of a fuzzy
    number's support.

    Args:
        si: SI unit, such as "N/m"; empty for a number without a unit.
        above: Value that the range does not reach from above.
        minimum: Smallest value in the range.
        below: Value that the range does not reach from below.
        maximum: Largest value in the range.
        fuzzy: Whether the quantity may be fuzzy in a case.
        is_integer: Whether it is a whole number.
        cure: What to give in place of a value that is refused.
    """

    si: str = ""
    above: float = -math.inf
    minimum: float = -math.inf
    below: float = math.inf
    maximum: float = math.inf
    fuzzy: bool = False
    is_integer: bool = False
    cure: str = ""
