"""Declared over true error within [1, 1.8] in one case per estimate, so that half of it is too
little; and the rounding of each enclosed operation against exact arithmetic.
"""

import operator
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    BranchAndBound,
    Chebyshev,
    Interval,
    Metamodel,
    Reduced,
    Triangular,
    propagate,
)
from alphacut.fuzzy.knowledge import interval_arithmetic as interval
from alphacut.fuzzy.surrogates.response_surface import ResponseSurface

UNIT = {"x": Interval(0, 1)}
X = np.linspace(0, 1, 100_001)


def require_tight(declared, true):
    assert true <= declared <= 1.8 * true


def missed(result, values):
    return max(
        abs(result.lower[0, 0] - values.min()),
        abs(result.upper[0, 0] - values.max()),
    )


@pytest.mark.parametrize(("centre", "budget"), [(0.4, 17), (0.38, 33), (0.9, 33)])
def test_error_of_a_chebyshev_surface(centre, budget):
    def function(x):
        return -abs(x - centre)

    plan = Chebyshev(budget=budget, confirm=False)
    result = propagate(function, UNIT, plan, alpha=(0.0,), vectorised=True)
    require_tight(result.error[0, 0], missed(result, function(X)))


@pytest.mark.parametrize("centre", [0.425, 0.445])
def test_error_of_confirmed_bounds(centre):
    def function(x):
        return np.exp(-300 * (x - centre) ** 2)

    result = propagate(function, UNIT, Chebyshev(budget=17), alpha=(0.0,), vectorised=True)
    require_tight(result.error[0, 0], missed(result, function(X)))


@pytest.mark.parametrize("seen", [0.4, 0.45])
def test_what_the_last_look_finds_counts_twice(seen):
    """A spike of height 1, of which the one fresh point that meets it sees a share."""

    def run(centre, height):
        def function(x):
            spike = height * np.exp(-(((x - centre) / 1e-4) ** 2))
            return {"y0": x / 10 + spike} | {f"y{k}": k * x for k in range(1, 14)}

        return propagate(function, UNIT, Automatic(looks=1), alpha=(0.0,), vectorised=True)

    fresh = run(0.5, 0.0).points[-1, 0]
    centre = fresh + 1e-4 * np.sqrt(-np.log(seen))
    result = run(centre, 1.0)
    require_tight(result.error[0, 0], centre / 10 + 1 - result.upper[0, 0])


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_error_of_a_response_surface(degree):
    points = (np.arange(40)[:, None] + 0.5) / 40
    surface = ResponseSurface.fit(points, np.exp(2 * points), degree=degree)
    true = np.sqrt(((surface(X[:, None]) - np.exp(2 * X[:, None])) ** 2).mean())
    require_tight(surface.error[0], true)


def test_error_of_a_response_surface_is_that_at_samples_left_out():
    points = np.random.default_rng(3).uniform(-1, 1, 7)
    values, left_out = np.exp(2 * points), []
    for k in range(len(points)):
        others = np.delete(points, k), np.delete(values, k)
        left_out.append(values[k] - np.polyval(np.polyfit(*others, 3), points[k]))
    surface = ResponseSurface.fit(points[:, None], values[:, None], degree=3)
    assert surface.error[0] == pytest.approx(np.sqrt(np.mean(np.square(left_out))), rel=1e-9)


@pytest.mark.parametrize("boxes", [20, 40])
def test_error_of_a_metamodel(boxes):
    inputs = {"x": Triangular(0, 0.4, 1), "y": Triangular(0, 0.5, 1)}
    plans = Metamodel(boxes=boxes, held_out=10, seed=1), Reduced()
    alpha = np.linspace(0, 1, 11)
    learnt, exact = (
        propagate(
            lambda x, y: np.exp(2 * x) * (1 + y) ** 2, inputs, plan, alpha=alpha, vectorised=True
        )
        for plan in plans
    )
    true = max(np.abs(learnt.lower - exact.lower).max(), np.abs(learnt.upper - exact.upper).max())
    require_tight(learnt.error[0, 0], true)


@pytest.mark.parametrize("budget", [8, 60, 200])
def test_gap_of_branch_and_bound(budget):
    def function(x, y):
        return x * y * (1 - x) - x * x * y  # from −1 to 1/8

    plan = BranchAndBound(function, tolerance=1e-9, budget=budget)
    result = propagate(function, UNIT | {"y": Interval(0, 1)}, plan, alpha=(0.0,))
    true = max(-1 - result.lower[0, 0], result.upper[0, 0] - 0.125)
    require_tight(result.error[0, 0], true)


def point(value):
    return np.array([value]), np.array([value])


@pytest.mark.parametrize(
    ("enclosed", "exact"),
    [(interval.total, operator.add), (interval.product, operator.mul)],
)
def test_sums_and_products_are_rounded_outwards(enclosed, exact):
    missed_by_nearest = [0, 0]
    numbers = np.random.default_rng(0).normal(0, 1, (200, 2)) ** 3
    for a, b in numbers.tolist():
        (low,), (high,) = enclosed(point(a), point(b))
        true = exact(Fraction(a), Fraction(b))
        assert Fraction(low) <= true <= Fraction(high)
        assert high - low <= 2.01 * np.spacing(max(abs(low), abs(high)))
        missed_by_nearest[0] += Fraction(exact(a, b)) > true
        missed_by_nearest[1] += Fraction(exact(a, b)) < true
    assert min(missed_by_nearest) > 20  # either end would be missed without its rounding


@pytest.mark.parametrize(
    ("enclosed", "exact"),
    [
        (interval.reciprocal, lambda x: 1 / x),
        (lambda v: interval.power(v, 3), lambda x: x**3),
        (interval.root, Decimal.sqrt),
        (interval.exponential, Decimal.exp),
        (interval.logarithm, Decimal.ln),
    ],
)
def test_functions_are_rounded_outwards(enclosed, exact):
    beside = np.zeros(2, int)
    with localcontext(prec=60):
        for x in np.random.default_rng(1).uniform(0.1, 9, 200).tolist():
            (low,), (high,) = enclosed(point(x))
            true = exact(Decimal(x))
            assert Decimal(low) < true < Decimal(high)
            middle = Decimal(low) / 2 + Decimal(high) / 2
            beside += [true < middle, true > middle]
    assert (beside > 20).all()  # a value at one end would be missed by rounding the other only
