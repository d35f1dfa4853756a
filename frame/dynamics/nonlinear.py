"""Trajectories of Lagrangian systems with derivatives by the inputs, compiled by Numba.

A state is (q, π), coordinates and momenta, 2n numbers, with first derivatives (2n, d) and second
ones (2n, d, d) by d inputs. The equations come as tapes (`calculus/tape.py`), so that one
compilation serves all systems. Loops are written out: they compile in a fraction of the time that
array expressions take.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require_choice
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.box_quadratic import solve_in_place
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.calculus.tape import Tape, tape, with_derivatives
from alphacut.frame.dynamics.flow import Flow, LinearFlow, StepError
from alphacut.frame.dynamics.integrators import INTEGRATORS, Integrator
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import has_matrices
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import yields

Expressions = tuple[list[Any], list[Any], list[Any]]
"""Components, and the symbols they depend on: those to differentiate by, and others."""
MAX_ITERATIONS = 30
"""Newton steps after which a time step has not converged."""


def make_flow(
    model: StructureModel,
    names: Sequence[str],
    duration: float,
    step: float,
    integrator: str | Integrator | None = None,
) -> Flow:
    """Return the flow of a structure, as its dynamics ask for.

    Args:
        model: The structure.
        names: Uncertain parameters.
        duration: Length of the simulation, in s.
        step: Length of a step, in s.
        integrator: Time stepping or its name. If not given it is exact where the structure has an
            exact solution, else the midpoint scheme.

    Raises:
        RefusedError: The structure has no such parameter, or is not integrated so.
    """
    name = integrator.name if isinstance(integrator, Integrator) else integrator
    if yields(model):
        require_choice("integrator", name or "exact", ["exact"])
        return YieldingFlow(model, tuple(names), duration, step)
    if has_matrices(model):
        scheme = integrator or "exact"
        if isinstance(scheme, str):
            require_choice("integrator", scheme, INTEGRATORS)
            scheme = INTEGRATORS[scheme]
        return LinearFlow(model, tuple(names), duration, step, scheme)
    require_choice("integrator", name or "midpoint", ["midpoint"])
    return LagrangianFlow(cast("LagrangianSystem", model), tuple(names), duration, step)


@dataclass(frozen=True, eq=False)
class LagrangianFlow(Flow):
    """Trajectories of a Lagrangian system by the midpoint variational integrator."""

    system: LagrangianSystem

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
        """Momenta before and after a step; outputs of a state (eq. 18); the initial state."""
        import sympy

        eq, n = self.system.symbols, self.system.coordinates
        fuzzy = [eq.p[name] for name in self.names]
        constants = [x for name, x in eq.p.items() if name not in self.names]
        new, old, momenta = (
            sympy.Matrix(sympy.symbols(f"{x}:{n}", real=True)) for x in ("new", "old", "pi")
        )
        h = sympy.Symbol("h", positive=True)
        # π[k] = L_v − h/2 (L_q + F) and π[k+1] = L_v + h/2 (L_q + F) at the mean of q[k] and q[k+1]
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
        return [tape(*expression) for expression in self._expressions]

    @cached_property
    def _deep(self) -> list[Tape]:
        return [with_derivatives(*expression) for expression in self._expressions]

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        d = len(self.names) if derivatives else 0
        constants = [x for name, x in self.system.parameters.items() if name not in self.names]
        inputs = np.hstack([points, np.tile(constants, (len(points), 1))])
        inputs = np.ascontiguousarray(inputs, float)
        tapes = (self._newton, *(self._deep if d else self._plain))
        nodes = (len(points), len(self.time))
        out = [np.empty((*nodes, len(self.outputs), *(d,) * order)) for order in range(3)]
        if not _march(*tapes, self.system.coordinates, inputs, self.step, *out):
            what = f"a step of {self.step:g} s did not converge, or leaves the numbers"
            raise StepError(what, "take a smaller step, or parameters where the motion exists")
        # jets have the axes of the derivatives first
        return Jet.of(out[0], np.moveaxis(out[1], 3, 0), np.moveaxis(out[2], (3, 4), (0, 1)))


@compiled
def _march(
    newton: Tape,
    step: Tape,
    observe: Tape,
    initial: Tape,
    n: int,
    inputs: Array,
    h: float,
    out: Array,
    out1: Array,
    out2: Array,
) -> bool:
    """Write outputs (S, T, m) and derivatives (S, T, m, d), (S, T, m, d, d); False if a step fails.

    The tapes are those of `LagrangianFlow`, with derivatives where d > 0; `inputs` (S, K) are d
    inputs and then other parameters.
    """
    size, d, m = 2 * n, out1.shape[3], out.shape[2]
    a = size + d
    flat, arguments = np.empty(m + (m * a + m * a * a if d else 0)), np.empty(size + len(inputs[0]))
    start = np.empty(size * (1 + d + d * d))
    inner1, inner2 = np.zeros((a, d)), np.zeros((a, d, d))  # of state and inputs by the inputs
    for i in range(d):
        inner1[size + i, i] = 1.0
    for s in range(len(inputs)):
        arguments[size:] = inputs[s]
        _evaluate(initial, inputs[s], start)
        x = start[:size]
        x1 = start[size : size + size * d].reshape(size, d)
        x2 = start[size + size * d :].reshape(size, d, d)
        for t in range(out.shape[1]):
            if t and not _midpoint_step(newton, step, n, inputs[s], h, x, x1, x2):
                return False
            arguments[:size] = x
            _evaluate(observe, arguments, flat)
            out[s, t] = flat[:m]
            if d:
                inner1[:size] = x1
                inner2[:size] = x2
                _chain_rule(flat, inner1, inner2, out1[s, t], out2[s, t])
    return True


@compiled
def _midpoint_step(
    newton: Tape, step: Tape, n: int, p: Array, h: float, x: Array, x1: Array, x2: Array
) -> bool:
    """Advance a state x (2n,) with derivatives x1 and x2 in place; return False if it fails."""
    d, m, n_parameters = x1.shape[1], 2 * n, len(p)
    arguments, flat = np.empty(m + n_parameters + 1), np.empty(n + n * n)
    # Newton's method finds new coordinates whose momenta before the step are those of the state
    residual, jacobian = np.empty((n, 1)), np.empty((n, n))
    arguments[:n] = arguments[n:m] = x[:n]  # new coordinates, guessed, and old ones
    arguments[m : m + n_parameters] = p
    arguments[m + n_parameters] = h
    for _ in range(MAX_ITERATIONS):
        _evaluate(newton, arguments, flat)
        for i in range(n):
            residual[i, 0] = flat[i] - x[n + i]
            for j in range(n):
                jacobian[i, j] = flat[n + i * n + j]
        solve_in_place(jacobian, residual)
        change, size = 0.0, 0.0
        for i in range(n):
            arguments[i] -= residual[i, 0]
            if not math.isfinite(arguments[i]):
                return False
            change, size = max(change, abs(residual[i, 0])), max(size, abs(arguments[i]))
        if change <= 1e-12 * (1 + size):
            break
    else:
        return False
    a = m + d
    flat = np.empty(m + (m * a + m * a * a if d else 0))
    _evaluate(step, arguments, flat)
    x[:n], x[n:] = arguments[:n], flat[n:m]
    if d:
        _step_derivatives(flat, n, x1, x2)
    return True


@compiled
def _step_derivatives(flat: Array, n: int, x1: Array, x2: Array) -> None:
    """Advance derivatives x1 (2n, d) and x2 (2n, d, d) of a state by one midpoint step, in place.

    `flat` holds the momenta before and after the step, with first and second derivatives by new and
    old coordinates and the inputs.
    """
    m, d = x1.shape
    a = m + d
    J = np.empty((n, n))  # of the momenta before the step by the new coordinates
    # derivatives of the variables (new coordinates, old coordinates, inputs) by the inputs
    inner1, inner2 = np.zeros((a, d)), np.zeros((a, d, d))
    out1, out2 = np.empty((m, d)), np.empty((m, d, d))
    new_first, new_second = np.empty((n, d)), np.empty((n, d * d))
    for i in range(n):
        for j in range(n):
            J[i, j] = flat[m + i * a + j]
    for i in range(d):
        inner1[m + i, i] = 1.0
    inner1[n:m] = x1[:n]
    inner2[n:m] = x2[:n]
    _chain_rule(flat, inner1, inner2, out1, out2)  # while the new coordinates are held
    new_first[:] = x1[n:] - out1[:n]
    solve_in_place(J, new_first)
    inner1[:n] = new_first
    _chain_rule(flat, inner1, inner2, out1, out2)
    for c in range(n):
        for i in range(d):
            for j in range(d):
                new_second[c, i * d + j] = x2[n + c, i, j] - out2[c, i, j]
    solve_in_place(J, new_second)
    for c in range(n):  # coordinates and momenta after the step
        for i in range(d):
            x1[c, i], x1[n + c, i] = inner1[c, i], out1[n + c, i]
            for j in range(d):
                x2[c, i, j] = new_second[c, i * d + j]
                total = out2[n + c, i, j]
                for k in range(n):
                    total += flat[m + (n + c) * a + k] * new_second[k, i * d + j]
                x2[n + c, i, j] = total


@compiled
def _chain_rule(flat: Array, inner1: Array, inner2: Array, out1: Array, out2: Array) -> None:
    """Write first and second derivatives of m functions by d inputs to `out1` and `out2`.

    `flat` holds the functions (m,), their first derivatives (m, a) and their second ones (m, a, a)
    by a variables; `inner1` (a, d) and `inner2` (a, d, d) those of the variables by the inputs.
    """
    m, d, a = len(out1), len(out1[0]), len(inner1)
    hessian_row, hessian_at = np.empty(a), m + m * a
    for c in range(m):
        for i in range(d):
            total = 0.0
            for x in range(a):
                total += flat[m + c * a + x] * inner1[x, i]
            out1[c, i] = total
            for y in range(a):  # the Hessian of f_c times the derivatives by input i
                hessian_row[y] = 0.0
                for x in range(a):
                    hessian_row[y] += flat[hessian_at + (c * a + x) * a + y] * inner1[x, i]
            for j in range(i, d):
                total = 0.0
                for x in range(a):
                    total += flat[m + c * a + x] * inner2[x, i, j] + hessian_row[x] * inner1[x, j]
                out2[c, i, j] = out2[c, j, i] = total


@compiled
def _evaluate(tape: Tape, arguments: Array, out: Array) -> None:
    """Write the values of a tape's m expressions at arguments (K,) to `out`."""
    code, results, slots = tape  # slots: arguments first, then results of operations
    for k in range(len(arguments)):
        slots[k] = arguments[k]
    for k in range(len(code)):
        number, x, y = code[k, 0], slots[code[k, 1]], slots[code[k, 2]]
        if number == 0:  # by the order of `tape.OPERATIONS`; functions of one argument ignore y
            value = x + y
        elif number == 1:
            value = x * y
        elif number == 2:
            value = x**y
        elif number == 3:
            value = 1 / x
        elif number == 4:
            value = math.sqrt(x)
        elif number == 5:
            value = math.sin(x)
        elif number == 6:
            value = math.cos(x)
        elif number == 7:
            value = math.tan(x)
        elif number == 8:
            value = math.exp(x)
        else:
            value = math.log(x)
        slots[len(arguments) + k] = value
    for k in range(len(results)):
        out[k] = slots[results[k]]
