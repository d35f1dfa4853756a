"""Time steps of general systems with derivatives by the inputs, compiled by Numba.

A state is (q, π), 2n numbers, with first derivatives (d, 2n) and second ones (d, d, 2n) by the
inputs. The equations come as tapes (`calculus/tape.py`), so that one compilation serves all
systems.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from alphacut.frame.calculus.tape import Tape
from alphacut.fuzzy.arrays import Array

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
def evaluate(tape: Tape, arguments: Array) -> Array:
    """The expressions (m,) of a tape at arguments (K,)."""
    code, results, place = tape
    place[: len(arguments)] = arguments
    begin = len(place) - len(code)
    for k in range(len(code)):
        place[begin + k] = operation(code[k, 0], place[code[k, 1]], place[code[k, 2]])
    return place[results]


@compiled
def chained(flat: Array, m: int, inner1: Array, inner2: Array) -> tuple[Array, Array]:
    """First (d, m) and second derivatives (d, d, m) of f along those of its variables.

    Args:
        flat: f, f' (m, a) and f'' (m, a, a), one behind the other.
        m: Number of components.
        inner1: First derivatives of the variables, shape (d, a).
        inner2: Second ones, shape (d, d, a).
    """
    d, a = inner1.shape
    slope = flat[m : m + m * a].reshape(m, a)
    curve = flat[m + m * a :].reshape(m, a, a)
    second = (inner2.reshape(d * d, a) @ slope.T).reshape(d, d, m)
    for c in range(m):
        second[:, :, c] += inner1 @ curve[c] @ inner1.T
    return inner1 @ slope.T, second


@compiled
def converged(newton: Tape, arguments: Array, momentum: Array) -> bool:
    """Newton's method for the new q, the first n arguments, from the momentum (n,) before."""
    n = len(momentum)
    for _ in range(ITERATIONS):
        flat = evaluate(newton, arguments)
        if not np.isfinite(flat).all():
            return False
        change = np.linalg.solve(flat[n:].reshape(n, n), flat[:n] - momentum)
        arguments[:n] -= change
        if np.abs(change).max() <= 1e-12 * (1 + np.abs(arguments[:n]).max()):
            return True
    return False


@compiled
def variational(
    newton: Tape, step: Tape, p: Array, h: float, x: Array, x1: Array, x2: Array
) -> bool:
    """One midpoint step in place: π[k] and π[k+1] as functions of q[k+1], q[k] and p, inverted."""
    d, n = len(x1), len(x) // 2
    arguments = np.concatenate((x[:n], x[:n], p, np.array([h])))
    if not converged(newton, arguments, x[n:].copy()):
        return False
    flat = evaluate(step, arguments)
    x[:n], x[n:] = arguments[:n], flat[n : 2 * n]
    if d:
        differentiated(flat, x1, x2)
    return True


@compiled
def differentiated(flat: Array, x1: Array, x2: Array) -> None:
    """Derivatives of a midpoint step in place.

    With the converged Jacobian J, first derivatives follow from one Newton step on jets, second
    ones from another.
    """
    d, m = x1.shape
    n, a = m // 2, m + d
    slope = flat[m : m + m * a].reshape(m, a)
    J = np.ascontiguousarray(slope[:n, :n])
    inner1, inner2 = np.zeros((d, a)), np.zeros((d, d, a))
    inner1[:, n:m], inner2[:, :, n:m] = x1[:, :n], x2[:, :, :n]
    inner1[:, m:] = np.eye(d)
    held = inner1 @ slope.T  # what is known, with q[k+1] held
    inner1[:, :n] = np.linalg.solve(J, (x1[:, n:] - held[:, :n]).T).T
    first, second = chained(flat, m, inner1, inner2)
    right = (x2[:, :, n:] - second[:, :, :n]).reshape(d * d, n)
    bent = np.ascontiguousarray(np.linalg.solve(J, right.T).T)
    pushed = bent @ np.ascontiguousarray(slope[n:, :n]).T
    x1[:, :n], x1[:, n:] = inner1[:, :n], first[:, n:]
    x2[:, :, :n] = bent.reshape(d, d, n)
    x2[:, :, n:] = second[:, :, n:] + pushed.reshape(d, d, n)


@compiled
def march(
    n: int,
    newton: Tape,
    step: Tape,
    observe: Tape,
    initial: Tape,
    inputs: Array,
    steps: Array,
    out: Array,
    out1: Array,
    out2: Array,
) -> bool:
    """Outputs of S motions at T nodes, with derivatives; False where a step does not converge.

    Args:
        n: Number of coordinates.
        newton: Equations of a Newton step.
        step: A step's values, with derivatives where d > 0.
        observe: Outputs, likewise.
        initial: Initial states, likewise.
        inputs: Inputs and then other parameters, shape (S, K).
        steps: Lengths of the parts of a step, in s.
        out: Filled with outputs, shape (S, T, m).
        out1: With first derivatives, shape (S, T, d, m).
        out2: With second ones, shape (S, T, d, d, m).
    """
    d, m = out1.shape[2:]
    inner1, inner2 = np.zeros((d, 2 * n + d)), np.zeros((d, d, 2 * n + d))
    inner1[:, 2 * n :] = np.eye(d)
    for s in range(len(inputs)):
        flat = evaluate(initial, inputs[s])
        x, x1, x2 = flat[: 2 * n].copy(), np.zeros((d, 2 * n)), np.zeros((d, d, 2 * n))
        if d:
            x1, x2 = chained(flat, 2 * n, np.eye(d), np.zeros((d, d, d)))
        for t in range(out.shape[1]):
            for h in steps[: len(steps) if t else 0]:
                if not variational(newton, step, inputs[s], h, x, x1, x2):
                    return False
            flat = evaluate(observe, np.concatenate((x, inputs[s])))
            out[s, t] = flat[:m]
            if d:
                inner1[:, : 2 * n], inner2[:, :, : 2 * n] = x1, x2
                out1[s, t], out2[s, t] = chained(flat, m, inner1, inner2)
    return True
