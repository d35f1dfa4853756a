"""One published number beside the one found here."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import ROUND_CEILING, ROUND_FLOOR, ROUND_HALF_EVEN, Decimal

MINUS = "\N{MINUS SIGN}"
RANGE = re.compile(r"\[(?P<lower>[^,]+), (?P<upper>[^\]]+)\]")


@dataclass(frozen=True)
class Row:
    """A published number, and what this program finds.

    Args:
        quantity: What is compared.
        published: The number as its source prints it ("2.263250", "0.04"), a range "[-1, 2]", or
            a bound "≤ 0.0051".
        here: The same quantity here: a number, or its bounds (lower, upper).
        digits: Significant digits to print of `here`; bounds are rounded outward.
        unit: Unit of both, "" if they have none.
        tolerance: Relative distance from the published number that is agreement, beside half a unit
            of its last digit.
        remark: How the two were compared. Where `tolerance` is not 0 it says why they differ.
    """

    quantity: str
    published: str
    here: float | tuple[float, float]
    digits: int = 6
    unit: str = ""
    tolerance: float = 0.0
    remark: str = ""

    def __post_init__(self) -> None:
        if self.tolerance and not self.remark:
            raise ValueError(f"{self.quantity}: a tolerance needs a remark that says why")

    @property
    def agrees(self) -> bool:
        """Whether the published number may be what is found here.

        It may lie within the bounds here. A published range or bound has to hold all of them, but
        for half a unit of the last decimal of a range.
        """
        lower, upper = self.here if isinstance(self.here, tuple) else (self.here, self.here)
        if of := RANGE.fullmatch(self.published):
            ends = Decimal(of["lower"]), Decimal(of["upper"])
            places = [min(int(x.as_tuple().exponent), 0) for x in ends]
            half = [math.ldexp(10.0**place, -1) if place else 0.0 for place in places]
            return float(ends[0]) - half[0] <= lower and upper <= float(ends[1]) + half[1]
        if self.published.startswith("≤ "):
            return upper <= float(self.published.removeprefix("≤ "))
        number = Decimal(self.published)
        half_digit = math.ldexp(10.0 ** int(number.as_tuple().exponent), -1)
        away = half_digit + self.tolerance * abs(float(number))
        return lower <= float(number) + away and upper >= float(number) - away

    def cells(self) -> tuple[str, str, str, str]:
        """Quantity, published and own number with their unit, and the remark."""
        if isinstance(self.here, tuple):
            lower, upper = self.here
            ends = (
                rounded(lower, self.digits, ROUND_FLOOR),
                rounded(upper, self.digits, ROUND_CEILING),
            )
            here = f"[{ends[0]}, {ends[1]}]"
        else:
            here = rounded(self.here, self.digits, ROUND_HALF_EVEN)
        numbers = [f"{x} {self.unit}".strip().replace("-", MINUS) for x in (self.published, here)]
        return self.quantity, numbers[0], numbers[1], self.remark


def rounded(number: float, digits: int, rounding: str) -> str:
    """A number at so many significant digits, without exponent.

    Args:
        number: Finite.
        digits: At least 1.
        rounding: As `decimal` names it.
    """
    exact = Decimal(number)
    last_digit = Decimal(1).scaleb(exact.adjusted() + 1 - digits if exact else 0)
    return f"{exact.quantize(last_digit, rounding):f}"
