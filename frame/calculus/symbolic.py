"""Compiled functions with first and second derivatives, from expressions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet

if TYPE_CHECKING:
    from sympy import Expr, Symbol


@dataclass(frozen=True, eq=False)
class Compiled:
    """f(x) with x of shape (K, S): arrays over S parameter sets.

    Args:
        plain: Values of the m components.
        full: Values, then first derivatives by the `active` variables, then the upper triangle of
            the second ones.
        components: Number of components m.
        active: Number of variables to differentiate by; they come first among the K.
        arguments: Their symbols.
        expressions: The components.
        derivatives: What follows them in `full`.
    """

    plain: Callable[..., Any]
    full: Callable[..., Any]
    components: int
    active: int
    arguments: Sequence[Any]
    expressions: Sequence[Any]
    derivatives: Sequence[Any]

    def values(self, x: Sequence[Array]) -> Array:
        """Components at S points, shape (m, S)."""
        return _stacked(self.plain(*x), np.shape(x[0]))

    def taylor(self, x: Sequence[Array]) -> tuple[Array, Array, Array]:
        """Values (m, S), first derivatives (m, a, S) and second derivatives (m, a, a, S)."""
        m, a = self.components, self.active
        flat = _stacked(self.full(*x), np.shape(x[0]))
        size = flat.shape[1:]
        first = flat[m : m + m * a].reshape(m, a, *size)
        second = np.zeros((m, a, a, *size))
        rows, columns = np.triu_indices(a)
        second[:, rows, columns] = flat[m + m * a :].reshape(m, -1, *size)
        second[:, columns, rows] = second[:, rows, columns]
        return flat[:m], first, second

    def chain(self, inner: Jet, constants: Sequence[Array]) -> Jet:
        """The jet of f along jets of the active variables, V = (a, S); gives V = (m, S)."""
        f, g, H = self.taylor([*inner.value, *constants])
        first = np.einsum("mas,das->dms", g, inner.first)
        bent = np.einsum("mabs,das,ebs->dems", H, inner.first, inner.first, optimize=True)
        return Jet(f, first, bent + np.einsum("mas,deas->dems", g, inner.second))


def compiled(
    expressions: Sequence[Expr], active: Sequence[Symbol], constants: Sequence[Symbol] = ()
) -> Compiled:
    """Compiles SymPy expressions, differentiated by `active`; `constants` are further arguments."""
    import sympy

    arguments = [*active, *constants]
    first = [sympy.diff(e, x) for e in expressions for x in active]
    second = [
        sympy.diff(first[k * len(active) + i], active[j])
        for k in range(len(expressions))
        for i in range(len(active))
        for j in range(i, len(active))
    ]
    plain = sympy.lambdify(arguments, list(expressions), modules="numpy", cse=True)
    full = sympy.lambdify(arguments, [*expressions, *first, *second], modules="numpy", cse=True)
    derivatives = [*first, *second]
    sizes = (len(expressions), len(active))
    return Compiled(plain, full, *sizes, arguments, list(expressions), derivatives)


def _stacked(parts: Sequence[Any], shape: tuple[int, ...]) -> Array:
    out = np.empty((len(parts), *shape))
    for k, part in enumerate(parts):
        out[k] = part
    return out
