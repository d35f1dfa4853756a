"""Expressions and their derivatives as tapes: lists of operations that one compiled loop runs.

Nothing is compiled for an expression, so that a new system costs no compilation.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import TYPE_CHECKING

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import require_choice

if TYPE_CHECKING:
    from sympy import Expr, Symbol

Tape = tuple[Ints, Ints, Array]
"""Operations (L, 3), places of the results (m,), and the places themselves.

An operation has a number and the places of two operands. Places hold arguments, the result of each
operation, and numbers, these counted from the end: the first is at −1.
"""
BINARY = ("add", "multiply", "power")
UNARY = ("reciprocal", "sqrt", "sin", "cos", "tan", "exp", "log")
OPERATIONS = (*BINARY, *UNARY)


def tape(components: Sequence[Expr], active: Sequence[Symbol], constants: Sequence[Symbol]) -> Tape:
    """The tape of expressions (m,) of arguments: the active ones, then constants.

    Raises:
        RefusedError: An expression has a function that is not among `OPERATIONS`.
    """
    writer = _Writer([*active, *constants])
    results = np.array([writer.place(e) for e in components], np.int64)
    code = np.array([*writer.code], np.int64).reshape(-1, 3)
    places = np.zeros(writer.arguments + len(code) + len(writer.numbers))
    places[writer.arguments + len(code) :] = [*writer.numbers][::-1]
    return code, results, places


def with_derivatives(
    components: Sequence[Expr], active: Sequence[Symbol], constants: Sequence[Symbol]
) -> Tape:
    """The same, with first derivatives (m, a) by the active ones and second ones (m, a, a)."""
    first = [e.diff(x) for e in components for x in active]
    second = [e.diff(x) for e in first for x in active]
    return tape([*components, *first, *second], active, constants)


class _Writer:
    """Writes a tape: the place of every expression, one for those that are equal."""

    def __init__(self, arguments: Sequence[Symbol]) -> None:
        self.places: dict[object, int] = {x: k for k, x in enumerate(arguments)}
        self.numbers: dict[float, int] = {}
        self.code: dict[tuple[int, int, int], int] = {}  # operations in order, and their places
        self.arguments = len(arguments)

    def place(self, e: Expr) -> int:
        """Place of an expression."""
        if e not in self.places:
            number = e.is_number and self.numbers.setdefault(float(e), len(self.numbers))
            self.places[e] = -1 - number if e.is_number else self._write(e)
        return self.places[e]

    def _write(self, e: Expr) -> int:
        """Place of a compound expression, after the operations that compute it are written."""
        name = type(e).__name__
        if name in ("Add", "Mul"):
            operands = map(self.place, e.args)
            return reduce(lambda x, y: self._apply(name, x, y), operands)
        if name == "Pow":
            return self._power(*e.args)
        require_choice("function of the lagrangian", name, UNARY)
        return self._apply(name, self.place(e.args[0]))

    def _power(self, base: Expr, exponent: Expr) -> int:
        """Place of base ** exponent, written as products or roots where these are exact."""
        if exponent.is_Integer and abs(int(exponent)) <= 4:
            x = self.place(base)
            power = reduce(lambda a, b: self._apply("Mul", a, b), [x] * abs(int(exponent)))
            return power if exponent > 0 else self._apply("reciprocal", power)
        if exponent.is_number and abs(float(exponent)) == 0.5:
            root = self._apply("sqrt", self.place(base))
            return root if exponent > 0 else self._apply("reciprocal", root)
        return self._apply("power", self.place(base), self.place(exponent))

    def _apply(self, name: str, x: int, y: int | None = None) -> int:
        """Place of the result of an operation on places x and y, written unless it is there."""
        instruction = {"Add": "add", "Mul": "multiply"}.get(name, name)
        row = (OPERATIONS.index(instruction), x, x if y is None else y)
        return self.code.setdefault(row, self.arguments + len(self.code))
