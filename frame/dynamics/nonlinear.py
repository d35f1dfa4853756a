"""Trajectories of general systems with internal derivatives, many sets at once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from alphacut.frame.calculus.jet import Array, Jet, concatenate
from alphacut.frame.calculus.symbolic import Compiled, compiled
from alphacut.frame.dynamics.compiled_march import CompiledMarch, compiled_march
from alphacut.frame.dynamics.flow import March, StepError, nodes
from alphacut.frame.structures.lagrangian import LagrangianSystem

TRIPLE_JUMP = (1 / (2 - 2 ** (1 / 3)), -(2 ** (1 / 3)) / (2 - 2 ** (1 / 3)), 1 / (2 - 2 ** (1 / 3)))
"""Lengths of three symmetric steps of order 2 that make one of order 4 (Yoshida 1990)."""
SCHEMES = {"midpoint": 2, "composition4": 4, "rk4": 4}
"""Schemes with their orders: the midpoint variational integrator, its composition of order 4, and
the Runge–Kutta method.
"""

OF_SYSTEM = " to a general Lagrangian system"


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
                    raise ValueError(
                        f"{kind} '{name}' is unknown{OF_SYSTEM if known is SCHEMES else ''}; known"
                        f" are {', '.join(known)}"
                    )
        nodes(self.duration, self.step)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the observed quantities."""
        return self.observe or self.system.outputs

    def halved(self) -> LagrangianFlow:
        """The same with half the step; what is compiled is shared."""
        fine = replace(self, step=self.step / 2)
        shared = ("_stepper", "_observation", "_compiled")
        fine.__dict__.update({name: getattr(self, name) for name in shared})
        return fine

    @cached_property
    def _stepper(self) -> RungeKutta | Variational:
        return (
            RungeKutta(self.system, self.names)
            if self.scheme == "rk4"
            else Variational(self.system, self.names)
        )

    @cached_property
    def _observation(self) -> tuple[Compiled, Compiled]:
        """Outputs of (state, parameters), and the initial state from the parameters."""
        eq = self.system.symbols
        own = [eq.p[name] for name in self.names]
        rest = [symbol for name, symbol in eq.p.items() if name not in self.names]
        state, velocity = _state_symbols(eq, self.scheme)
        seen = [self.system.output(name, velocity) for name in self.outputs]
        q0, v0 = self.system.start()
        second = (
            list(v0)
            if self.scheme == "rk4"
            else list(eq.momentum.subs(dict(zip([*eq.q, *eq.v], [*q0, *v0], strict=True))))
        )
        return compiled(seen, [*state, *own], rest), compiled([*q0, *second], own, rest)

    @cached_property
    def _compiled(self) -> CompiledMarch | None:
        """The march in C; None where there is no compiler."""
        own, all_ = len(self.names), len(self.system.parameters)
        return compiled_march(
            {**self._stepper.functions, "observe": self._observation[0]},
            coordinates=self.system.coordinates,
            own=own,
            rest=all_ - own,
            outputs=len(self.outputs),
        )

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        d = len(self.names) if derivatives else 0
        fixed = [value for name, value in self.system.parameters.items() if name not in self.names]
        constants = tuple(np.full(len(points), value) for value in fixed)
        parameters = Jet.constant(points.T, d)
        for i in range(d):
            parameters.first[i, i] = 1.0
        observe, initial = self._observation
        state = initial.chain(parameters, constants)
        lengths = TRIPLE_JUMP if self.scheme == "composition4" else (1.0,)
        if self._compiled is not None:
            given = np.hstack([points, np.tile(fixed, (len(points), 1))])
            parts = [share * self.step for share in lengths]
            found, failure = self._compiled.run(state, given, parts, len(self.time))
            if failure:
                raise StepError(f"a step of {self.step:g} s {failure}")
            return found
        states = [state]
        for _ in range(len(self.time) - 1):
            for share in lengths:
                state = self._stepper(state, parameters, constants, share * self.step)
            states.append(state)
        return self._observed(observe, states, parameters, constants)

    def _observed(
        self, observe: Compiled, states: list[Jet], parameters: Jet, constants: tuple[Array, ...]
    ) -> Jet:
        total, count = len(states), parameters.value.shape[-1]
        path = concatenate(states, -1)  # V = (2n, T S), node by node
        tiled = parameters.map(lambda x: np.tile(x, total))
        # eq. 18: f(t; p) from the states
        out = observe.chain(concatenate([path, tiled], -2), [np.tile(c, total) for c in constants])
        return out.map(
            lambda x: np.moveaxis(
                x.reshape((*x.shape[:-1], total, count)), (-1, -2, -3), (-3, -2, -1)
            )
        )


def _state_symbols(eq: Any, scheme: str) -> tuple[list[Any], Any]:
    """Symbols of the state, (q, v) or (q, momentum), and the velocity in terms of them."""
    if scheme == "rk4":
        return [*eq.q, *eq.v], eq.v
    import sympy

    momenta = sympy.Matrix(sympy.symbols(f"pi:{len(eq.q)}", real=True))
    return [*eq.q, *momenta], eq.velocity(momenta)


class Variational:
    """Step of the midpoint variational integrator for (q, momentum), by Newton on q[k+1].

    With q̄ = (q[k] + q[k+1])/2 and v̄ = (q[k+1] − q[k])/h: π[k] = L_v − h/2 (L_q + F), π[k+1] = L_v
    + h/2 (L_q + F). The converged
    Jacobian serves all derivatives: one Newton step on jets makes first derivatives exact, a second
        one the second derivatives.
    """

    def __init__(self, system: LagrangianSystem, names: tuple[str, ...]) -> None:
        import sympy

        eq, n = system.symbols, system.coordinates
        old, new = (sympy.Matrix(sympy.symbols(f"{x}:{n}", real=True)) for x in ("old", "new"))
        h = sympy.Symbol("h", positive=True)
        middle = dict(zip([*eq.q, *eq.v], [*((old + new) / 2), *((new - old) / h)], strict=True))
        momentum, push = eq.momentum.subs(middle), eq.push.subs(middle)
        own = [eq.p[name] for name in names]
        rest = [symbol for name, symbol in eq.p.items() if name not in names]
        start, end = list(momentum - h / 2 * push), list(momentum + h / 2 * push)
        self.n = n
        slopes = [sympy.diff(e, x) for e in start for x in new]
        self.newton = compiled([*start, *slopes], [], [*new, *old, *own, *rest, h])
        self.both = compiled([*start, *end], [*new, *old, *own], [*rest, h])
        self.functions = {"newton": self.newton, "both": self.both}

    def __call__(
        self, state: Jet, parameters: Jet, constants: tuple[Array, ...], step: float
    ) -> Jet:
        """The state after `step`, V = (2n, S)."""
        n, old, pi = self.n, state[: self.n], state[self.n :]
        h = np.full(pi.value.shape[-1], step)
        new, J = self._solve(
            old.value, pi.value, [*old.value, *parameters.value, *constants, h], step
        )
        if not state.directions:
            end = self.both.values([*new, *old.value, *parameters.value, *constants, h])[n:]
            return Jet(
                np.concatenate([new, end]),
                np.zeros((0, 2 * n, len(h))),
                np.zeros((0, 0, 2 * n, len(h))),
            )
        return self._differentiated(new, J, state, parameters, (*constants, h))

    def _differentiated(
        self, new: Array, J: Array, state: Jet, parameters: Jet, constants: tuple[Array, ...]
    ) -> Jet:
        """Derivatives of the implicit step with the converged Jacobian."""
        n, pi = self.n, state[self.n :]
        f, g, H = self.both.taylor([*new, *state.value[:n], *parameters.value, *constants])
        # by old q and parameters
        known_first = np.concatenate([state.first[:, :n], parameters.first], 1)
        inverse = np.moveaxis(np.linalg.inv(np.moveaxis(J, -1, 0)), 0, -1)
        right = pi.first - np.einsum("mas,das->dms", g[:n, n:], known_first)
        first = np.einsum("mas,das->dms", inverse, right)
        all_first = np.concatenate([first, known_first], 1)
        bent = np.einsum("mabs,das,ebs->dems", H, all_first, all_first, optimize=PATH)
        bent += np.einsum("mas,deas->dems", g[:, n : 2 * n], state.second[:, :, :n])
        second = np.einsum("mas,deas->dems", inverse, pi.second - bent[:, :, :n])
        end_first = np.einsum("mas,das->dms", g[n:], all_first)
        end_second = bent[:, :, n:] + np.einsum("mas,deas->dems", g[n:, :n], second)
        return Jet(
            np.concatenate([new, f[n:]]),
            np.concatenate([first, end_first], 1),
            np.concatenate([second, end_second], 2),
        )

    def _solve(
        self, old: Array, pi: Array, arguments: list[Array], step: float
    ) -> tuple[Array, Array]:
        n, new = self.n, old.copy()
        for _ in range(30):
            flat = self.newton.values([*new, *arguments])
            J = flat[n:].reshape(n, n, -1)
            residual = flat[:n] - pi
            change = np.linalg.solve(np.moveaxis(J, -1, 0), residual.T[..., None])[..., 0].T
            if not np.isfinite(change).all():
                raise StepError(
                    "the equations of motion are not finite; keep the start and the parameters"
                    " where they are"
                )
            new = new - change
            if np.abs(change).max() <= 1e-12 * (1 + np.abs(new).max()):
                return new, J
        last = np.abs(change).max()
        raise StepError(
            f"a step of {step:g} s did not converge in 30 iterations (last change {last:.2g}); take"
            " a smaller step"
        )


PATH = ["einsum_path", (0, 1), (0, 1)]


class RungeKutta:
    """One step of the classical Runge–Kutta method for (q, v)."""

    def __init__(self, system: LagrangianSystem, names: tuple[str, ...]) -> None:
        eq = system.symbols
        own = [eq.p[name] for name in names]
        rest = [symbol for name, symbol in eq.p.items() if name not in names]
        # eq. 17 of a Lagrangian system
        self.flow = compiled([*eq.v, *eq.acceleration()], [*eq.q, *eq.v, *own], rest)
        self.functions = {"flow": self.flow}

    def __call__(
        self, state: Jet, parameters: Jet, constants: tuple[Array, ...], step: float
    ) -> Jet:
        """The state after `step`, V = (2n, S)."""

        def slope(at: Jet) -> Jet:
            if not at.directions:
                values = self.flow.values([*at.value, *parameters.value, *constants])
                return Jet(values, np.zeros((0, *values.shape)), np.zeros((0, 0, *values.shape)))
            return self.flow.chain(concatenate([at, parameters], -2), constants)

        k1 = slope(state)
        k2 = slope(state + k1 * (step / 2))
        k3 = slope(state + k2 * (step / 2))
        k4 = slope(state + k3 * step)
        return state + (k1 + k2 * 2 + k3 * 2 + k4) * (step / 6)
