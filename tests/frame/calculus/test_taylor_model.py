"""Taylor models hold the functions that they stand for, by high precision at many inputs."""

from itertools import combinations_with_replacement

import mpmath as mp
import numpy as np
import pytest

from alphacut.frame import UnprovedError
from alphacut.frame.calculus.taylor_model import TaylorModel, inverse_bound, solve

ROUNDING = 1e-12
"""Rounding of a model, over its size or 1 if that is more, which has a margin where it is used."""
TIGHT = 0.5
"""Share of a bound that something reaches: half the bound would be passed."""


def exact_value(model, u):
    """The polynomial of a Taylor model, V = (), at u by 40 digits."""
    total = mp.mpf(0)
    for degree, part in enumerate(model.parts):
        lists = sorted(
            combinations_with_replacement(range(model.inputs), degree), key=lambda x: x[::-1]
        )
        for coefficient, variables in zip(part, lists, strict=True):
            if coefficient:
                total += mp.mpf(float(coefficient)) * mp.fprod(u[i] for i in variables)
    return total


OPERATIONS = {
    "sum": lambda a, b, c: a + b * c,
    "difference": lambda a, b, c: a - b - c,
    "product": lambda a, b, c: a * b,
    "quotient": lambda a, b, c: a / (b * b + 1),
    "reciprocal": lambda a, b, c: c / (a * a + 1),
    "power": lambda a, b, c: (a * a + 1) ** -1.5,
    "root": lambda a, b, c: (b * b + 1) ** 0.5,
    "negative": lambda a, b, c: c - a,
}


def random_program(rng):
    """Some operations in a row, each on what three of the earlier ones and the inputs gave."""
    rows = [(str(rng.choice([*OPERATIONS])), rng.integers(0, 3 + k, 3)) for k in range(6)]

    def run(inputs, c):
        values = [*inputs]
        for name, (i, j, _) in rows:
            values.append(OPERATIONS[name](values[i], values[j], c))
        return values[-1]

    return run


def exact_inputs_at(rows, u):
    """Inputs a + b u + e of rows (a, b, e) by 40 digits."""
    return [mp.mpf(a) + mp.mpf(b) * x + mp.mpf(e) for (a, b, e), x in zip(rows, u, strict=True)]


def test_no_function_leaves_its_taylor_model(rng):
    """40 random programs of arithmetic; wide boxes, narrow ones, parts of them and lower orders."""
    shares = []
    for _ in range(40):
        run, c, order = random_program(rng), float(rng.normal()), int(rng.integers(2, 6))
        centre, radius = rng.uniform(-1, 1, 3), 10 ** rng.uniform(-8, -0.7) * np.ones(3)
        loose = radius * rng.choice([0.0, 0.1])  # what inputs leave out, at one end of it
        inputs = TaylorModel.variables(centre, radius, order).widened(loose)
        try:
            model = run([inputs[i] for i in range(3)], c)
        except UnprovedError:  # of b² + 1 with a remainder above 1
            continue
        low, high = np.sort(rng.uniform(-1, 1, (2, 3)), axis=0)
        lower_bound, upper_bound = model.bounds()
        rows = [*zip(centre, radius, loose, strict=True)]
        cut, part = model.truncated(order - 1), model.on_subbox(low, high)
        with mp.workdps(40):
            for u in (*rng.uniform(-1, 1, (3, 3)), np.sign(rng.normal(size=3))):
                v = [mp.mpf(float(x)) for x in u]
                exact = run(exact_inputs_at(rows, v), mp.mpf(c))
                slack = ROUNDING * (1 + abs(exact))
                for found in (model, cut):
                    off = abs(exact_value(found, v) - exact)
                    assert off <= found.remainder + slack
                assert lower_bound - slack <= exact <= upper_bound + slack
                shares.append(float(off) / float(cut.remainder + slack))
                moved = [
                    (mp.mpf(a) + mp.mpf(b)) / 2 + (mp.mpf(b) - mp.mpf(a)) / 2 * x
                    for a, b, x in zip(low, high, v, strict=True)
                ]
                exact = run(exact_inputs_at(rows, moved), mp.mpf(c))
                slack = ROUNDING * (1 + abs(exact))
                assert abs(exact_value(part, v) - exact) <= part.remainder + slack
    assert max(shares) > TIGHT


def test_no_solution_leaves_its_taylor_model(rng):
    for _ in range(8):
        n, d = 3, 2
        centre, slopes = np.eye(n) + 0.2 * rng.normal(size=(n, n)), rng.normal(size=(d, n, n))
        slopes *= 10 ** rng.uniform(-4, -1.5)
        right, numbers = rng.normal(size=(2, n, 1))
        A = TaylorModel((centre[None], slopes), np.zeros((n, n)), d, 4)
        b = TaylorModel((right[None], 0.1 * slopes[:, :, :1]), np.zeros((n, 1)), d, 4)
        found, inverse, product = solve(A, b), inverse_bound(A), A @ A @ b
        mapped = A @ numbers
        with mp.workdps(40):
            for u in (*rng.uniform(-1, 1, (3, d)), np.sign(rng.normal(size=d))):
                v = [mp.mpf(float(x)) for x in u]
                at = [
                    mp.matrix(n, x.shape[1])
                    + mp.matrix(
                        [[exact_value(x[i, j], v) for j in range(x.shape[1])] for i in range(n)]
                    )
                    for x in (A, b)
                ]
                solution, inverse_at = mp.lu_solve(*at), at[0] ** -1
                doubled, by_numbers = at[0] * (at[0] * at[1]), at[0] * mp.matrix(numbers.tolist())
                for i in range(n):
                    off = abs(exact_value(found[i, 0], v) - solution[i])
                    assert off <= found.remainder[i, 0] + ROUNDING
                    off = abs(exact_value(product[i, 0], v) - doubled[i])
                    assert off <= product.remainder[i, 0] + ROUNDING
                    off = abs(exact_value(mapped[i, 0], v) - by_numbers[i])
                    assert off <= mapped.remainder[i, 0] + ROUNDING
                    assert all(abs(inverse_at[i, j]) <= inverse[i, j] for j in range(n))


def test_a_matrix_that_may_be_singular_has_no_bound_of_its_inverse():
    slope = np.array([[[0.0, 1.01], [1.01, 0.0]]])
    assert inverse_bound(TaylorModel((np.eye(2)[None], slope), np.zeros((2, 2)), 1)) is None
    assert (
        inverse_bound(TaylorModel((np.eye(2)[None], 0.9 * slope), np.zeros((2, 2)), 1)) is not None
    )


def test_complex_functions_of_fewer_inputs_stay_complex():
    line = TaylorModel((np.ones((1, 1)), np.array([[2.0 + 3.0j]])), np.zeros(1), 1)
    wider = line.embedded(np.array([1]), 2)
    assert wider.at(np.array([[0.7, 0.5]])) == pytest.approx(2.0 + 1.5j)
    assert wider.restricted_to(np.array([1])).at(np.array([[0.5]])) == pytest.approx(2.0 + 1.5j)


def test_a_power_of_what_may_be_zero_is_refused():
    with pytest.raises(UnprovedError, match="take narrower inputs"):
        TaylorModel.variables(np.ones(1), np.full(1, 1.1)) ** 0.5


def test_half_of_a_remainder_of_series_would_not_do():
    def line(slope, rest):
        return TaylorModel(
            (np.ones((1, 1, 1)), np.full((1, 1, 1), slope)), np.full((1, 1), rest), 1
        )

    own, other = line(0.2, 0.01), line(-0.2, 0.01)
    fourth, narrow = own * own * own * own, TaylorModel.variables(np.ones(1), np.full(1, 0.1))
    narrow = narrow.widened(0.01)
    square = narrow * narrow
    for made, u, exact in (
        (solve(other, own), 1.0, 1.21 / 0.79),
        (fourth, 1.0, 1.21**4),
        (fourth.truncated(2), 1.0, 1.21**4),
        (fourth @ np.array([[-2.0]]), 1.0, -2 * 1.21**4),
        (np.array([[-2.0]]) @ fourth, 1.0, -2 * 1.21**4),
        (-fourth, 1.0, -(1.21**4)),
        (fourth.contract(np.array([-2.0])), 1.0, -2 * 1.21**4),
        (square * square, 1.0, 1.11**4),
        (narrow**0.5, -1.0, 0.89**0.5),
        (narrow**-1.0, -1.0, 1 / 0.89),
    ):
        off = np.abs(made.at(np.array([[u]])) - exact)
        assert (TIGHT * made.remainder < off).all()
        assert (off <= made.remainder * (1 + 1e-9)).all()
