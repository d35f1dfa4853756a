"""The exact motion agrees with mpmath and with SciPy, within the round-off that it states."""

import ast
import inspect

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm

from alphacut.frame.verification.exact_motion import LinearMotion

UNFORCED = np.zeros((0, 0)), np.zeros((0, 0))


def chain(rng, n, *, stiff=1.0):
    """A chain of masses with damping of no special form, and a generator of its state."""
    k = rng.uniform(1e7, 9e7, n) * np.append(stiff, np.ones(n - 1))
    K = np.diag(k) + np.diag(np.append(k[1:], 0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    M, D = np.diag(rng.uniform(1e4, 3e4, n)), np.diag(rng.uniform(1e3, 1e5, n))
    A = np.zeros((2 * n + 2, 2 * n + 2))
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, : 2 * n] = -np.linalg.solve(M, np.hstack([K, D]))
    A[n : 2 * n, 2 * n], A[2 * n, 2 * n + 1] = -1, 1
    rows = np.vstack([np.eye(2 * n)[[n - 1, -1]], A[n : n + 1, : 2 * n]])
    return (M, D, K, rows, rng.normal(size=2 * n) * 0.01, np.ones(n)), A


def by_intervals(A, rows, start, record, step, times, exponential=expm):
    """Outputs by an exponential from each sample or time to the next."""
    samples = np.arange(len(record)) * step
    cuts, out, x = np.unique(np.concatenate([times, samples[samples < times[-1]]])), {}, start
    for here, there in zip(cuts, [*cuts[1:], None], strict=True):
        out[here] = rows @ x
        if there is not None:
            i = int((here + there) / 2 / step)
            load = np.zeros(2)
            if i < len(record) - 1:
                load[1] = (record[i + 1] - record[i]) / step
                load[0] = record[i] + load[1] * (here - i * step)
            x = (exponential(A * (there - here)) @ np.append(x, load))[: len(x)]
    return np.array([out[t] for t in times])


@pytest.mark.parametrize(
    ("n", "step", "node", "stiff"),
    [(1, 0.3, 0.07, 1.0), (3, 0.02, 0.013, 1.0), (4, 0.05, 0.02, 1e3), (2, 0.001, 0.05, 1.0)],
)
def test_equals_exponentials_from_each_sample_and_node_to_the_next(n, step, node, stiff):
    rng = np.random.default_rng([n, 60])
    arrays, A = chain(rng, n, stiff=stiff)
    times = np.arange(30) * node
    record = rng.normal(size=max(3, int(0.7 * times[-1] / step)))  # ends with a jump
    values, rounding = LinearMotion(*arrays, record, step, *UNFORCED).outputs(times)
    reference = by_intervals(A, arrays[3], arrays[4], record, step, times)
    assert (np.abs(values - reference) <= 2 * rounding).all()  # each has its own
    assert (rounding <= 1e-8 * np.abs(reference).max(0)).all()


def test_round_off_that_is_stated_holds_against_mpmath():
    rng = np.random.default_rng(4)
    arrays, A = chain(rng, 2, stiff=1e4)
    times, record = np.arange(6) * 0.5, rng.normal(size=4)
    values, rounding = LinearMotion(*arrays, record, 0.37, *UNFORCED).outputs(times)
    mpmath.mp.dps = 40

    def exponential(matrix):
        exact = mpmath.expm(mpmath.matrix(matrix.tolist()))
        return np.array(exact.tolist(), dtype=object).reshape(matrix.shape)

    reference = by_intervals(A, arrays[3], arrays[4], record, 0.37, times, exponential)
    error = np.abs(values - reference.astype(float))
    assert (error <= rounding).all()
    assert (error.max(0) >= 1e-6 * rounding.max(0)).all(), "the round-off says too little"


def test_free_motion_without_a_record_and_without_stiffness():
    still = LinearMotion(
        *(np.eye(1), np.zeros((1, 1)), np.zeros((1, 1)), np.eye(2), np.array([1.0, 2.0])),
        *(np.ones(1), np.zeros(0), 0.0, *UNFORCED),
    )
    values, _ = still.outputs(np.array([0.0, 0.3, 2.0]))
    assert values == pytest.approx(np.array([[1, 2], [1.6, 2], [5, 2]]))


def test_shares_no_code_with_what_it_judges():
    tree = ast.parse(inspect.getsource(inspect.getmodule(LinearMotion)))
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    modules |= {
        x.name for node in ast.walk(tree) if isinstance(node, ast.Import) for x in node.names
    }
    assert {str(module).partition(".")[0] for module in modules} <= {
        *("__future__", "dataclasses", "math", "numpy", "scipy", "typing")
    }
