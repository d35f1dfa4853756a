"""Trajectories of general systems with internal derivatives, many sets at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from alphacut.frame.calculus.jet import Jet
from alphacut.frame.calculus.tape import Tape, tape, with_derivatives
from alphacut.frame.dynamics.flow import Flow, LinearFlow, StepError
from alphacut.frame.dynamics.integrators import INTEGRATORS, Integrator
from alphacut.frame.structures.lagrangian import Equations, LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import chosen

Expressions = tuple[list[Any], list[Any], list[Any]]
"""Components, and the symbols they depend on: those to differentiate by, and others."""


@dataclass(frozen=True, eq=False)
class LagrangianFlow(Flow):
    """Trajectories of a general system by the midpoint variational integrator."""

    system: LagrangianSystem

    @property
    def method(self) -> str:
        """Name of the time stepping."""
        return "midpoint"

    def finer(self) -> tuple[LagrangianFlow, int]:
        """The same with half the step, which is 2 parts; what is compiled is shared."""
        fine = replace(self, step=self.step / 2)
        shared = ("_newton", "_plain")
        fine.__dict__.update({name: getattr(self, name) for name in shared})
        return fine, 2

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Trajectories of half the step at points (S, d), and the errors of these, (S, T, m).

        The distance from half the step is extrapolated by the order, 2.
        """
        fine = self.finer()[0].values(points)[:, ::2]
        return fine, np.abs(self.values(points) - fine) * 4 / 3

    @cached_property
    def _symbols(self) -> tuple[list[Any], list[Any]]:
        """Symbols of the inputs, and of the other parameters."""
        p = self.system.symbols.p
        return [p[name] for name in self.names], [x for k, x in p.items() if k not in self.names]

    @cached_property
    def _equations(self) -> Expressions:
        """Momenta before and behind a step."""
        return variational(self.system.symbols, *self._symbols)

    @cached_property
    def _newton(self) -> Tape:
        """Momenta before a step and their slopes by the coordinates behind it."""
        components, active, rest = self._equations
        n = self.system.coordinates
        slopes = [e.diff(x) for e in components[:n] for x in active[:n]]
        return tape([*components[:n], *slopes], active, rest)

    @cached_property
    def _observation(self) -> Expressions:
        """Outputs of (state, parameters) (eq. 18)."""
        import sympy

        eq, (own, rest) = self.system.symbols, self._symbols
        momenta = sympy.Matrix(sympy.symbols(f"pi:{len(eq.q)}", real=True))
        velocity = eq.velocity(momenta)
        seen = [self.system.output(name, velocity) for name in self.outputs]
        return seen, [*eq.q, *momenta, *own], rest

    @cached_property
    def _initial(self) -> Expressions:
        """The initial state of the parameters."""
        eq, (own, rest), (q0, v0) = self.system.symbols, self._symbols, self.system.start()
        start = dict(zip([*eq.q, *eq.v], [*q0, *v0], strict=True))
        return [*q0, *eq.momentum.subs(start)], own, rest

    @cached_property
    def _plain(self) -> tuple[Tape, Tape, Tape]:
        """Tapes of a step, the outputs and the start."""
        return tape(*self._equations), tape(*self._observation), tape(*self._initial)

    @cached_property
    def _deep(self) -> tuple[Tape, Tape, Tape]:
        """The same with first and second derivatives by the inputs."""
        every = (self._equations, self._observation, self._initial)
        step, observation, initial = (with_derivatives(*of) for of in every)
        return step, observation, initial

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        from alphacut.frame.dynamics.lagrangian_march import march  # Numba takes time to import

        d, size = len(self.names) if derivatives else 0, 2 * self.system.coordinates
        step, observation, initial = self._deep if d else self._plain
        inputs = self._inputs(points)
        state, first, second = self._start(initial, inputs, d)
        nodes = (len(points), len(self.time))
        out = [np.empty((*nodes, *(d,) * order, len(self.outputs))) for order in range(3)]
        done = march(
            *(self._newton, step, observation, inputs, self.step),
            *(state.reshape(-1, size), first, second, *out),
        )
        if not done:
            what = f"a step of {self.step:g} s did not converge, or leaves the numbers"
            raise StepError(what, "take a smaller step, or parameters where the motion exists")
        return Jet(out[0], np.moveaxis(out[1], 2, 0), np.moveaxis(out[2], (2, 3), (0, 1)))

    def _inputs(self, points: Array) -> Array:
        """Inputs and other parameters, shape (S, K)."""
        rest = [x for name, x in self.system.parameters.items() if name not in self.names]
        return np.ascontiguousarray(np.hstack([points, np.tile(rest, (len(points), 1))]), float)

    def _start(self, initial: Tape, inputs: Array, d: int) -> tuple[Array, Array, Array]:
        """Initial states (S, 2n) with derivatives by d inputs, (S, d, 2n) and (S, d, d, 2n)."""
        from alphacut.frame.dynamics.lagrangian_march import evaluated

        m = 2 * self.system.coordinates
        flat = np.empty((len(inputs), m + m * d + m * d * d))
        evaluated(initial, inputs, flat)
        first = flat[:, m : m + m * d].reshape(len(inputs), m, d)
        second = flat[:, m + m * d :].reshape(len(inputs), m, d, d)
        parts = (flat[:, :m], np.moveaxis(first, 1, 2), np.moveaxis(second, 1, 3))
        state, slope, bent = map(np.ascontiguousarray, parts)
        return state, slope, bent


def flow_of(
    model: LinearSystem | LagrangianSystem,
    names: Sequence[str],
    duration: float,
    step: float,
    integrator: str | Integrator = "midpoint",
) -> Flow:
    """Trajectories of any structure.

    Raises:
        RefusedError: The structure has no such parameter or integrator.
    """
    if isinstance(model, LagrangianSystem):
        chosen("integrator", integrator, ["midpoint"])
        return LagrangianFlow(model, tuple(names), duration, step)
    if isinstance(integrator, str):
        chosen("integrator", integrator, INTEGRATORS)
        integrator = INTEGRATORS[integrator]
    return LinearFlow(model, tuple(names), duration, step, integrator)


def variational(eq: Equations, own: list[Any], rest: list[Any]) -> Expressions:
    """Momenta at both ends of a midpoint step as functions of q[k+1], q[k], parameters and h.

    With q̄ = (q[k] + q[k+1])/2 and v̄ = (q[k+1] − q[k])/h: π[k] = L_v − h/2 (L_q + F), π[k+1] = L_v
    + h/2 (L_q + F).
    """
    import sympy

    n = len(eq.q)
    old, new = (sympy.Matrix(sympy.symbols(f"{x}:{n}", real=True)) for x in ("old", "new"))
    h = sympy.Symbol("h", positive=True)
    middle = dict(zip([*eq.q, *eq.v], [*((old + new) / 2), *((new - old) / h)], strict=True))
    momentum, push = eq.momentum.subs(middle), eq.push.subs(middle)
    start, end = list(momentum - h / 2 * push), list(momentum + h / 2 * push)
    return [*start, *end], [*new, *old, *own], [*rest, h]
