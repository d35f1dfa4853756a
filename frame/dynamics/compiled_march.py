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
        out = Jet(np.empty(shape), np.empty((d, *shape)), np.empty((d, d, *shape)))
        last, parts = np.zeros(1), np.asarray(lengths, float)
        given = [
            np.ascontiguousarray(x, float)
            for x in (parts, parameters, start.value, start.first, start.second)
        ]
        made = [out.value, out.first, out.second, last]
        counts = [ctypes.c_long(sets), ctypes.c_long(nodes), ctypes.c_int(d)]
        counts.append(ctypes.c_int(len(parts)))
        code = self.library.march(*counts, *map(address, [*given, *made]))
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
    head = "\n".join(["#include <math.h>", "#include <string.h>", *defined])
    written = [_function(name, part) for name, part in sorted(functions.items())]
    library = c_library("\n".join([head, *written, MARCH]))
    return None if library is None else CompiledMarch(library, outputs)


def _function(name: str, part: Compiled) -> str:
    values = _body(f"{name}_values", part.arguments, part.expressions)
    if name == "newton":
        return values
    return values + _body(f"{name}_full", part.arguments, [*part.expressions, *part.derivatives])


def _body(name: str, arguments: Sequence[Any], expressions: Sequence[Any]) -> str:
    import sympy

    shared, reduced = sympy.cse(list(expressions), symbols=sympy.numbered_symbols("w_"))
    place = {x: sympy.Symbol(f"x[{k}]") for k, x in enumerate(arguments)}

    named = [(f"const double {symbol}", e) for symbol, e in shared]
    named += [(f"out[{k}]", e) for k, e in enumerate(reduced)]
    lines = [f"{left} = {sympy.ccode(sympy.sympify(e).xreplace(place))};" for left, e in named]
    text = "\n    ".join(lines)
    return f"static void {name}(const double *x, double *out)\n{{\n    {text}\n}}\n"
