"""Trajectories of general systems with internal derivatives, many sets at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from alphacut.frame.calculus.jet import Jet
from alphacut.frame.calculus.symbolic import Compiled
from alphacut.frame.dynamics.flow import March, StepError, nodes
from alphacut.frame.structures.lagrangian import Equations, LagrangianSystem
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError

TRIPLE_JUMP = (1 / (2 - 2 ** (1 / 3)), -(2 ** (1 / 3)) / (2 - 2 ** (1 / 3)), 1 / (2 - 2 ** (1 / 3)))
"""Lengths of three symmetric steps of order 2 that make one of order 4 (Yoshida 1990)."""
SCHEMES = {"midpoint": 2, "composition4": 4, "rk4": 4}
"""Schemes with their orders: the midpoint variational integrator, its composition of order 4, and
the Runge–Kutta method.
"""


@dataclass(frozen=True, eq=False)
class LagrangianFlow(March):
    """Trajectories of a general system.

    Args:
        system: The system.
        names: Its uncertain parameters.
        duration: Length of the simulation, in s.
        step: Step, in s.
        scheme: One of `SCHEMES`.
        observe: Names of the outputs wanted; all when empty.

    Raises:
        ValueError: A name is unknown, or the duration is no multiple of the step.
    """

    system: LagrangianSystem
    names: tuple[str, ...]
    duration: float
    step: float
    scheme: str = "midpoint"
    observe: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for kind, wanted, known in (
            ("uncertain parameter", self.names, self.system.parameters),
            ("output", self.observe, self.system.outputs),
            ("integrator", (self.scheme,), SCHEMES),
        ):
            for name in wanted:
                if name not in known:
                    raise RefusedError(kind, name, ", ".join(known))
        nodes(self.duration, self.step)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.observe or self.system.outputs

    def halved(self) -> LagrangianFlow:
        """The same with half the step; what is compiled is shared."""
        fine = replace(self, step=self.step / 2)
        shared = ("_step", "_observation", "_initial")
        fine.__dict__.update({name: getattr(self, name) for name in shared})
        return fine

    @cached_property
    def _symbols(self) -> tuple[list[Any], list[Any]]:
        """Symbols of the inputs, and of the other parameters."""
        p = self.system.symbols.p
        return [p[name] for name in self.names], [x for k, x in p.items() if k not in self.names]

    @cached_property
    def _step(self) -> tuple[Compiled, Compiled]:
        """What Newton's method solves, and what a step gives; the acceleration of rk4 twice."""
        eq, (own, rest) = self.system.symbols, self._symbols
        if self.scheme != "rk4":
            return variational(eq, own, rest)
        # eq. 17 of a Lagrangian system
        flow = Compiled([*eq.v, *eq.acceleration()], [*eq.q, *eq.v, *own], rest)
        return flow, flow

    @cached_property
    def _observation(self) -> Compiled:
        """Outputs of (state, parameters)."""
        eq, (own, rest) = self.system.symbols, self._symbols
        state, velocity = _state_symbols(eq, self.scheme)
        seen = [self.system.output(name, velocity) for name in self.outputs]
        return Compiled(seen, [*state, *own], rest)

    @cached_property
    def _initial(self) -> Compiled:
        """The initial state of the parameters."""
        eq, (own, rest), (q0, v0) = self.system.symbols, self._symbols, self.system.start()
        second = list(v0)
        if self.scheme != "rk4":
            start = dict(zip([*eq.q, *eq.v], [*q0, *v0], strict=True))
            second = list(eq.momentum.subs(start))
        return Compiled([*q0, *second], own, rest)

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        from alphacut.frame.dynamics.lagrangian_march import march  # Numba takes time to import

        d, size = len(self.names) if derivatives else 0, 2 * self.system.coordinates
        given = self._inputs(points)
        state, first, second = self._start(given, d)
        lengths = np.array(TRIPLE_JUMP if self.scheme == "composition4" else (1.0,)) * self.step
        nodes = (len(points), len(self.time))
        out = [np.empty((*nodes, *(d,) * order, len(self.outputs))) for order in range(3)]
        newton, both = self._step
        deep = (both.full, self._observation.full) if d else (both.plain, self._observation.plain)
        done = march(
            (newton.plain, both.plain, deep[0]),
            (self._observation.plain, deep[1]),
            self.scheme != "rk4",
            *(given, lengths, state.reshape(-1, size), first, second, *out),
        )
        if not done:
            what = f"a step of {self.step:g} s did not converge, or leaves the numbers"
            raise StepError(what, "take a smaller step, or parameters where the motion exists")
        return Jet(out[0], np.moveaxis(out[1], 2, 0), np.moveaxis(out[2], (2, 3), (0, 1)))

    def _inputs(self, points: Array) -> Array:
        """Inputs and other parameters, shape (S, K)."""
        rest = [x for name, x in self.system.parameters.items() if name not in self.names]
        return np.ascontiguousarray(np.hstack([points, np.tile(rest, (len(points), 1))]), float)

    def _start(self, given: Array, d: int) -> tuple[Array, Array, Array]:
        """Initial states (S, 2n) with derivatives by d inputs, (S, d, 2n) and (S, d, d, 2n)."""
        m, function = 2 * self.system.coordinates, self._initial.full if d else self._initial.plain
        flat = np.empty((len(given), m + m * d + m * d * d))
        for own, row in zip(given, flat, strict=True):
            function(own, row)
        first = flat[:, m : m + m * d].reshape(len(given), m, d)
        second = flat[:, m + m * d :].reshape(len(given), m, d, d)
        parts = (flat[:, :m], np.moveaxis(first, 1, 2), np.moveaxis(second, 1, 3))
        return tuple(np.ascontiguousarray(x) for x in parts)  # type: ignore[return-value]


def _state_symbols(eq: Equations, scheme: str) -> tuple[list[Any], Any]:
    """Symbols of the state, (q, v) or (q, momentum), and the velocity in terms of them."""
    if scheme == "rk4":
        return [*eq.q, *eq.v], eq.v
    import sympy

    momenta = sympy.Matrix(sympy.symbols(f"pi:{len(eq.q)}", real=True))
    return [*eq.q, *momenta], eq.velocity(momenta)


def variational(eq: Equations, own: list[Any], rest: list[Any]) -> tuple[Compiled, Compiled]:
    """Momenta at both ends of a midpoint step as functions of q[k+1], q[k], parameters and h.

    With q̄ = (q[k] + q[k+1])/2 and v̄ = (q[k+1] − q[k])/h: π[k] = L_v − h/2 (L_q + F), π[k+1] = L_v
    + h/2 (L_q + F). The first of both functions is π[k] with its slopes by q[k+1].
    """
    import sympy

    n = len(eq.q)
    old, new = (sympy.Matrix(sympy.symbols(f"{x}:{n}", real=True)) for x in ("old", "new"))
    h = sympy.Symbol("h", positive=True)
    middle = dict(zip([*eq.q, *eq.v], [*((old + new) / 2), *((new - old) / h)], strict=True))
    momentum, push = eq.momentum.subs(middle), eq.push.subs(middle)
    start, end = list(momentum - h / 2 * push), list(momentum + h / 2 * push)
    slopes = [sympy.diff(e, x) for e in start for x in new]
    newton = Compiled([*start, *slopes], [*new, *old, *own], [*rest, h])
    return newton, Compiled([*start, *end], [*new, *old, *own], [*rest, h])
