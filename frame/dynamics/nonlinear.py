"""Trajectories of Lagrangian systems by the midpoint variational integrator, compiled by Numba.

A state is (q, π): n coordinates and n momenta, with first derivatives of shape (2n, d) and second
ones of shape (2n, d, d) by d uncertain inputs. The equations come as tapes (`calculus/tape.py`), so
that one compilation serves all systems. Loops are written out, since Numba compiles them in a
fraction of the time that array expressions take.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, cast

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import require, require_choice
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.box_quadratic import solve_in_place
from alphacut.frame.calculus.polynomials import Jet
from alphacut.frame.calculus.tape import Tape, tape, with_derivatives
from alphacut.frame.dynamics.flow import Flow, LinearFlow, StepError
from alphacut.frame.dynamics.integrators import INTEGRATORS, Integrator
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import has_matrices
from alphacut.frame.structures.model import StructureModel
from alphacut.frame.structures.storey import yields


class Expressions(NamedTuple):
    """SymPy expressions and the symbols that they depend on.

    Derivatives are taken by the symbols in `active`; those in `constants` are the others.
    """

    components: list[Any]
    active: list[Any]
    constants: list[Any]


class SystemExpressions(NamedTuple):
    """What a time step needs of a Lagrangian system.

    `momenta` are those before and after a step, of the coordinates at both ends. `outputs` are the
    observed quantities of a state (eq. 18), and `initial` is the state at t = 0.
    """

    momenta: Expressions
    outputs: Expressions
    initial: Expressions


def make_flow(
    model: StructureModel,
    names: Sequence[str],
    duration: float,
    step: float,
    integrator: str | Integrator | None = None,
) -> Flow:
    """Return the mapping from parameter sets to trajectories that integrates a structure.

    Args:
        model: The structure.
        names: Names of the uncertain parameters.
        duration: Length of the simulation, in s: a whole number of steps.
        step: Length of a step, in s.
        integrator: The time integrator or its name. A linear structure takes "exact" and
            "midpoint", and "exact" if none is given; columns that yield take "exact" alone; a
            nonlinear smooth system "midpoint" alone.

    Returns:
        A `LinearFlow`, `YieldingFlow` or `LagrangianFlow`.

    Raises:
        RefusedError: The structure has no such parameter or takes no such integrator, or the
            duration is no whole number of steps.
    """
    name = integrator
    if isinstance(integrator, Integrator):
        name = integrator.name
    if yields(model):
        require(name in (None, "exact"), "integrator", name, "exact where columns yield")
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
        """Return the flow with half the step, and 2 for the substeps; both share their tapes."""
        fine = replace(self, step=self.step / 2)
        shared = ("_expressions", "_newton", "_plain")
        fine.__dict__.update({name: getattr(self, name) for name in shared})
        return fine, 2

    def deviations(self, points: Array) -> tuple[Array, Array]:
        """Return more accurate trajectories, and estimates of the errors of this flow.

        The more accurate ones have half the step. By Richardson's extrapolation of a method of
        order 2 the error is 4/3 of the distance between both trajectories; this is an estimate for
        small steps, and no bound.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each uncertain parameter.

        Returns:
            Trajectories and errors, both of shape (S, time nodes, outputs), in the units of the
            outputs.

        Raises:
            RefusedError: A trajectory does not exist, or is not finite.
            StepError: A step did not converge.
        """
        # Halving the step divides the error by 4: the distance is 3/4 of the error of this flow.
        fine = self.finer()[0].values(points)[:, ::2]
        return fine, np.abs(self.values(points) - fine) * 4 / 3

    @cached_property
    def _expressions(self) -> SystemExpressions:
        """SymPy expressions of a step, of the outputs and of the initial state.

        With n coordinates q, momenta π and uncertain parameters u: `momenta` are the n momenta
        before a step and the n after it, as functions of (q after, q before, u); `outputs` are the
        outputs as functions of (q, π, u); and `initial` are the n coordinates and n momenta at t =
        0 as functions of u. All depend on the other parameters as constants, in the order of the
        system's parameters; the momenta also on the length of the step, which is the last constant.
        """
        import sympy

        eq = self.system.symbols
        n = self.system.coordinates

        def column(name: str) -> Any:
            """Return n symbols as a column."""
            return sympy.Matrix(sympy.symbols(f"{name}:{n}", real=True))

        fuzzy = [eq.p[name] for name in self.names]
        constants = [x for name, x in eq.p.items() if name not in self.names]
        new = column("new")
        old = column("old")
        momenta = column("pi")
        h = sympy.Symbol("h", positive=True)
        coordinates_and_velocities = list(eq.q) + list(eq.v)
        # The discrete Lagrangian takes L and the force F at the mean of q[k] and q[k+1]:
        # π[k] = L_v − h/2 (L_q + F) and π[k+1] = L_v + h/2 (L_q + F)
        mean_state = list((old + new) / 2) + list((new - old) / h)
        at_mean = dict(zip(coordinates_and_velocities, mean_state, strict=True))
        momentum = eq.momentum.subs(at_mean)
        impulse = h / 2 * eq.push.subs(at_mean)
        q0, v0 = self.system.start()
        at_start = dict(zip(coordinates_and_velocities, list(q0) + list(v0), strict=True))
        velocity = eq.velocity(momenta)
        outputs = [self.system.output(name, velocity) for name in self.outputs]
        return SystemExpressions(
            momenta=Expressions(
                list(momentum - impulse) + list(momentum + impulse),
                active=list(new) + list(old) + fuzzy,
                constants=[*constants, h],
            ),
            outputs=Expressions(outputs, list(eq.q) + list(momenta) + fuzzy, constants),
            initial=Expressions(list(q0) + list(eq.momentum.subs(at_start)), fuzzy, constants),
        )

    @cached_property
    def _newton(self) -> Tape:
        """Tape of the n momenta before a step, then of their n × n derivatives.

        These are by the coordinates after the step, row by row: those of the first momentum come
        first. A tape is a list of operations that a compiled loop evaluates. Its arguments are the
        coordinates after and before the step, the parameters (the uncertain ones first) and the
        length of the step.
        """
        momenta = self._expressions.momenta
        n = self.system.coordinates
        before = momenta.components[:n]
        new_coordinates = momenta.active[:n]
        slopes = [momentum.diff(x) for momentum in before for x in new_coordinates]
        return tape(before + slopes, momenta.active, momenta.constants)

    @cached_property
    def _plain(self) -> list[Tape]:
        """Tapes of momenta, outputs and initial state, in this order, without derivatives."""
        return [tape(*expressions) for expressions in self._expressions]

    @cached_property
    def _deep(self) -> list[Tape]:
        """Tapes of momenta, outputs and initial state with first and second derivatives."""
        return [with_derivatives(*expressions) for expressions in self._expressions]

    def _march(self, points: Array, *, derivatives: bool) -> Jet:
        """Return trajectories at parameter sets, perhaps not finite.

        Args:
            points: Parameter sets in SI units, shape (S, d): a column for each uncertain parameter.
            derivatives: Whether the jet has first and second derivatives by the d parameters.

        Returns:
            Trajectories with their derivatives (a jet), shape (S, time nodes, outputs), in the
            units of the outputs.

        Raises:
            RefusedError: A function of the system is not smooth.
            StepError: A step did not converge, or its coordinates leave the range of numbers.
        """
        d = 0
        tapes = self._plain
        if derivatives:
            d = len(self.names)
            tapes = self._deep
        constants = [x for name, x in self.system.parameters.items() if name not in self.names]
        inputs = np.hstack([points, np.tile(constants, (len(points), 1))])
        inputs = np.ascontiguousarray(inputs, float)
        shape = (len(points), len(self.time), len(self.outputs))
        values = np.empty(shape)
        first = np.empty((*shape, d))
        second = np.empty((*shape, d, d))
        momenta, outputs, initial = tapes
        n = self.system.coordinates
        h = self.step
        is_whole = _march(
            self._newton, momenta, outputs, initial, n, inputs, h, values, first, second
        )
        if not is_whole:
            what = f"a step of {h:g} s did not converge, or leaves the numbers"
            raise StepError(what, "take a smaller step, or parameters where the motion exists")
        # jets have the axes of the derivatives first
        return Jet.of(values, np.moveaxis(first, 3, 0), np.moveaxis(second, (3, 4), (0, 1)))


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
    """Write trajectories and their derivatives; return False if a step fails.

    A state is n coordinates and then n momenta. A tape is a list of operations that evaluates
    several expressions at once. Where d > 0, a tape with derivatives gives first all expressions,
    then their first derivatives by all its variables, then their second ones.

    Args:
        newton: Tape of the n momenta before a step and their derivatives by the n new coordinates,
            at (new coordinates, old ones, parameters, length of the step).
        step: Tape of the n momenta before and the n after a step at the same arguments; where d > 0
            with derivatives by the coordinates and the d inputs.
        observe: Tape of the m outputs at (coordinates, momenta, parameters); where d > 0 with
            derivatives by the state and the d inputs.
        initial: Tape of the 2n initial coordinates and momenta at the parameters; where d > 0 with
            derivatives by the d inputs.
        n: Number of coordinates.
        inputs: Parameters of each set: the d inputs to differentiate by, then all others, shape (S,
            parameters).
        h: Length of a step, in s.
        out: Receives the outputs, shape (S, time nodes, m).
        out1: Receives their first derivatives, shape (S, time nodes, m, d); d may be 0.
        out2: Receives their second derivatives, shape (S, time nodes, m, d, d).

    Returns:
        Whether all steps of all sets converged. If not, the arrays are filled up to the failure.
    """
    size = 2 * n
    d = out1.shape[3]
    m = out.shape[2]
    a = size + d
    flat = np.empty(m + (m * a + m * a * a if d else 0))
    arguments = np.empty(size + len(inputs[0]))
    start = np.empty(size * (1 + d + d * d))
    # derivatives by the inputs of the state and of the inputs themselves
    inner1 = np.zeros((a, d))
    inner2 = np.zeros((a, d, d))
    for i in range(d):
        inner1[size + i, i] = 1.0
    for s in range(len(inputs)):
        arguments[size:] = inputs[s]
        _evaluate(initial, inputs[s], start)
        x = start[:size]
        x1 = start[size : size + size * d].reshape(size, d)
        x2 = start[size + size * d :].reshape(size, d, d)
        # node by node: a step, then the outputs of the state and their derivatives by the inputs
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
    """Advance a state by one midpoint step, in place; return False if the step fails.

    A state is n coordinates and then n momenta. Newton's method finds the new coordinates at which
    the momenta before the step are those of the state. The step fails if 30 iterations do not
    converge to 1e-12 of the coordinates, or a coordinate is not finite; the state is then
    unchanged. A tape is a list of operations that evaluates several expressions at once.

    Args:
        newton: Tape of the n momenta before the step, then of their n × n derivatives by the new
            coordinates, row by row, at (new coordinates, old ones, parameters, h).
        step: Tape of the n momenta before and the n after the step at the same arguments; where d >
            0 then of their first and second derivatives by the coordinates and the d inputs.
        n: Number of coordinates.
        p: Parameters: the d inputs first, then all others.
        h: Length of the step, in s.
        x: The state, shape (2n,).
        x1: Its first derivatives by the inputs, shape (2n, d); d may be 0.
        x2: Its second derivatives, shape (2n, d, d).
    """
    d = x1.shape[1]
    m = 2 * n
    n_parameters = len(p)
    arguments = np.empty(m + n_parameters + 1)
    flat = np.empty(n + n * n)
    residual = np.empty((n, 1))
    jacobian = np.empty((n, n))
    # the new coordinates, of which the old ones are the first guess, and the old ones
    arguments[:n] = arguments[n:m] = x[:n]
    arguments[m : m + n_parameters] = p
    arguments[m + n_parameters] = h
    max_iterations = 30  # five or six are usual; a step that is too long may need any number
    for _ in range(max_iterations):
        _evaluate(newton, arguments, flat)
        for i in range(n):
            residual[i, 0] = flat[i] - x[n + i]
            for j in range(n):
                jacobian[i, j] = flat[n + i * n + j]
        solve_in_place(jacobian, residual)  # `residual` becomes the change of the coordinates
        change = 0.0
        size = 0.0
        for i in range(n):
            arguments[i] -= residual[i, 0]
            if not math.isfinite(arguments[i]):
                return False
            change = max(change, abs(residual[i, 0]))
            size = max(size, abs(arguments[i]))
        if change <= 1e-12 * (1 + size):
            break
    else:
        # not converged: the step is too long, or there is no motion
        return False
    # momenta after the step, and derivatives of both momenta, at the new coordinates
    a = m + d
    flat = np.empty(m + (m * a + m * a * a if d else 0))
    _evaluate(step, arguments, flat)
    x[:n] = arguments[:n]
    x[n:] = flat[n:m]
    if d:
        _step_derivatives(flat, n, x1, x2)
    return True


@compiled
def _step_derivatives(flat: Array, n: int, x1: Array, x2: Array) -> None:
    """Advance the derivatives of a state by one midpoint step, in place.

    A state is n coordinates and then n momenta. The new coordinates solve the equations π[k](new,
    old, inputs) = momenta of the state, which are differentiated by the d inputs once and twice
    (implicit function theorem). With the matrix J of the derivatives of π[k] by the new
    coordinates, J new_i is the derivative of the state's momenta by input i, less that of π[k] with
    the new coordinates held.

    Args:
        flat: One array after another: the n momenta before and the n after the step, shape (2n,),
            then their first derivatives, (2n, a), and second ones, (2n, a, a), by the a variables:
            n new coordinates, n old ones, d inputs.
        n: Number of coordinates.
        x1: First derivatives of the state by the inputs, shape (2n, d): before the step on entry,
            after it on return.
        x2: Its second derivatives, shape (2n, d, d), likewise.
    """
    m, d = x1.shape
    a = m + d
    J = np.empty((n, n))  # derivatives of the momenta before the step by the new coordinates
    # derivatives of the variables by the inputs
    inner1 = np.zeros((a, d))
    inner2 = np.zeros((a, d, d))
    out1 = np.empty((m, d))
    out2 = np.empty((m, d, d))
    new_first = np.empty((n, d))
    new_second = np.empty((n, d * d))
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
    # The second derivatives need the first ones of the new coordinates. Their own part, J new_ij,
    # is what remains when all other terms are taken from the state's.
    inner1[:n] = new_first
    _chain_rule(flat, inner1, inner2, out1, out2)
    for c in range(n):
        for i in range(d):
            for j in range(d):
                new_second[c, i * d + j] = x2[n + c, i, j] - out2[c, i, j]
    solve_in_place(J, new_second)
    for c in range(n):  # coordinates and momenta after the step
        for i in range(d):
            x1[c, i] = inner1[c, i]
            x1[n + c, i] = out1[n + c, i]
            for j in range(d):
                x2[c, i, j] = new_second[c, i * d + j]
                total = out2[n + c, i, j]
                for k in range(n):
                    total += flat[m + (n + c) * a + k] * new_second[k, i * d + j]
                x2[n + c, i, j] = total


@compiled
def _chain_rule(flat: Array, inner1: Array, inner2: Array, out1: Array, out2: Array) -> None:
    """Write first and second derivatives of m functions by d inputs, by the chain rule.

    Args:
        flat: The functions, (m,), their first derivatives, (m, a), and second ones, (m, a, a), by a
            variables, one array after another.
        inner1: First derivatives of the variables by the inputs, shape (a, d).
        inner2: Second derivatives of the variables, shape (a, d, d).
        out1: Receives the first derivatives, shape (m, d).
        out2: Receives the second derivatives, shape (m, d, d).
    """
    m = len(out1)
    d = len(out1[0])
    a = len(inner1)
    hessian_row = np.empty(a)
    hessian_at = m + m * a
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
    """Write the values of a tape's m expressions to `out`.

    A tape is (operations, places of the results, array of places). The array of places holds the
    arguments, then the result of each operation, then constants. An operation is three whole
    numbers: its code, and the places of two operands, which may be negative to count from the end.
    Codes are 0 x + y, 1 x · y, 2 x^y, 3 1/x, 4 √x, 5 sin x, 6 cos x, 7 tan x, 8 exp x and 9 log x,
    of which those from 3 on ignore y. What is not defined, such as 1/0 or √−1, gives infinity or
    NaN.

    Args:
        tape: The tape. Its array of places is overwritten.
        arguments: Values of the arguments, in the order of the tape.
        out: Receives the m values in its first entries.
    """
    code, results, slots = tape
    for k in range(len(arguments)):
        slots[k] = arguments[k]
    for k in range(len(code)):
        number = code[k, 0]
        x = slots[code[k, 1]]
        y = slots[code[k, 2]]
        if number == 0:
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
