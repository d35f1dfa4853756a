"""Particle given by an inequality in x and y, by interval arithmetic on pixels."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from alphacut.rve.image.outlines.interval import Interval, greatest, least
from alphacut.rve.image.outlines.outline import CUT, INSIDE, OUTSIDE, Grid
from alphacut.stochastic.theta.truncated_normal import Array

HALF_PI = (1.5707963267948966, 1.5707963267948968)
OPERATIONS: dict[type[ast.operator], Callable[[Interval, Interval], Interval]] = {
    ast.Add: Interval.__add__,
    ast.Sub: Interval.__sub__,
    ast.Mult: Interval.__mul__,
    ast.Div: Interval.__truediv__,
}
FUNCTIONS: dict[str, Callable[[Interval], Interval]] = {
    "sqrt": Interval.root,
    "exp": lambda v: v.rising(np.exp),
    "abs": Interval.__abs__,
    "cos": Interval.cosine,
    "sin": lambda v: (v - Interval(np.asarray(HALF_PI[0]), np.asarray(HALF_PI[1]))).cosine(),
}
CHOICES = {"min": least, "max": greatest}
ALLOWED = "x, y, numbers, pi, + - * / **, sqrt, exp, abs, sin, cos, min, max and one <= or >="


@dataclass(frozen=True)
class Equation:
    """Particles where an inequality holds, e.g. ``Equation("(x - 1)**2 + (y - 1)**2 <= 0.25")``.

    Args:
        inequality: Two expressions in x and y with <= or >= between them.

    Raises:
        ValueError: The text is no such inequality.
    """

    inequality: str

    def __post_init__(self) -> None:
        self._excess(Interval.exact(0.0), Interval.exact(0.0))

    def classify(self, grid: Grid) -> Array:
        """OUTSIDE, CUT or INSIDE for each pixel, shape (rows, columns)."""
        x, y = (
            _cells(n, length)
            for n, length in ((grid.columns, grid.width), (grid.rows, grid.height))
        )
        excess = self._excess(x, Interval(y.low[:, None], y.high[:, None]))
        classes = np.where(excess.high <= 0, INSIDE, np.where(excess.low > 0, OUTSIDE, CUT))
        return np.array(np.broadcast_to(classes, (grid.rows, grid.columns)))

    def _excess(self, x: Interval, y: Interval) -> Interval:
        """Expression that must not be positive.

        Raises:
            ValueError: The text is no inequality, or it has the root of a negative value.
        """
        try:
            tree = ast.parse(self.inequality.strip(), mode="eval").body
        except SyntaxError as error:
            raise ValueError(
                f"the outline {self.inequality!r} cannot be read: {error.msg}"
            ) from error
        if not isinstance(tree, ast.Compare) or len(tree.ops) != 1:
            raise ValueError(
                f"the outline {self.inequality!r} is no inequality; it takes {ALLOWED}"
            )
        left, right = (_value(part, x, y) for part in (tree.left, tree.comparators[0]))
        if isinstance(tree.ops[0], ast.LtE | ast.Lt):
            return left - right
        if isinstance(tree.ops[0], ast.GtE | ast.Gt):
            return right - left
        raise ValueError(f"the outline {self.inequality!r} needs <= or >=")


def _cells(number: int, length: float) -> Interval:
    """The pixels along one side, a rounding error wider than they are."""
    edges = np.linspace(0, length, number + 1)
    return Interval(edges[:-1] - 1e-15 * length, edges[1:] + 1e-15 * length)


def _value(tree: ast.expr, x: Interval, y: Interval) -> Interval:
    """Value of an expression.

    Raises:
        ValueError: It contains what is not allowed.
    """
    match tree:
        case ast.Constant(value=int() | float() as number):
            return Interval.exact(number)
        case ast.Name(id="x"):
            return x
        case ast.Name(id="y"):
            return y
        case ast.Name(id="pi"):
            return Interval(np.asarray(2 * HALF_PI[0]), np.asarray(2 * HALF_PI[1]))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, x, y)
        case ast.BinOp(left=left, op=ast.Pow(), right=ast.Constant(value=int() as exponent)):
            return _value(left, x, y) ** exponent
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATIONS:
            return OPERATIONS[type(op)](_value(left, x, y), _value(right, x, y))
        case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]) if name in FUNCTIONS:
            return FUNCTIONS[name](_value(argument, x, y))
        case ast.Call(func=ast.Name(id=name), args=[_, _, *_] as parts, keywords=[]) if (
            name in CHOICES
        ):
            return reduce(CHOICES[name], [_value(part, x, y) for part in parts])
    raise ValueError(f"the outline contains {ast.unparse(tree)!r}; it takes {ALLOWED}")
