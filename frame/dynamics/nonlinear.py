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
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import require_choice

Expressions = tuple[list[Any], list[Any], list[Any]]
"""Components, and the symbols they depend on: those to differentiate by, and others."""


@dataclass(frozen=True, eq=False)
class LagrangianFlow(Flow):
    """Trajectories of a general system by the midpoint variational integrator.

    Example:
        >>> from alphacut.frame import pendulum
        >>> LagrangianFlow(pendulum(), ("l",), duration=1.0, step=0.1).values([[1.0]]).shape
        (1, 11, 2)
    """

    system: LagrangianSystem

    @property
    def method(self) -> str:
        """Name of the time stepping."""
        return "midpoint"

    def finer(self) -> tuple[LagrangianFlow, int]:
        """Return the flow with half the step, and 2, the parts of a step; tapes are shared."""
        fine = replace(self, step=self.step / 2)
        shared = ("_expressions", "_newton", "_plain")
        fine.__dict__.update({name: getattr(self, name) for name in shared})
        return fine, 2

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return trajectories of half the step at points (S, d) and this flow's errors, (S, T, m).

        The error is 4/3 of the distance between both, by extrapolation of a method of order 2.
        """
        fine = self.finer()[0].values(points)[:, ::2]
        return fine, np.abs(self.values(points) - fine) * 4 / 3

    @cached_property
    def _expressions(self) -> tuple[Expressions, Expressions, Expressions]:
        """SymPy expressions, each with the symbols to differentiate by, and others.

        1. Momenta at both ends of a step, π[k] = L_v − h/2 (L_q + F) and π[k+1] = L_v + h/2 (L_q +
           F), by q[k+1], q[k] and inputs, with the mean of q and the velocity (q[k+1] − q[k])/h.
        2. Outputs of a state (q, π) (eq. 18).
        3. The initial state (q, π).
        """
        import sympy

        eq, n = self.system.symbols, self.system.coordinates
        fuzzy = [eq.p[name] for name in self.names]
        constants = [x for name, x in eq.p.items() if name not in self.names]
        new, old, momenta = (
            sympy.Matrix(sympy.symbols(f"{x}:{n}", real=True)) for x in ("new", "old", "pi")
        )
        h = sympy.Symbol("h", positive=True)
        middle = dict(zip([*eq.q, *eq.v], [*((old + new) / 2), *((new - old) / h)], strict=True))
        momentum, impulse = eq.momentum.subs(middle), h / 2 * eq.push.subs(middle)
        velocity, (q0, v0) = eq.velocity(momenta), self.system.start()
        start = dict(zip([*eq.q, *eq.v], [*q0, *v0], strict=True))
        both_momenta = [*(momentum - impulse), *(momentum + impulse)]
        outputs = [self.system.output(name, velocity) for name in self.outputs]
        return (
            (both_momenta, [*new, *old, *fuzzy], [*constants, h]),
            (outputs, [*eq.q, *momenta, *fuzzy], constants),
            ([*q0, *eq.momentum.subs(start)], fuzzy, constants),
        )

    @cached_property
    def _newton(self) -> Tape:
        """Tape of the momenta before a step and their derivatives by the coordinates after it."""
        components, active, constants = self._expressions[0]
        n = self.system.coordinates
        slopes = [e.diff(x) for e in components[:n] for x in active[:n]]
        return tape([*components[:n], *slopes], active, constants)

    @cached_property
    def _plain(self) -> list[Tape]:
        """Tapes of a step, the outputs and the start."""
        return [tape(*expression) for expression in self._expressions]

    @cached_property
    def _deep(self) -> list[Tape]:
        """The same with first and second derivatives by the inputs."""
        return [with_derivatives(*expression) for expression in self._expressions]

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Return trajectories at points (S, d) by the midpoint rule, shape (S, T, outputs).

        Raises:
            StepError: A step did not converge.
        """
        # Numba compiles these when they are imported
        from alphacut.frame.dynamics.lagrangian_march import evaluate_all, march

        d, m = len(self.names) if derivatives else 0, 2 * self.system.coordinates
        step, observation, initial = self._deep if d else self._plain
        constants = [x for name, x in self.system.parameters.items() if name not in self.names]
        inputs = np.hstack([points, np.tile(constants, (len(points), 1))])
        inputs = np.ascontiguousarray(inputs, float)
        flat = np.empty((len(inputs), m + m * d + m * d * d))
        evaluate_all(initial, inputs, flat)
        state, first, second = np.split(flat, [m, m + m * d], axis=1)
        state_jet = (  # advanced in place by the march
            np.ascontiguousarray(state),
            np.ascontiguousarray(np.moveaxis(first.reshape(len(inputs), m, d), 1, 2)),
            np.ascontiguousarray(np.moveaxis(second.reshape(len(inputs), m, d, d), 1, 3)),
        )
        nodes = (len(points), len(self.time))
        out = [np.empty((*nodes, *(d,) * order, len(self.outputs))) for order in range(3)]
        if not march(self._newton, step, observation, inputs, self.step, *state_jet, *out):
            what = f"a step of {self.step:g} s did not converge, or leaves the numbers"
            raise StepError(what, "take a smaller step, or parameters where the motion exists")
        # jets have the axes of the derivatives first
        return Jet(out[0], np.moveaxis(out[1], 2, 0), np.moveaxis(out[2], (2, 3), (0, 1)))


def flow_of(
    model: LinearSystem | LagrangianSystem,
    names: Sequence[str],
    duration: float,
    step: float,
    integrator: str | Integrator = "midpoint",
) -> Flow:
    """Return the flow that computes trajectories of a linear structure or a Lagrangian system.

    `names` are the uncertain parameters; duration and step are in s. Lagrangian systems take the
    integrator "midpoint" alone.

    Raises:
        RefusedError: The structure has no such parameter or integrator.
    """
    if isinstance(model, LagrangianSystem):
        require_choice("integrator", integrator, ["midpoint"])
        return LagrangianFlow(model, tuple(names), duration, step)
    if isinstance(integrator, str):
        require_choice("integrator", integrator, INTEGRATORS)
        integrator = INTEGRATORS[integrator]
    return LinearFlow(model, tuple(names), duration, step, integrator)
