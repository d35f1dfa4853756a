"""Fuzzy arithmetic by α-cuts, where it is exact: every number occurs once.

Interval arithmetic on the cuts takes its operands as independent. Where the same number occurs
twice, x − x for one, the result would be
too wide: the dependency problem. It is refused by name; `propagate` treats such expressions as the
    functions that they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from operator import add, mul, sub, truediv

import numpy as np

from alphacut.fuzzy.sets.claimed import Claimed
from alphacut.fuzzy.sets.numbers import OPERATORS, Array, Crisp, Cut, Cuts, FuzzyNumber

Binary = Callable[[float, float], float]
_SAMPLED = 64  # steps by which a curved membership is shown
_OPERATIONS: dict[str, Binary] = {"+": add, "-": sub, "*": mul, "/": truediv}


class DependencyError(ValueError):
    """An expression that arithmetic by α-cuts gets wrong: a number occurs twice, or two claim."""


@dataclass(frozen=True, eq=False)
class Expression(FuzzyNumber):
    """Outcome of fuzzy arithmetic: exact at every α.

    Args:
        at: The cut at a level.
        text: The expression in words, for messages.
        sources: The numbers that occur in it.
    """

    at: Callable[[float], Cut] = field(repr=False)
    text: str
    sources: tuple[FuzzyNumber, ...] = field(repr=False)

    def cut(self, alpha: float) -> Cut:
        """The set of values with membership at least `alpha` in [0, 1]."""
        if not 0 <= alpha <= 1:
            raise ValueError(f"the α of a cut is {alpha:g}; it must lie in [0, 1]")
        cut = self.at(alpha)
        if not np.isfinite(cut).all():
            raise ValueError(
                f"the cut of {self.text} at α = {alpha:g} is {list(cut)}: the numbers are too"
                " large, or a function has no value"
            )
        return cut

    def known(self, alpha: float) -> float:
        """Greatest level up to `alpha` whose cut is no wider than it is told."""
        return min([alpha, *(number.known(alpha) for number in self.sources)])

    @property
    def cuts(self) -> Cuts:
        """Cuts at 65 levels, between which the membership is drawn straight."""
        levels = tuple(float(level) for level in np.linspace(0, 1, _SAMPLED + 1))
        ends = [self.cut(level) for level in levels]
        return Cuts(levels, tuple(end.lower for end in ends), tuple(end.upper for end in ends))


def combine(sign: str, left: FuzzyNumber | float, right: FuzzyNumber | float) -> Expression:
    """Left + right, left - right, left * right or left / right.

    Raises:
        DependencyError: A number occurs on both sides, or two have claims.
        ValueError: The divisor's support holds 0.
    """
    operands = [side if isinstance(side, FuzzyNumber) else Crisp(side) for side in (left, right)]
    texts = [_text(operand) for operand in operands]
    sources = [_sources(operand) for operand in operands]
    twice = [number for number in sources[0] if any(number is other for other in sources[1])]
    if twice:
        cure = (
            "arithmetic by α-cuts would take the two as independent and give too wide a result: use"
            " propagate on the whole expression"
        )
        raise DependencyError(
            f"{twice[0]} occurs on both sides of {texts[0]} {sign} {texts[1]}; {cure}"
        )
    if sum(isinstance(number, Claimed) for number in (*sources[0], *sources[1])) > 1:
        raise DependencyError(
            f"{texts[0]} {sign} {texts[1]} joins numbers with claims, whose cuts at one α hold all"
            " of them less often than each: use propagate on the whole expression"
        )
    if sign == "/" and operands[1].support.lower <= 0 <= operands[1].support.upper:
        raise ValueError(
            f"the divisor {texts[1]} has a support that holds 0; its quotient has no bounds"
        )
    operation = _OPERATIONS[sign]

    def at(alpha: float) -> Cut:
        ends = [operation(a, b) for a, b in product(*(operand.cut(alpha) for operand in operands))]
        return Cut(min(ends), max(ends))

    return Expression(at, f"({texts[0]} {sign} {texts[1]})", sources[0] + sources[1])


def power(base: FuzzyNumber, exponent: float) -> Expression:
    """Base ** exponent for a whole exponent; the even powers of a number around 0 start at 0.

    Raises:
        ValueError: The exponent is no whole number, or negative with 0 in the support.
    """
    if not np.isfinite(exponent) or int(exponent) != exponent:
        raise ValueError(f"the exponent is {exponent}; it must be a whole number")
    exponent = int(exponent)
    if exponent < 0:
        return combine("/", 1.0, power(base, -exponent))

    def at(alpha: float) -> Cut:
        lower, upper = base.cut(alpha)
        ends = [
            lower**exponent,
            upper**exponent,
            *([0.0] if lower < 0 < upper and exponent else []),
        ]
        return Cut(min(ends), max(ends))

    return Expression(at, f"{_text(base)}**{exponent}", _sources(base))


def apply(
    function: Callable[[Array], Array], number: FuzzyNumber, *, falls: bool = False
) -> Expression:
    """A monotone function of one number, such as `numpy.exp`: its ends are the images of the ends.

    Args:
        function: Monotone over the support.
        number: The number.
        falls: Whether the function falls.

    Raises:
        ValueError: The function is seen to turn between 65 points of the support.
    """
    name = getattr(function, "__name__", "function")
    seen = np.array(
        [float(function(np.asarray(x))) for x in np.linspace(*number.support, _SAMPLED + 1)]
    )
    if (np.diff(seen) * (-1 if falls else 1) < -1e-12 * np.abs(seen).max()).any():
        way = "fall" if falls else "rise"
        raise ValueError(
            f"{name} does not {way} throughout {list(number.support)}; give falls={not falls}, or"
            " use propagate if it turns"
        )

    def at(alpha: float) -> Cut:
        ends = [float(function(np.asarray(end))) for end in number.cut(alpha)]
        return Cut(*(ends[::-1] if falls else ends))

    return Expression(at, f"{name}({_text(number)})", _sources(number))


def _text(number: FuzzyNumber) -> str:
    if isinstance(number, Expression):
        return number.text
    return f"{number.value:g}" if isinstance(number, Crisp) else str(number)


def _sources(number: FuzzyNumber) -> tuple[FuzzyNumber, ...]:
    """The numbers with a width that occur in an operand."""
    if isinstance(number, Expression):
        return number.sources
    return (number,) if number.support.width > 0 else ()


def _power(base: FuzzyNumber | float, exponent: FuzzyNumber | float) -> Expression:
    if not isinstance(base, FuzzyNumber) or isinstance(exponent, FuzzyNumber):
        raise TypeError("a fuzzy number is raised to a whole number, not to a fuzzy one")
    return power(base, exponent)


OPERATORS |= {sign: partial(combine, sign) for sign in _OPERATIONS} | {"**": _power}
