"""Checks of a Lagrangian system's functions, called with symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

from alphacut.frame.calculus.numbers import require_number
from alphacut.fuzzy.refused import RefusedError

if TYPE_CHECKING:
    from sympy import Expr

T = TypeVar("T")
SMOOTH = "arithmetic and the smooth sin, cos and exp of alphacut.frame.calculus.jet"
ROUGH = {"Abs", "sign", "Max", "Min", "Heaviside", "DiracDelta", "Piecewise", "floor", "ceiling"}
ROUGH |= {"Mod", "arg", "re", "im"}
"""Functions of SymPy that have no second derivative everywhere."""


def require_dimensions(
    coordinates: int, parameters: Mapping[str, float], observed: Mapping[str, object]
) -> None:
    """Refuse systems without coordinates, parameters or outputs, and bad parameters."""
    if not isinstance(coordinates, int) or coordinates < 1:
        raise RefusedError("coordinates", coordinates, "whole numbers from 1 on")
    for name, named in (("parameters", parameters), ("observed", observed)):
        if not isinstance(named, Mapping) or not named:
            raise RefusedError(name, named, "values by name, one at least")
    for name, value in parameters.items():
        require_number(f"parameter {name}", value, "SI units")


def called(
    name: str, function: Callable[..., T], *arguments: Sequence[Expr] | Mapping[str, Expr]
) -> T:
    """Value of a function for symbols: of (q, v, p), or of p, the parameters by name.

    Raises:
        RefusedError: It asks for a parameter or coordinate that is not there, or cannot take
            symbols.
    """
    try:
        return function(*arguments)
    except KeyError as unknown:
        raise RefusedError(name, f"of parameter {unknown}", ", ".join(arguments[-1])) from None
    except IndexError:
        what = "of a coordinate beyond"
        raise RefusedError(name, what, f"the {len(arguments[0])} that there are") from None
    except (TypeError, AttributeError) as failure:
        raise RefusedError(name, f"no function of symbols ({failure})", SMOOTH) from None


def listed(name: str, values: Sequence[T], count: int) -> list[T]:
    """The entries of a sequence, one for each coordinate."""
    entries = list(values) if isinstance(values, Sequence) or hasattr(values, "tolist") else None
    if entries is None or len(entries) != count:
        raise RefusedError(name, values, f"a list of {count}, one for each coordinate")
    return entries


def expression(name: str, value: object) -> Expr:
    """An expression of SymPy with two derivatives.

    Raises:
        RefusedError: It is none, or holds a function without them.
    """
    import sympy

    try:
        made = sympy.sympify(value)
    except sympy.SympifyError:
        raise RefusedError(name, repr(value), SMOOTH) from None
    rough = sorted({type(part).__name__ for part in sympy.preorder_traversal(made)} & ROUGH)
    if rough or not isinstance(made, sympy.Expr):
        raise RefusedError(name, rough[0] if rough else value, SMOOTH)
    return made
