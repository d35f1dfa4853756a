"""Time steps of general systems with derivatives by the inputs, compiled by Numba.

A state is (q, π), 2n numbers, with first derivatives (d, 2n) and second ones (d, d, 2n) by the
inputs. The equations come as tapes (`calculus/tape.py`), so that one compilation serves all
systems. Loops are written out: they compile in a fraction of the time that array expressions take.
"""

from __future__ import annotations

import math

import numpy as np

from alphacut.frame.calculus.kernels import compiled
from alphacut.frame.calculus.tape import Tape
from alphacut.fuzzy.arrays import Array

ITERATIONS = 30
"""Newton steps after which a time step has not converged."""


@compiled
def operation(number: int, x: float, y: float) -> float:
    """Return operation `number` of `tape.OPERATIONS` on x and y; functions of one ignore y."""
    if number == 0:
        return x + y
    if number == 1:
        return x * y
    if number == 2:
        return x**y
    if number == 3:
        return 1 / x
    if number == 4:
        return math.sqrt(x)
    if number == 5:
        return math.sin(x)
    if number == 6:
        return math.cos(x)
    if number == 7:
        return math.tan(x)
    if number == 8:
        return math.exp(x)
    return math.log(x)


@compiled
def evaluate(tape: Tape, arguments: Array, out: Array) -> None:
    """Write the values of a tape's m expressions at arguments (K,) to `out`."""
    # operations with the slots of their operands (L, 3), slots of results (m,), and all slots:
    # arguments first, then one for each operation
    code, results, slots = tape
    for k in range(len(arguments)):
        slots[k] = arguments[k]
    for k in range(len(code)):
        slots[len(arguments) + k] = operation(code[k, 0], slots[code[k, 1]], slots[code[k, 2]])
    for k in range(len(results)):
        out[k] = slots[results[k]]


@compiled
def chain_rule_first(flat: Array, m: int, a: int, inner1: Array, out1: Array) -> None:
    """Write first derivatives of m functions f by d inputs to `out1` (d, m), by the chain rule.

    `flat` holds f (m,) and its derivatives (m, a) by its variables, one after the other; `inner1`
    (d, a) are first derivatives of the variables by the inputs.
    """
    for i in range(len(inner1)):
        for c in range(m):
            total = 0.0
            for x in range(a):
                total += flat[m + c * a + x] * inner1[i, x]
            out1[i, c] = total


@compiled
def chain_rule_second(
    flat: Array, m: int, a: int, inner1: Array, inner2: Array, out1: Array, out2: Array
) -> None:
    """Write derivatives of m functions f by d inputs to `out1` (d, m) and `out2` (d, d, m).

    `flat` holds f (m,) and its derivatives (m, a), (m, a, a) by its variables, one after the other;
    `inner1` (d, a) and `inner2` (d, d, a) are derivatives of the variables by the inputs.
    """
    chain_rule_first(flat, m, a, inner1, out1)
    d, hessian_row, hessian_at = len(inner1), np.empty(a), m + m * a
    for c in range(m):
        for i in range(d):
            for y in range(a):  # the Hessian of f_c times the derivatives by input i
                hessian_row[y] = 0.0
                for x in range(a):
                    hessian_row[y] += flat[hessian_at + (c * a + x) * a + y] * inner1[i, x]
            for j in range(i, d):
                total = 0.0
                for x in range(a):
                    total += flat[m + c * a + x] * inner2[i, j, x] + hessian_row[x] * inner1[j, x]
                out2[i, j, c] = out2[j, i, c] = total


@compiled
def solve(matrix: Array, b: Array) -> None:
    """Overwrite b (n, m) with the solutions x of A x = b by elimination with row exchanges."""
    n, m, A = len(matrix), b.shape[1], matrix.copy()
    for k in range(n):
        pivot = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[pivot, k]):
                pivot = i
        for j in range(n):
            A[k, j], A[pivot, j] = A[pivot, j], A[k, j]
        for j in range(m):
            b[k, j], b[pivot, j] = b[pivot, j], b[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k, n):
                A[i, j] -= factor * A[k, j]
            for j in range(m):
                b[i, j] -= factor * b[k, j]
    for k in range(n - 1, -1, -1):
        for j in range(m):
            for i in range(k + 1, n):
                b[k, j] -= A[k, i] * b[i, j]
            b[k, j] /= A[k, k]


@compiled
def solve_step(newton: Tape, n: int, arguments: Array, pi: Array, flat: Array) -> bool:
    """Solve for the n coordinates after a step by Newton's method; return False if it fails.

    Tape `newton` gives the momenta before the step, to equal `pi`, and their derivatives by these
    coordinates: the first `arguments`, a guess, which is overwritten. `flat` is work space.
    """
    residual, jacobian = np.empty((n, 1)), np.empty((n, n))
    for _ in range(ITERATIONS):
        evaluate(newton, arguments, flat)
        for i in range(n):
            residual[i, 0] = flat[i] - pi[i]
            for j in range(n):
                jacobian[i, j] = flat[n + i * n + j]
        solve(jacobian, residual)
        change, size = 0.0, 0.0
        for i in range(n):
            arguments[i] -= residual[i, 0]
            if not math.isfinite(arguments[i]):
                return False
            change, size = max(change, abs(residual[i, 0])), max(size, abs(arguments[i]))
        if change <= 1e-12 * (1 + size):
            return True
    return False


@compiled
def midpoint_step(
    newton: Tape, step: Tape, n: int, p: Array, h: float, x: Array, x1: Array, x2: Array
) -> bool:
    """Advance a state by one step of the midpoint rule, in place; return False if it fails.

    The state is n coordinates and momenta, x (2n,), with derivatives x1 (d, 2n) and x2 (d, d, 2n)
    by d inputs, the first of the parameters p. Tape `newton` gives the momenta before the step, as
    in `solve_step`; `step` the momenta before and after it, with derivatives where d > 0.
    """
    d, m, n_parameters = len(x1), 2 * n, len(p)
    a = m + d
    arguments, momenta_before = np.empty(m + n_parameters + 1), x[n:].copy()
    for i in range(n):
        arguments[i] = arguments[n + i] = x[i]  # new coordinates, guessed, and old ones
    for i in range(n_parameters):
        arguments[m + i] = p[i]
    arguments[m + n_parameters] = h
    if not solve_step(newton, n, arguments, momenta_before, np.empty(n + n * n)):
        return False
    flat = np.empty(m + (m * a + m * a * a if d else 0))
    evaluate(step, arguments, flat)
    for i in range(n):
        x[i], x[n + i] = arguments[i], flat[n + i]
    if d:
        step_derivatives(flat, n, x1, x2)
    return True


@compiled
def step_derivatives(flat: Array, n: int, x1: Array, x2: Array) -> None:
    """Advance derivatives x1 (d, 2n) and x2 (d, d, 2n) of a state by one midpoint step, in place.

    `flat` holds the momenta before and after the step, with first and second derivatives by new and
    old coordinates and the inputs. The momenta before the step, whose Jacobian by the new
    coordinates is J, determine these: one linear system with J gives their first derivatives,
    another one the second ones.
    """
    d, m = len(x1), 2 * n
    a = m + d
    J = np.empty((n, n))
    # derivatives of the variables (new coordinates, old coordinates, inputs) by the inputs
    inner1, inner2 = np.zeros((d, a)), np.zeros((d, d, a))
    out1, out2 = np.empty((d, m)), np.empty((d, d, m))
    new_first, new_second = np.empty((n, d)), np.empty((n, d * d))
    for i in range(n):
        for j in range(n):
            J[i, j] = flat[m + i * a + j]
    for i in range(d):
        inner1[i, m + i] = 1.0
        for c in range(n):
            inner1[i, n + c] = x1[i, c]
            for j in range(d):
                inner2[i, j, n + c] = x2[i, j, c]
    # of both momenta while the new coordinates are held
    chain_rule_first(flat, m, a, inner1, out1)
    for c in range(n):
        for i in range(d):
            new_first[c, i] = x1[i, n + c] - out1[i, c]
    solve(J, new_first)
    for c in range(n):
        for i in range(d):
            inner1[i, c] = new_first[c, i]
    chain_rule_second(flat, m, a, inner1, inner2, out1, out2)
    for c in range(n):
        for i in range(d):
            for j in range(d):
                new_second[c, i * d + j] = x2[i, j, n + c] - out2[i, j, c]
    solve(J, new_second)
    for i in range(d):  # coordinates and momenta after the step
        for c in range(n):
            x1[i, c], x1[i, n + c] = inner1[i, c], out1[i, n + c]
            for j in range(d):
                x2[i, j, c] = new_second[c, i * d + j]
                total = out2[i, j, n + c]
                for k in range(n):
                    total += flat[m + (n + c) * a + k] * new_second[k, i * d + j]
                x2[i, j, n + c] = total


@compiled
def march(
    newton: Tape,
    step: Tape,
    observe: Tape,
    inputs: Array,
    h: float,
    state: Array,
    first: Array,
    second: Array,
    out: Array,
    out1: Array,
    out2: Array,
) -> bool:
    """Write outputs of S motions at T nodes, with derivatives; return False if a step fails.

    Args:
        newton: Tape of the momenta before a step and their derivatives, as of `solve_step`.
        step: Tape of the momenta before and after a step, with derivatives where d > 0.
        observe: Tape of the outputs of a state, likewise.
        inputs: Inputs and then other parameters, shape (S, K).
        h: Length of a step, in s.
        state: Initial coordinates and momenta, shape (S, 2n), overwritten with the last ones.
        first: Their first derivatives by the d inputs, shape (S, d, 2n), overwritten likewise.
        second: Their second ones, shape (S, d, d, 2n), overwritten likewise.
        out: Written: outputs, shape (S, T, m).
        out1: Written: their first derivatives, shape (S, T, d, m).
        out2: Written: their second ones, shape (S, T, d, d, m).
    """
    size, d, m = state.shape[1], first.shape[1], out.shape[2]
    n, a = size // 2, size + d
    flat, arguments = np.empty(m + (m * a + m * a * a if d else 0)), np.empty(size + len(inputs[0]))
    inner1, inner2 = np.zeros((d, a)), np.zeros((d, d, a))
    for i in range(d):
        inner1[i, size + i] = 1.0
    for s in range(len(state)):
        p, x, x1, x2 = inputs[s], state[s], first[s], second[s]
        for i in range(len(p)):
            arguments[size + i] = p[i]
        for t in range(out.shape[1]):
            if t and not midpoint_step(newton, step, n, p, h, x, x1, x2):
                return False
            for c in range(size):
                arguments[c] = x[c]
            evaluate(observe, arguments, flat)
            for c in range(m):
                out[s, t, c] = flat[c]
            if d:
                for i in range(d):
                    for c in range(size):
                        inner1[i, c] = x1[i, c]
                        for j in range(d):
                            inner2[i, j, c] = x2[i, j, c]
                chain_rule_second(flat, m, a, inner1, inner2, out1[s, t], out2[s, t])
    return True


@compiled
def evaluate_all(tape: Tape, arguments: Array, out: Array) -> None:
    """Write the values of a tape's m expressions at S sets of arguments (S, K) to `out` (S, m)."""
    for s in range(len(arguments)):
        evaluate(tape, arguments[s], out[s])
