"""Time steps of general systems with derivatives by the inputs, compiled by Numba.

A state is (q, π), or (q, v) of the Runge–Kutta method, 2n numbers, with first derivatives (d, 2n)
and second ones (d, d, 2n) by the inputs.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types

from alphacut.fuzzy.arrays import Array

FUNCTION = types.FunctionType(types.void(types.f8[::1], types.f8[::1]))
ITERATIONS = 30
"""Newton steps after which a time step has not converged."""

compiled = njit(error_model="numpy", cache=True)


@compiled
def slopes(flat: Array, m: int, a: int, inner1: Array, out1: Array) -> None:
    """First derivatives (d, m) of f along those of its variables (d, a), from f, f', f'' flat."""
    f1 = flat[m : m + m * a].reshape(m, a)
    for i in range(len(inner1)):
        for c in range(m):
            out1[i, c] = 0.0
            for x in range(a):
                out1[i, c] += f1[c, x] * inner1[i, x]


@compiled
def chain(
    flat: Array, m: int, a: int, inner1: Array, inner2: Array, out1: Array, out2: Array
) -> None:
    """The same with second derivatives (d, d, m) along those of the variables (d, d, a)."""
    slopes(flat, m, a, inner1, out1)
    d, half = len(inner1), np.empty(a)
    f1, f2 = flat[m : m + m * a].reshape(m, a), flat[m + m * a :].reshape(m, a, a)
    for c in range(m):
        for i in range(d):
            for y in range(a):
                half[y] = 0.0
                for x in range(a):
                    half[y] += f2[c, x, y] * inner1[i, x]
            for j in range(i, d):
                total = 0.0
                for x in range(a):
                    total += f1[c, x] * inner2[i, j, x] + half[x] * inner1[j, x]
                out2[i, j, c] = out2[j, i, c] = total


@compiled
def solve(A: Array, b: Array) -> None:
    """Solution of A x = b in place of b (n, k), by elimination with pivots in a copy of A."""
    A, n = A.copy(), len(A)
    for k in range(n):
        p = k + np.abs(A[k:, k]).argmax()
        for j in range(n):
            A[k, j], A[p, j] = A[p, j], A[k, j]
        for j in range(b.shape[1]):
            b[k, j], b[p, j] = b[p, j], b[k, j]
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            A[i, k:] -= factor * A[k, k:]
            b[i] -= factor * b[k]
    for k in range(n - 1, -1, -1):
        for i in range(k + 1, n):
            b[k] -= A[k, i] * b[i]
        b[k] /= A[k, k]


@compiled
def converged(newton: Any, n: int, given: Array, pi: Array, flat: Array) -> bool:
    """Newton's method for the new q, the first n of `given`, whose momentum before is π."""
    residual = np.empty((n, 1))
    for _ in range(ITERATIONS):
        newton(given, flat)
        residual[:, 0] = flat[:n] - pi
        solve(flat[n:].reshape(n, n), residual)
        given[:n] -= residual[:, 0]
        change = np.abs(residual).max()
        if not np.isfinite(change):
            return False
        if change <= 1e-12 * (1 + np.abs(given[:n]).max()):
            return True
    return False


@compiled
def variational(
    functions: tuple[Any, ...], n: int, p: Array, h: float, x: Array, x1: Array, x2: Array
) -> bool:
    """One midpoint step in place: π[k] and π[k+1] as functions of q[k+1], q[k] and p, inverted.

    With the converged Jacobian J, first derivatives follow from one Newton step on jets, second
    ones from another.
    """
    newton, plain, full = functions
    d, inputs = len(x1), len(p)
    a = 2 * n + d
    given = np.empty(2 * n + inputs + 1)
    given[:n], given[n : 2 * n], given[2 * n : -1], given[-1] = x[:n], x[:n], p, h
    jacobian = np.empty(n + n * n)
    if not converged(newton, n, given, x[n:], jacobian):
        return False
    flat = np.empty(2 * n + (2 * n * a + 2 * n * a * a if d else 0))
    if d:
        full(given, flat)
    else:
        plain(given, flat)
    x[:n], x[n:] = given[:n], flat[n : 2 * n]
    if not d:
        return True
    J = flat[2 * n : 2 * n + 2 * n * a].reshape(2 * n, a)[:n, :n]
    inner1, inner2 = np.zeros((d, a)), np.zeros((d, d, a))
    out1, out2 = np.empty((d, 2 * n)), np.empty((d, d, 2 * n))
    inner1[:, n : 2 * n], inner2[:, :, n : 2 * n] = x1[:, :n], x2[:, :, :n]
    for i in range(d):
        inner1[i, 2 * n + i] = 1.0
    slopes(flat, 2 * n, a, inner1, out1)  # of what is known, with q[k+1] held
    right = np.ascontiguousarray((x1[:, n:] - out1[:, :n]).T)
    solve(J, right)
    inner1[:, :n] = right.T
    chain(flat, 2 * n, a, inner1, inner2, out1, out2)
    bent = np.ascontiguousarray((x2[:, :, n:] - out2[:, :, :n]).reshape(d * d, n).T)
    solve(J, bent)
    inner2[:, :, :n] = np.ascontiguousarray(bent.T).reshape(d, d, n)
    f1 = flat[2 * n : 2 * n + 2 * n * a].reshape(2 * n, a)
    for c in range(n, 2 * n):
        for k in range(n):
            out2[:, :, c] += f1[c, k] * inner2[:, :, k]
    x1[:, :n], x1[:, n:] = inner1[:, :n], out1[:, n:]
    x2[:, :, :n], x2[:, :, n:] = inner2[:, :, :n], out2[:, :, n:]
    return True


@compiled
def runge_kutta(
    functions: tuple[Any, ...], n: int, p: Array, h: float, x: Array, x1: Array, x2: Array
) -> bool:
    """One step of the classical method of order 4 in place."""
    _, plain, full = functions
    d, m = len(x1), 2 * n
    a = m + d
    flat, given = np.empty(m + (m * a + m * a * a if d else 0)), np.empty(m + len(p))
    k, k1, k2 = np.zeros(m), np.zeros((d, m)), np.zeros((d, d, m))
    s, s1, s2 = np.zeros(m), np.zeros((d, m)), np.zeros((d, d, m))
    inner1, inner2 = np.zeros((d, a)), np.zeros((d, d, a))
    for i in range(d):
        inner1[i, m + i] = 1.0
    given[m:] = p
    for share, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
        given[:m] = x + share * h * k
        if d:
            inner1[:, :m], inner2[:, :, :m] = x1 + share * h * k1, x2 + share * h * k2
            full(given, flat)
            chain(flat, m, a, inner1, inner2, k1, k2)
        else:
            plain(given, flat)
        k[:] = flat[:m]
        s += weight * k
        s1 += weight * k1
        s2 += weight * k2
    x += h / 6 * s
    x1 += h / 6 * s1
    x2 += h / 6 * s2
    return True


@njit(
    types.boolean(
        types.UniTuple(FUNCTION, 3), types.UniTuple(FUNCTION, 2), types.boolean, types.f8[:, ::1],
        types.f8[::1], types.f8[:, ::1], types.f8[:, :, ::1], types.f8[:, :, :, ::1],
        types.f8[:, :, ::1], types.f8[:, :, :, ::1], types.f8[:, :, :, :, ::1],
    ),
    error_model="numpy", cache=True,
)  # fmt: skip
def march(
    functions: tuple[Any, ...],
    observe: tuple[Any, ...],
    implicit: bool,
    inputs: Array,
    steps: Array,
    state: Array,
    first: Array,
    second: Array,
    out: Array,
    out1: Array,
    out2: Array,
) -> bool:
    """Outputs of S motions at T nodes, with derivatives; False where a step does not converge.

    Args:
        functions: Equations of a Newton step, and a step's values and derivatives (or the
            acceleration, twice without use of the first).
        observe: Outputs, and with derivatives.
        implicit: Whether steps are variational.
        inputs: Inputs and then other parameters, shape (S, K).
        steps: Lengths of the parts of a step, in s.
        state: Initial states (S, 2n), which are advanced, as are their derivatives.
        first: Shape (S, d, 2n).
        second: Shape (S, d, d, 2n).
        out: Filled with outputs, shape (S, T, m).
        out1: With first derivatives, shape (S, T, d, m).
        out2: With second ones, shape (S, T, d, d, m).
    """
    size, d, m = state.shape[1], first.shape[1], out.shape[2]
    n, a = size // 2, size + d
    flat = np.empty(m + (m * a + m * a * a if d else 0))
    given = np.empty(size + inputs.shape[1])
    inner1, inner2 = np.zeros((d, a)), np.zeros((d, d, a))
    for i in range(d):
        inner1[i, size + i] = 1.0
    for s in range(len(state)):
        p, x, x1, x2 = inputs[s], state[s], first[s], second[s]
        given[size:] = p
        for t in range(out.shape[1]):
            for h in steps[: len(steps) if t else 0]:
                if implicit:
                    if not variational(functions, n, p, h, x, x1, x2):
                        return False
                else:
                    runge_kutta(functions, n, p, h, x, x1, x2)
            given[:size] = x
            if d:
                inner1[:, :size], inner2[:, :, :size] = x1, x2
                observe[1](given, flat)
                chain(flat, m, a, inner1, inner2, out1[s, t], out2[s, t])
            else:
                observe[0](given, flat)
            out[s, t] = flat[:m]
    return True
