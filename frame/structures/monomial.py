"""Products of powers of parameters, such as E I l⁻², read from text without evaluating it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from alphacut.fuzzy.refused import RefusedError

NAME = r"[A-Za-z_][A-Za-z0-9_]*"
NUMBER = r"[0-9]*\.?[0-9]+(?:[eE][-+]?[0-9]+)?"
FACTOR = re.compile(
    rf"\s*(?:(?P<name>{NAME})|(?P<number>{NUMBER}))\s*(?:(?:\^|\*\*)\s*(?P<power>-?[0-9]+))?\s*"
)
ALLOWED = 'a product of powers of parameters, as "1", "Ec" or "2*E*I*l^-2"'


@dataclass(frozen=True)
class Monomial:
    """The function c Π pᵢ^kᵢ of named parameters.

    Args:
        coefficient: c.
        powers: Names with their whole exponents, none 0.

    Example:
        >>> stiffness = Monomial.parse("12*E*I/l^3")
        >>> stiffness({"E": 2.0, "I": 3.0, "l": 2.0})
        9.0
    """

    coefficient: float
    powers: tuple[tuple[str, int], ...]

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the monomial of a text such as "12*E*I/l^3", of ``*``, ``/`` and ``^`` or ``**``.

        Raises:
            RefusedError: The text is another kind of expression.
        """
        coefficient, powers = 1.0, dict[str, int]()
        parts = re.split(r"(?<!\*)([*/])(?!\*)", text)  # factors, with single * and / between
        for operator, part in zip(["*", *parts[1::2]], parts[::2], strict=True):
            match = FACTOR.fullmatch(part)
            if match is None:
                raise RefusedError("factor", repr(text[:60]), ALLOWED)
            power = int(match["power"] or 1) * (1 if operator == "*" else -1)
            if name := match["name"]:
                powers[name] = powers.get(name, 0) + power
            else:
                coefficient *= float(match["number"]) ** power
        return cls(coefficient, tuple((name, k) for name, k in powers.items() if k))

    def __call__(self, p: Mapping[str, Any]) -> Any:
        """Value at parameters, which may be numbers, arrays or anything with × and powers."""
        value: Any = self.coefficient
        for name, power in self.powers:
            value = p[name] ** power * value if power != 1 else p[name] * value
        return value

    @property
    def simplest(self) -> Monomial | str | float:
        """The number or the parameter's name if the monomial is one; else the monomial itself."""
        if not self.powers:
            return self.coefficient
        if self.coefficient == 1 and len(self.powers) == 1 and self.powers[0][1] == 1:
            return self.powers[0][0]
        return self
