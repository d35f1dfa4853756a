"""Taylor models of modes are off by their rests, where these are rounding alone, against mpmath."""

from itertools import combinations_with_replacement

import mpmath as mp
import numpy as np
import pytest

from alphacut.frame.bounds.box import Box
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF, gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, solve
from alphacut.frame.modes.clusters import _diagonal
from tests.frame.modes.test_attained import IDLE, RECORD, drawn


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


def exact_modes(springs, masses, ratio):
    """ω and the shares of q3 under the ground of a shear frame by 40 digits."""
    n = len(springs)
    matrix = mp.zeros(n)
    for i in range(n):
        matrix[i, i] = (springs[i] + (springs[i + 1] if i + 1 < n else 0)) / masses[i]
        if i:
            matrix[i, i - 1] = -springs[i] / mp.sqrt(masses[i] * masses[i - 1])
            matrix[i - 1, i] = matrix[i, i - 1]
    squared, vectors = mp.eigsy(matrix)
    omega = [mp.sqrt(x * (1 - mp.mpf(ratio) ** 2)) for x in squared]
    read = [vectors[n - 1, e] / mp.sqrt(masses[n - 1]) for e in range(n)]
    driven = [mp.fsum(vectors[i, e] * mp.sqrt(masses[i]) for i in range(n)) for e in range(n)]
    return omega, [r * d for r, d in zip(read, driven, strict=True)]


@pytest.mark.parametrize("stiff", [1.0, 1e4])
def test_modes_over_a_narrow_box_are_off_by_their_rounding_at_most(stiff):
    """In 1e-9 of each input, what the series leave out is far below rounding."""
    frame, box, rng = drawn(1, stiff, RECORD)
    radius = 1e-9 * box.centre
    narrow = Box(frame, box.names, box.time, box.centre - radius, box.centre + radius)
    single = narrow.level().oscillators
    assert len(single) == 3
    ends = [
        (mp.mpf(float(a)), mp.mpf(float(b))) for a, b in zip(narrow.low, narrow.high, strict=True)
    ]
    shares = {"omega": [], "share": []}
    with mp.workdps(40):
        for u in rng.uniform(-1, 1, (12, 6)):
            unit = [mp.mpf(float(x)) for x in u]
            p = [(a + b) / 2 + (b - a) / 2 * x for (a, b), x in zip(ends, unit, strict=True)]
            omega, share = exact_modes(p[:3], p[3:], frame.damping_ratio)
            for mode, w, c in zip(single, omega, share, strict=True):
                for name, model, true in (("omega", mode.omega, w), ("share", mode.share[0, 0], c)):
                    off = abs(exact_value(model, unit) - true)
                    shares[name].append(float(off) / float(model.remainder))
    for values in shares.values():
        assert IDLE <= np.max(values) <= 1


def exact_inputs(rng):
    """Three functions of three inputs to first order, of which nothing is left out."""
    parts = rng.uniform(1, 2, (1, 3)), 0.1 * rng.normal(size=(3, 3))
    return TaylorModel(parts, np.zeros(3), 3)


def exact_results(q, numbers, square, column):
    """Results of arithmetic with values q of three functions, by 40 digits."""
    A = [[q[0] * mp.mpf(float(x)) for x in row] for row in square]
    b = [mp.mpf(float(x)) + q[1] for x in column]
    determinant = A[0][0] * A[1][1] - A[0][1] * A[1][0]
    return {
        "sum": q[0] + q[1],
        "multiple": q[0] * mp.mpf(0.1),
        "product": q[0] * q[1],
        "map": mp.fsum(x * mp.mpf(float(y)) for x, y in zip(q, numbers[:, 0], strict=True)),
        "power": q[0] ** mp.mpf(-1.5),
        "solve": (b[0] * A[1][1] - b[1] * A[0][1]) / determinant,
    }


def test_rests_of_arithmetic_are_rounding_and_no_hundred_times_more():
    """At inputs so small that remainders vanish beside the rounding of the coefficients."""
    rng, shares = np.random.default_rng(4), {}
    for _ in range(30):
        p, numbers = exact_inputs(rng), rng.normal(size=(3, 2))
        square, column = rng.normal(size=(2, 2)) + 4 * np.eye(2), rng.normal(size=2)
        low, high = np.sort(rng.uniform(-1, 1, (2, 3)), axis=0)
        p = TaylorModel((p.parts[0], 1e-7 * p.parts[1]), p.remainder, 3)
        product = p[0] * p[1]
        both = TaylorModel(product.parts, np.zeros(()), 3)
        made = {
            "sum": p[0] + p[1],
            "multiple": p[0] * 0.1,
            "product": product,
            "map": (p @ numbers)[0],
            "power": p[0] ** -1.5,
            "solve": solve(p[0] * square, p[1] + column[:, None])[0, 0],
        }
        u = [mp.mpf(float(x)) for x in rng.uniform(-1, 1, 3)]
        with mp.workdps(40):
            q = [exact_value(p[i], u) for i in range(3)]
            exact = exact_results(q, numbers, square, column)
            middle = [(mp.mpf(a) + mp.mpf(b)) / 2 for a, b in zip(low, high, strict=True)]
            half = [(mp.mpf(b) - mp.mpf(a)) / 2 for a, b in zip(low, high, strict=True)]
            moved = [m + h * x for m, h, x in zip(middle, half, u, strict=True)]
            made["part"], exact["part"] = both.within(low, high), exact_value(both, moved)
            for name, model in made.items():
                off = float(abs(exact_value(model, u) - exact[name]))
                shares.setdefault(name, []).append(off / float(model.remainder))
    assert all(IDLE <= np.max(values) <= 1 for values in shares.values())


def test_what_is_put_onto_a_diagonal_is_put_into_the_rest():
    matrix = TaylorModel.constant([[2.0, 1e-9], [-1e-9, 3.0]], 1)
    found = _diagonal(matrix, np.array([2.0, 3.5]))
    assert (np.abs(found.value - matrix.value) <= found.remainder).all()
    assert found.remainder == pytest.approx(np.array([[0, 1e-9], [1e-9, 0.5]]))


def test_gamma_is_that_of_the_worst_sum():
    assert gamma(1) == pytest.approx(UNIT_ROUNDOFF, rel=1e-9)
    total = np.float64(1.0)
    for _ in range(1000):
        total += UNIT_ROUNDOFF  # each is rounded away
    assert 0.9 * gamma(1000) <= 1000 * UNIT_ROUNDOFF / 1.0 - (total - 1) <= gamma(1000)
