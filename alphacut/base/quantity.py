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

    def admits(self, low: float, high: float) -> bool:
        """Return whether all values from `low` to `high` are finite and within the range.

        `low` must not be above `high`, which is not checked.
        """
        is_finite = math.isfinite(low) and math.isfinite(high)
        is_inside = self.above < low and high < self.below
        return is_finite and is_inside and self.minimum <= low and high <= self.maximum

    @property
    def range(self) -> str:
        """The range in words, such as "positive" or "0 to 1"; empty for any number."""
        if (self.above, self.below, self.maximum) == (0, math.inf, math.inf):
            return "positive"
        if math.isfinite(self.minimum) and math.isfinite(self.maximum):
            return f"{self.minimum:g} to {self.maximum:g}"
        bounds = {
            f"above {self.above:g}": self.above,
            f"{self.minimum:g} or greater": self.minimum,
            f"below {self.below:g}": self.below,
            f"up to {self.maximum:g}": self.maximum,
        }
        return " and ".join(text for text, bound in bounds.items() if math.isfinite(bound))
