"""Functions of expressions and their derivatives, compiled by Numba."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sympy import Expr, Symbol

Filled = Callable[[Any, Any], None]
"""Takes the arguments and an array that it fills, both of shape (K,)."""


@dataclass(frozen=True, eq=False)
class Compiled:
    """Components f(x) and, behind them, derivatives by the first of the arguments.

    Args:
        components: m expressions.
        active: a variables to differentiate by.
        constants: Further arguments.
    """

    components: Sequence[Expr]
    active: Sequence[Symbol]
    constants: Sequence[Symbol]

    @cached_property
    def plain(self) -> Filled:
        """Fills an array (m,) with the components."""
        return filled(self.components, [*self.active, *self.constants])

    @cached_property
    def full(self) -> Filled:
        """The same with first derivatives (m, a) and second ones (m, a, a) behind, flat."""
        import sympy

        first = [sympy.diff(e, x) for e in self.components for x in self.active]
        second = [sympy.diff(e, x) for e in first for x in self.active]
        return filled([*self.components, *first, *second], [*self.active, *self.constants])


def filled(expressions: Sequence[Expr], arguments: Sequence[Symbol]) -> Filled:
    """A compiled function that fills an array with expressions of arguments."""
    import sympy
    from numba import njit

    shared, left = sympy.cse(expressions)
    lines = [f"{x} = x[{k}]" for k, x in enumerate(arguments)]
    lines += [f"{x} = {sympy.pycode(e)}" for x, e in shared]
    lines += [f"out[{k}] = {sympy.pycode(e)}" for k, e in enumerate(left)]
    space: dict[str, Any] = {"math": math}
    exec("\n    ".join(["def function(x, out):", *lines]), space)
    made: Filled = njit("void(f8[::1], f8[::1])", error_model="numpy")(space["function"])
    return made
