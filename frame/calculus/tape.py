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
"""Operations of shape (L, 3), places of the m results of shape (m,), and an array of places.

An operation is its index in `OPERATIONS` and the places of two operands; the second one repeats the
first one where there is one operand alone. The array of places holds the arguments, then the
results of all operations, then the numbers of the expression, which are counted from the end: the
first number stands at −1.
"""
# Operations by their codes 0, 1, 2, …, which a compiled loop knows: first those of two operands,
# then those of one.
OPERATIONS = (
    "add", "multiply", "power", "reciprocal", "sqrt", "sin", "cos", "tan", "exp", "log",
)  # fmt: skip
UNARY = OPERATIONS[3:]


def tape(components: Sequence[Expr], active: Sequence[Symbol], constants: Sequence[Symbol]) -> Tape:
    """Return the tape of m expressions: a list of operations that one compiled loop runs.

    Args:
        components: The m expressions. They are sums, products, powers, and sin, cos, tan, exp and
            log.
        active: Symbols that are the first arguments.
        constants: Symbols that are the arguments behind them. All symbols of the expressions are
            among both.

    Returns:
        Three arrays. The operations, whole numbers of shape (operations, 3): the code of each in
        `OPERATIONS` and the places of its operands; the second one repeats the first one where
        there is one operand alone. The places of the m results, shape (m,). And the array of
        places, which holds room for the arguments, then for the result of each operation, then the
        numbers of the expressions; the first number stands at the end, and its place is −1.

    Raises:
        RefusedError: An expression has another function.
    """
    writer = _Writer(list(active) + list(constants))
    results = np.array([writer.place(e) for e in components], np.int64)
    operations = np.array(list(writer.operations), np.int64).reshape(-1, 3)
    first_number = writer.arguments + len(operations)
    # numbers stand at the end in reverse, since their places were counted from there before the
    # number of operations was known
    places = np.zeros(first_number + len(writer.numbers))
    places[first_number:] = list(writer.numbers)[::-1]
    return operations, results, places


def with_derivatives(
    components: Sequence[Expr], active: Sequence[Symbol], constants: Sequence[Symbol]
) -> Tape:
    """Return the tape of m expressions and of their derivatives by the a active arguments.

    Args:
        components: The m expressions.
        active: Symbols that are the first arguments, by which is differentiated.
        constants: Symbols that are the arguments behind them.

    Returns:
        The tape of m + m a + m a² results, as `tape` returns it: the expressions; their first
        derivatives, in the order of an array of shape (m, a); and the second ones, in that of an
        array (m, a, a).

    Raises:
        RefusedError: An expression or a derivative has a function that no operation computes.
    """
    first = [e.diff(x) for e in components for x in active]
    second = [e.diff(x) for e in first for x in active]
    return tape(list(components) + first + second, active, constants)


class _Writer:
    """Writes a tape, on which equal expressions have one place.

    Args:
        arguments: Symbols, which have the first places.

    Attributes:
        places: Place of each expression met so far.
        numbers: Index of each number among the numbers; its place is −1 − index.
        operations: Place of the result of each operation, in the order of evaluation.
    """

    def __init__(self, arguments: Sequence[Symbol]) -> None:
        self.places: dict[object, int] = {x: place for place, x in enumerate(arguments)}
        self.numbers: dict[float, int] = {}
        self.operations: dict[tuple[int, int, int], int] = {}
        self.arguments = len(arguments)

    def place(self, e: Expr) -> int:
        """Return the place of an expression's value, after writing what computes it if it is new.

        The place is the index among the arguments and the results of operations; a number has the
        place −1 − k, where k is its index among the numbers, since these stand at the end.

        Args:
            e: Symbol among the arguments, number, or compound expression of them.

        Raises:
            RefusedError: The expression has a function that no operation computes.
        """
        if e not in self.places:
            if e.is_number:
                self.places[e] = -1 - self.numbers.setdefault(float(e), len(self.numbers))
            else:
                self.places[e] = self._write(e)
        return self.places[e]

    def _write(self, e: Expr) -> int:
        """Write the operations that compute an expression, and return the place of its result.

        Args:
            e: A sum or product of any number of operands, a power, or a function of one operand.

        Raises:
            RefusedError: The expression has a function that no operation computes.
        """
        name = type(e).__name__
        if name in ("Add", "Mul"):
            # Sums of several operands become additions from left to right.
            operands = map(self.place, e.args)
            return reduce(lambda x, y: self._apply(name, x, y), operands)
        if name == "Pow":
            return self._power(*e.args)
        require_choice("function of the lagrangian", name, UNARY)
        return self._apply(name, self.place(e.args[0]))

    def _power(self, base: Expr, exponent: Expr) -> int:
        """Write the operations that compute base ** exponent, and return the place of the result.

        Whole powers up to 4 become products and half powers become roots, which are exact to a few
        roundings and faster than a general power. The exponent is never 0, since SymPy writes 1 for
        x⁰.

        Raises:
            RefusedError: Base or exponent has a function that no operation computes.
        """
        if exponent.is_Integer and abs(int(exponent)) <= 4:
            factors = [self.place(base)] * abs(int(exponent))
            power = reduce(lambda a, b: self._apply("Mul", a, b), factors)
        elif exponent.is_number and abs(float(exponent)) == 0.5:
            power = self._apply("sqrt", self.place(base))
        else:
            return self._apply("power", self.place(base), self.place(exponent))
        if exponent > 0:
            return power
        return self._apply("reciprocal", power)

    def _apply(self, name: str, x: int, y: int | None = None) -> int:
        """Write an operation on the places x and y unless it is there; return its place."""
        instruction = {"Add": "add", "Mul": "multiply"}.get(name, name)
        if y is None:
            y = x
        operation = (OPERATIONS.index(instruction), x, y)
        return self.operations.setdefault(operation, self.arguments + len(self.operations))
