"""Time steps of general systems with derivatives by the inputs, compiled by Numba.

A state is (q, π), 2n numbers, with first derivatives (d, 2n) and second ones (d, d, 2n) by the
inputs. The equations come as tapes (`calculus/tape.py`), so that
one compilation serves all systems. Loops are written out: they compile in a fraction of the time
that array expressions take.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit, types

from alphacut.frame.calculus.tape import Tape
from alphacut.fuzzy.arrays import Array

TAPE = types.Tuple((types.i8[:, ::1], types.i8[::1], types.f8[::1]))
ITERATIONS = 30
"""Newton steps after which a time step has not converged."""

compiled = njit(error_model="numpy", cache=True)


@compiled
def operation(number: int, x: float, y: float) -> float:
    """Value of an operation of `tape.OPERATIONS`; one of a single operand leaves y out."""
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
    """Fills `out` (m,) with the expressions of a tape at arguments (K,)."""
    code, results, slots = tape
    for k in range(len(arguments)):
        slots[k] = arguments[k]
    for k in range(len(code)):
        slots[len(arguments) + k] = operation(code[k, 0], slots[code[k, 1]], slots[code[k, 2]])
    for k in range(len(results)):
        out[k] = slots[results[k]]


@compiled
def slopes(flat: Array, m: int, a: int, inner1: Array, out1: Array) -> None:
    """First derivatives (d, m) of f along those of its variables (d, a), from f, f', f'' flat."""
    for i in range(len(inner1)):
        for c in range(m):
            total = 0.0
            for x in range(a):
                total += flat[m + c * a + x] * inner1[i, x]
            out1[i, c] = total


@compiled
def chain(
    flat: Array, m: int, a: int, inner1: Array, inner2: Array, out1: Array, out2: Array
) -> None:
    """The same with second derivatives (d, d, m) along those of the variables (d, d, a)."""
    slopes(flat, m, a, inner1, out1)
    d, half, bent = len(inner1), np.empty(a), m + m * a
    for c in range(m):
        for i in range(d):
            for y in range(a):
                half[y] = 0.0
                for x in range(a):
                    half[y] += flat[bent + (c * a + x) * a + y] * inner1[i, x]
            for j in range(i, d):
                total = 0.0
                for x in range(a):
                    total += flat[m + c * a + x] * inner2[i, j, x] + half[x] * inner1[j, x]
                out2[i, j, c] = out2[j, i, c] = total


@compiled
def solve(matrix: Array, b: Array) -> None:
    """A⁻¹ b in place of b (n, k) by elimination with row exchanges, A (n, n) unchanged."""
    n, m, A = len(matrix), b.shape[1], matrix.copy()
    for k in range(n):
        p = k
        for i in range(k + 1, n):
            if abs(A[i, k]) > abs(A[p, k]):
                p = i
        for j in range(n):
            A[k, j], A[p, j] = A[p, j], A[k, j]
        for j in range(m):
            b[k, j], b[p, j] = b[p, j], b[k, j]
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
def converged(newton: Tape, n: int, arguments: Array, pi: Array, flat: Array) -> bool:
    """Newton's method for the new q, the first n arguments, whose momentum before is π."""
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
def variational(
    newton: Tape, step: Tape, n: int, p: Array, h: float, x: Array, x1: Array, x2: Array
) -> bool:
    """One midpoint step in place: π[k] and π[k+1] as functions of q[k+1], q[k] and p, inverted."""
    d, m, inputs = len(x1), 2 * n, len(p)
    a = m + d
    arguments, before = np.empty(m + inputs + 1), x[n:].copy()
    for i in range(n):
        arguments[i] = arguments[n + i] = x[i]
    for i in range(inputs):
        arguments[m + i] = p[i]
    arguments[m + inputs] = h
    if not converged(newton, n, arguments, before, np.empty(n + n * n)):
        return False
    flat = np.empty(m + (m * a + m * a * a if d else 0))
    evaluate(step, arguments, flat)
    for i in range(n):
        x[i], x[n + i] = arguments[i], flat[n + i]
    if d:
        differentiated(flat, n, x1, x2)
    return True


@compiled
def differentiated(flat: Array, n: int, x1: Array, x2: Array) -> None:
    """Derivatives of a midpoint step in place.

    With the converged Jacobian J, first derivatives follow from one Newton step on jets, second
    ones from another.
    """
    d, m = len(x1), 2 * n
    a = m + d
    J = np.empty((n, n))
    inner1, inner2 = np.zeros((d, a)), np.zeros((d, d, a))
    out1, out2 = np.empty((d, m)), np.empty((d, d, m))
    right, bent = np.empty((n, d)), np.empty((n, d * d))
    for i in range(n):
        for j in range(n):
            J[i, j] = flat[m + i * a + j]
    for i in range(d):
        inner1[i, m + i] = 1.0
        for c in range(n):
            inner1[i, n + c] = x1[i, c]
            for j in range(d):
                inner2[i, j, n + c] = x2[i, j, c]
    slopes(flat, m, a, inner1, out1)  # of what is known, with q[k+1] held
    for c in range(n):
        for i in range(d):
            right[c, i] = x1[i, n + c] - out1[i, c]
    solve(J, right)
    for c in range(n):
        for i in range(d):
            inner1[i, c] = right[c, i]
    chain(flat, m, a, inner1, inner2, out1, out2)
    for c in range(n):
        for i in range(d):
            for j in range(d):
                bent[c, i * d + j] = x2[i, j, n + c] - out2[i, j, c]
    solve(J, bent)
    for i in range(d):
        for c in range(n):
            x1[i, c], x1[i, n + c] = inner1[i, c], out1[i, n + c]
            for j in range(d):
                x2[i, j, c] = bent[c, i * d + j]
                total = out2[i, j, n + c]
                for k in range(n):
                    total += flat[m + (n + c) * a + k] * bent[k, i * d + j]
                x2[i, j, n + c] = total


@njit(
    types.boolean(
        TAPE, TAPE, TAPE,
        types.f8[:, ::1], types.f8, types.f8[:, ::1], types.f8[:, :, ::1],
        types.f8[:, :, :, ::1], types.f8[:, :, ::1], types.f8[:, :, :, ::1],
        types.f8[:, :, :, :, ::1],
    ),
    error_model="numpy", cache=True,
)  # fmt: skip
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
    """Outputs of S motions at T nodes, with derivatives; False where a step does not converge.

    Args:
        newton: Equations of a Newton step.
        step: A step's values, with derivatives where d > 0.
        observe: Outputs, likewise.
        inputs: Inputs and then other parameters, shape (S, K).
        h: Length of a step, in s.
        state: Initial states (S, 2n), which are advanced, as are their derivatives.
        first: Shape (S, d, 2n).
        second: Shape (S, d, d, 2n).
        out: Filled with outputs, shape (S, T, m).
        out1: With first derivatives, shape (S, T, d, m).
        out2: With second ones, shape (S, T, d, d, m).
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
            if t and not variational(newton, step, n, p, h, x, x1, x2):
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
                chain(flat, m, a, inner1, inner2, out1[s, t], out2[s, t])
    return True


@njit(types.void(TAPE, types.f8[:, ::1], types.f8[:, ::1]), error_model="numpy", cache=True)
def evaluated(tape: Tape, arguments: Array, out: Array) -> None:
    """Fills `out` (S, m) with the expressions of a tape at arguments (S, K)."""
    for s in range(len(arguments)):
        evaluate(tape, arguments[s], out[s])
