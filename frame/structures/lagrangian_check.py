"""Checks of a Lagrangian system's functions, called with symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, TypeVar

from alphacut.frame.calculus.numbers import require_number

if TYPE_CHECKING:
    from sympy import Expr

T = TypeVar("T")
SMOOTH = "use arithmetic and the smooth sin, cos and exp of alphacut.frame.calculus.jet"
ROUGH = {"Abs", "sign", "Max", "Min", "Heaviside", "DiracDelta", "Piecewise", "floor", "ceiling"}
ROUGH |= {"Mod", "arg", "re", "im"}
"""Functions of SymPy that have no second derivative everywhere."""


def require_dimensions(
    coordinates: int, parameters: Mapping[str, float], observed: Mapping[str, object]
) -> None:
    """Refuse systems without coordinates, parameters or outputs, and bad parameters.

    Raises:
        ValueError: It is one.
    """
    if not isinstance(coordinates, int) or coordinates < 1:
        raise ValueError(
            f"coordinates: {coordinates!r} is not allowed; it must be a whole number, 1 or greater"
        )
    for name, named in (("parameters", parameters), ("observed", observed)):
        if not isinstance(named, Mapping) or not named:
            raise ValueError(
                f"{name}: {named!r} is not allowed; it must map names to values, one at least"
            )
    for name, value in parameters.items():
        require_number(f"parameter {name}", value, "SI units")


def called(
    name: str, function: Callable[..., T], *arguments: Sequence[Expr] | Mapping[str, Expr]
) -> T:
    """Value of a function for symbols.

    Args:
        name: What the function is called.
        function: Of (q, v, p), or of p.
        arguments: Symbols; p, the last, by name.

    Raises:
        ValueError: It asks for a parameter or coordinate that is not there, or cannot take symbols.
    """
    try:
        return function(*arguments)
    except KeyError as unknown:
        raise ValueError(
            f"{name}: there is no parameter {unknown}; known are {', '.join(arguments[-1])}"
        ) from None
    except IndexError:
        raise ValueError(
            f"{name}: asks for a coordinate beyond the {len(arguments[0])} that there are; raise"
            " coordinates"
        ) from None
    except (TypeError, AttributeError) as failure:
        raise ValueError(
            f"{name}: cannot be called with symbols ({str(failure).rstrip('.')}); {SMOOTH}"
        ) from None


def listed(name: str, given: Sequence[T], count: int) -> list[T]:
    """The entries of a sequence, one for each coordinate.

    Raises:
        ValueError: It is no sequence, or of another length.
    """
    entries = list(given) if isinstance(given, Sequence) or hasattr(given, "tolist") else None
    if entries is None or len(entries) != count:
        raise ValueError(
            f"{name}: {given} is not allowed; it must be a list of {count}, one for each coordinate"
        )
    return entries


def expression(name: str, given: object) -> Expr:
    """An expression of SymPy with two derivatives.

    Raises:
        ValueError: It is none, or holds a function without them.
    """
    import sympy

    try:
        found = sympy.sympify(given)
    except sympy.SympifyError:
        raise ValueError(f"{name}: {given!r} is no expression; {SMOOTH}") from None
    rough = sorted({type(part).__name__ for part in sympy.preorder_traversal(found)} & ROUGH)
    if rough or not isinstance(found, sympy.Expr):
        raise ValueError(f"{name}: {rough[0] if rough else given} is not allowed; {SMOOTH}")
    return found
