"""The march of a general system as C, written from its expressions."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from alphacut.frame.calculus.c_library import address, c_library
from alphacut.frame.calculus.jet import Array, Jet
from alphacut.frame.calculus.symbolic import Compiled

MARCH = Path(__file__).with_name("march.c").read_text(encoding="utf-8")
WIDTH = 8
"""Parameter sets that march side by side, one in each lane of a vector."""
VECTOR = f"""\
#include <math.h>
#include <string.h>
#define W {WIDTH}
typedef double V __attribute__((vector_size(8 * W)));
#define BROAD(x) ((x) + (V){{0}})
static inline V power(V x, int n)
{{
    V out = BROAD(1);
    for (int k = 0; k < (n < 0 ? -n : n); k++) out *= x;
    return n < 0 ? 1 / out : out;
}}
"""
"""Head of the code: what an expression is made of takes and gives vectors."""
ONE = "sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh exp log sqrt cbrt erf erfc"
TWO = "pow atan2"
MOST = 12
"""Most coordinates and uncertain parameters together; more would be long code."""
FAILURES = {
    1: "did not converge in 30 iterations (last change {last:.2g}); take a smaller step",
    2: "is not finite; keep the start and the parameters where the equations of motion are",
    3: "has a singular matrix; keep the start and the parameters where they have inertia",
}


@dataclass(frozen=True, eq=False)
class CompiledMarch:
    """Compiled trajectories with derivatives.

    Args:
        library: The code.
        outputs: Number of outputs.
    """

    library: ctypes.CDLL
    outputs: int

    def run(
        self, start: Jet, parameters: Array, lengths: Sequence[float], nodes: int
    ) -> tuple[Jet, str]:
        """Outputs at all nodes, V = (S, T, m), and why the march failed, empty where it did not.

        Args:
            start: The state, V = (2n, S).
            parameters: The uncertain ones, then the others, shape (S, K).
            lengths: Parts of a step, in s.
            nodes: Number of nodes T.
        """
        d, sets = start.directions, len(parameters)
        shape = (sets, nodes, self.outputs)
        made = [np.empty(shape), np.empty((*shape, d)), np.empty((*shape, d, d)), np.zeros(1)]
        parts = np.asarray(lengths, float)
        given = [
            np.ascontiguousarray(x, float)
            for x in (parts, parameters, start.value, start.first, start.second)
        ]
        counts = [ctypes.c_long(sets), ctypes.c_long(nodes), ctypes.c_int(d)]
        counts.append(ctypes.c_int(len(parts)))
        code = self.library.march(*counts, *map(address, [*given, *made]))
        value, first, second, last = made
        out = Jet(value, np.moveaxis(first, -1, 0), np.moveaxis(second, (-2, -1), (0, 1)))
        return out, FAILURES[code].format(last=last[0]) if code else ""


def compiled_march(
    functions: dict[str, Compiled], *, coordinates: int, own: int, rest: int, outputs: int
) -> CompiledMarch | None:
    """The march of a system with these expressions; None without a compiler, or of a large one.

    Args:
        functions: "observe", and "newton" and "both" of the variational integrator, or "flow" of
            the Runge–Kutta method.
        coordinates: Number of coordinates n.
        own: Number of uncertain parameters.
        rest: Number of the others.
        outputs: Number of outputs.
    """
    if coordinates + own > MOST:
        return None
    sizes = {"N": coordinates, "OWN": own, "REST": rest, "OUT": outputs}
    if "newton" in functions:
        sizes["VARIATIONAL"] = 1
    defined = [f"#define {name} {size}" for name, size in sizes.items()]
    lanes = [_lanes(name, "x") for name in ONE.split()]
    lanes += [_lanes(name, "x, y") for name in TWO.split()]
    written = [_function(name, part) for name, part in sorted(functions.items())]
    library = c_library("\n".join([VECTOR, *defined, *lanes, *written, MARCH]))
    return None if library is None else CompiledMarch(library, outputs)


def _lanes(name: str, of: str) -> str:
    """A function of C's library, lane by lane, in place of its namesake."""
    each = ", ".join(f"{x}[l]" for x in of.split(", "))
    all_ = ", ".join(f"BROAD({x})" for x in of.split(", "))
    taken = ", ".join(f"V {x}" for x in of.split(", "))
    return (
        f"static inline V {name}_of({taken})\n"
        f"{{\n    for (int l = 0; l < W; l++) x[l] = ({name})({each});\n    return x;\n}}\n"
        f"#define {name}({of}) {name}_of({all_})"
    )


def _function(name: str, part: Compiled) -> str:
    values = _body(f"{name}_values", part.arguments, part.expressions)
    if name == "newton":
        return values
    return values + _body(f"{name}_full", part.arguments, [*part.expressions, *part.derivatives])


def _body(name: str, arguments: Sequence[Any], expressions: Sequence[Any]) -> str:
    import sympy

    shared, reduced = sympy.cse(list(expressions), symbols=sympy.numbered_symbols("w_"))
    place = {x: sympy.Symbol(f"x[{k}]") for k, x in enumerate(arguments)}
    write = _printer().doprint
    named = [(f"const V {symbol}", e) for symbol, e in shared]
    named += [(f"out[{k}]", e) for k, e in enumerate(reduced)]
    right = [(left, sympy.sympify(e).xreplace(place)) for left, e in named]
    spread = [(left, "BROAD({})" if e.is_number else "{}", write(e)) for left, e in right]
    text = "\n    ".join(f"{left} = {form.format(value)};" for left, form, value in spread)
    return f"static void {name}(const V *x, V *out)\n{{\n    {text}\n}}\n"


def _printer() -> Any:
    """Writes whole powers as products."""
    from sympy.printing.c import C99CodePrinter

    class Printer(C99CodePrinter):  # type: ignore[misc]
        def _print_Pow(self, expr: Any) -> str:  # noqa: N802
            if expr.exp.is_Integer:
                return f"power({self._print(expr.base)}, {expr.exp})"
            return str(super()._print_Pow(expr))

    return Printer()
