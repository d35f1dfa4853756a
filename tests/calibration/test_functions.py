"""Estimated and guaranteed bounds of random functions by each plan that states an error."""

import os
from itertools import chain

import numpy as np
import pytest

from alphacut.fuzzy import Knowledge, Nature, Reduced, RefusedError, Signed, Triangular, propagate
from tests.calibration import functions
from tests.calibration.declared import Calibration, free_seed, is_rate

ALPHA = (0.0, 0.5)


def bounded(function, inputs, plan, **options):
    named = functions.named(function)
    return propagate(
        named, inputs, plan, alpha=ALPHA, vectorised=True, budget=10**6, progress=False, **options
    )


def wide(rng, n):
    """Triangular inputs from −1 to 1."""
    return {f"x{i}": Triangular(-1.0, float(rng.uniform(-0.6, 0.6)), 1.0) for i in range(n)}


@pytest.mark.slow
def test_estimates_of_three_hundred_functions():
    """Less than 1 % of the estimated bounds are wrong; most functions have an estimate."""
    seed = free_seed("three hundred functions")
    families = [*functions.SINGLE * 3, *functions.SEVERAL]
    natures, wrong, costs = {}, [], {}
    for number in range(int(os.environ.get("FUNCTIONS", "300"))):
        rng = np.random.default_rng([seed, number])
        family, n = families[number % len(families)], int(rng.integers(1, 7))
        function, inputs = family(rng, n), wide(rng, n)
        result = propagate(
            functions.named(function), inputs, alpha=ALPHA, vectorised=True, progress=False
        )
        estimated = result.nature is Nature.ESTIMATED
        natures.setdefault(family.__name__, []).append(estimated)
        costs.setdefault((family.__name__, n), []).append(result.evaluations)
        if estimated and (lack := shortfall(function, inputs, result)) > 1:
            wrong.append((family.__name__, n, number, lack))
    for family, values in natures.items():
        spent = {n: int(np.median(costs[f, n])) for f, n in sorted(costs) if f == family}
        print(f"{family:12} {sum(values):3} of {len(values):3} estimated; evaluations {spent}")
    total = [*chain.from_iterable(natures.values())]
    single = [*chain.from_iterable(natures[family.__name__] for family in functions.SINGLE)]
    print(f"{sum(total)} of {len(total)} estimated, of single optima {np.mean(single):.0%}")
    print(f"wrong: {wrong}")
    assert is_rate(len(wrong), sum(total), 0.01), (wrong, seed)
    assert is_rate(len(single) - sum(single), len(single), 0.1), seed
    assert is_rate(len(total) - sum(total), len(total), 0.4), seed


def shortfall(function, inputs, result):
    """Largest distance of a bound to the true one, over its error."""
    worst = 0.0
    for level, alpha in enumerate(result.alpha):
        low, high = functions.true_ends(function, inputs, alpha)
        lacks = result.lower[level, 0] - low, high - result.upper[level, 0]
        worst = max(worst, max(lacks) / (result.error[level, 0] + 1e-9 * (high - low)))
    return worst


@pytest.mark.slow
@pytest.mark.parametrize("plan", [Signed(), Reduced()])
def test_no_value_leaves_the_guaranteed_bounds(plan):
    """Monotone functions with effects from 1e-6 to 1; a sign that is stated wrongly is refused."""
    seed = free_seed(plan.name)
    table = Calibration(f"monotone functions by {plan.name}: proved over attained width", seed)
    for number in range(60):
        rng = np.random.default_rng([seed, number])
        function, signs = functions.monotone(rng, n := int(rng.integers(1, 4)))
        inputs = functions.numbers(rng, n)
        result = bounded(function, inputs, plan, knowledge=Knowledge(signs))
        assert result.nature is Nature.GUARANTEED
        ends = [functions.true_ends(function, inputs, alpha) for alpha in ALPHA]
        size = np.abs(ends).max()
        table.guaranteed("ends", result.bounds(), np.array(ends).T, size=size, case=number)
        wrong = signs | {f"x{k}": -signs[f"x{k}"] for k in [int(rng.integers(n))]}
        with pytest.raises(RefusedError):
            bounded(function, inputs, plan, knowledge=Knowledge(wrong))
    table.judge()
