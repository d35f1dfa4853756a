"""Stated errors against true ones over families of functions: half an error is seen."""

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    Interval,
    Nature,
    propagate,
)
from alphacut.fuzzy.campaign.call import Call
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.automatic import _Passes
from alphacut.fuzzy.sets.boxes import Domain
from tests.calibration.functions import FAMILIES, named, numbers, true_ends


def shortfalls(method, family, seed):
    """Nature, and true error over stated error at each end of two cuts."""
    rng = np.random.default_rng(seed)
    function, inputs = family(rng, n := int(rng.integers(1, 4))), numbers(rng, n)
    result = propagate(
        named(function),
        inputs,
        method,
        alpha=(0.0, 0.5),
        vectorised=True,
        budget=10**6,
    )
    rows = []
    for level, alpha in enumerate(result.alpha):
        low, high = true_ends(function, inputs, alpha)
        error = result.error[level, 0]
        for lack in (result.lower[level, 0] - low, high - result.upper[level, 0]):
            rows.append((max(lack, 0.0), error, high - low))
    return result.nature, np.array(rows)


def calibrate(method, seeds):
    """Share of estimated ends that their error covers, by family, and how wide errors are."""
    table = {}
    for family in FAMILIES:
        runs = [shortfalls(method, family, seed) for seed in seeds]
        own = [rows for nature, rows in runs if nature is Nature.ESTIMATED]
        rows = np.concatenate(own) if own else np.zeros((0, 3))
        covered = rows[:, 0] <= rows[:, 1] + 1e-12 * (1 + rows[:, 2])
        width = np.median(rows[:, 1] / rows[:, 2].clip(1e-12)) if len(rows) else 0.0
        table[family.__name__] = (len(own), len(rows), int(covered.sum()), float(width))
    return table


def test_errors_of_the_default_cover_in_every_family():
    table = calibrate(Automatic(), range(6))
    total, covered = (sum(row[k] for row in table.values()) for k in (1, 2))
    assert covered >= 0.98 * total, table
    assert table["smooth"][0] >= 4, table  # most smooth functions are worth an estimate
    assert max(row[3] for row in table.values()) < 0.05, table


def judged(gain, *lacks):
    """Bounds of x² after passes that improved by `gain` and whose ends lack so much."""
    domain = Domain({"x": Interval(0, 1)}, (0.0,))
    campaign = Campaign(Call(lambda x: x * x, ("x",)))
    campaign(np.linspace(0, 1, 11)[:, None])
    passes = _Passes(campaign, domain, ("y",))
    passes.gain = np.array([[gain]])
    passes.ends = {("y", 1.0): [(0, lack) for lack in lacks]}
    return passes.judged(spent=False)


def test_what_a_pass_improves_or_lacks_counts_twice():
    assert judged(4e-4, 0.0).error[0, 0] == pytest.approx(8e-4, rel=1e-4)
    assert judged(0.0, 0.0, 7e-4).error[0, 0] == pytest.approx(14e-4, rel=1e-4)
    assert judged(0.0, 0.0).nature is Nature.ESTIMATED


@pytest.mark.parametrize(("gain", "lacks"), [(2e-3, [0.0]), (0.0, [0.0, 0.1, 0.1]), (0.0, [])])
def test_a_pass_that_still_improves_or_disagrees_leaves_no_error(gain, lacks):
    assert judged(gain, *lacks).nature is Nature.ATTAINED
    assert judged(gain, *lacks).error[0, 0] == 0
