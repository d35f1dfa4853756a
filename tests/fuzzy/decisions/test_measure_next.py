"""Which input to measure next: gains against brute force, and when nothing can be said."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from itertools import combinations

import numpy as np
import pytest

from alphacut.fuzzy import (
    Automatic,
    Chebyshev,
    Crisp,
    FuzzyNumber,
    Interval,
    Reduced,
    Triangular,
    from_data,
)
from alphacut.fuzzy.decisions.measure_next import Gain, advice, measure_next

Array = np.ndarray
NAMES = ("a", "b", "c", "d")


def random_function(rng: np.random.Generator) -> Callable[..., Array]:
    """Slopes, an extreme inside, a product and an exponential."""
    slope, square, rate = rng.normal(0, 1, 4), rng.normal(0, 0.7, 4), rng.normal(0, 0.5, 4)
    at, pair = rng.uniform(-0.8, 0.8, 4), rng.normal(0, 0.5, (4, 4))

    def function(**x: Array) -> Array:
        v = np.stack([x[name] for name in NAMES])
        straight = np.tensordot(slope, v, 1) + np.tensordot(square, (v - at[:, None]) ** 2, 1)
        found: Array = straight + np.einsum("in,ij,jn->n", v, pair, v) + np.exp(rate @ v)
        return found

    return function


def brute_width(
    function: Callable[..., Array], inputs: Mapping[str, FuzzyNumber]
) -> tuple[float, float]:
    """Width by a grid that is made finer about its extremes."""
    cuts = np.array([inputs[name].cut(1.0) for name in NAMES])
    ends = []
    for sign in (1.0, -1.0):
        low, high = cuts.T
        for _ in range(6):
            axes = [np.unique(np.linspace(a, b, 9)) for a, b in zip(low, high, strict=True)]
            points = np.stack([x.ravel() for x in np.meshgrid(*axes, indexing="ij")])
            values = sign * function(**dict(zip(NAMES, points, strict=True)))
            best = points[:, int(values.argmax())]
            reach = (high - low) / 6
            low, high = np.maximum(cuts[:, 0], best - reach), np.minimum(cuts[:, 1], best + reach)
        ends.append(sign * float(values.max()))
    return ends[0] - ends[1], 0.0


def kendall(problems: int, rng: np.random.Generator) -> tuple[float, int]:
    """Concordant less discordant pairs over all whose gains differ beyond the error."""
    score = counted = 0
    for _ in range(problems):
        function = random_function(rng)
        ends = np.sort(rng.uniform(-1, 1, (4, 3)), axis=1)
        inputs = {name: Triangular(*row) for name, row in zip(NAMES, ends, strict=True)}
        found = measure_next(function, inputs, vectorised=True)
        exact = advice(lambda x, f=function: brute_width(f, x), inputs)
        ours = {gain.name: gain for gain in found.gains}
        for one, other in combinations(exact.gains, 2):
            for kind in ("half", "exact"):
                difference = getattr(one, kind) - getattr(other, kind)
                if abs(difference) > max(found.error, 1e-3 * exact.width):
                    counted += 1
                    here = getattr(ours[one.name], kind) - getattr(ours[other.name], kind)
                    score += 1 if here * difference > 0 else -1
    return score / counted, counted


def test_it_ranks_as_brute_force_does() -> None:
    tau, counted = kendall(2, np.random.default_rng(7))
    assert tau >= 0.9
    assert counted > 8


@pytest.mark.slow
def test_it_ranks_as_brute_force_does_on_twenty_problems() -> None:
    tau, counted = kendall(20, np.random.default_rng())
    assert tau >= 0.9
    assert counted > 100


def test_gains_of_a_sum_are_exact() -> None:
    inputs = {"a": Interval(0, 4), "b": Triangular(0, 1, 3), "c": 2.0}
    found = measure_next(lambda a, b, c: a + 2 * b + c, inputs, Reduced())
    assert found.width == 10
    gains = {gain.name: gain for gain in found.gains}
    assert (gains["a"].half, gains["a"].exact, gains["a"].exact_least) == (2, 4, 4)
    assert (gains["b"].half, gains["b"].half_least) == (3, 3)
    assert [gain.name for gain in found.gains] == ["b", "a"]
    assert measure_next(lambda a, b, c: a + 2 * b + c, inputs, Reduced(), alpha=1.0).width == 4


def test_the_place_where_the_value_will_be_found_counts() -> None:
    """Of a parabola: half the interval about its lowest point says less than a half beside it."""
    found = measure_next(lambda a: a**2, {"a": Interval(-1, 1)}, Chebyshev())
    (gain,) = found.gains
    assert gain.half == pytest.approx(0.75, abs=1e-6)
    assert gain.half_least == pytest.approx(0.0, abs=1e-6)
    assert (gain.exact, gain.exact_least) == pytest.approx((1.0, 1.0), abs=1e-6)


def test_it_says_when_it_cannot_rank() -> None:
    alike = measure_next(
        lambda a, b: a + b, {"a": Interval(0, 1), "b": Interval(0, 1)}, Automatic()
    )
    assert "cannot be told from" in str(alike)
    assert re.search(r"by less than the error, [\d.]+e-1\d % of the width", alike.note)
    assert 0 < alike.error < 1e-9  # an error of 0 is an estimate, too
    assert "Where a support is a bound that you stated, more measurements do not" in str(alike)
    above = measure_next(lambda a: a, {"a": Interval(0, 1)}, Reduced(), alpha=0.5)
    assert "ranked" not in str(above)
    assert "nothing to measure" in measure_next(lambda a: a, {"a": Crisp(1.0)}, Reduced()).note
    nothing = measure_next(lambda a, b: 0 * a + b, {"a": Interval(0, 1), "b": Crisp(1)}, Reduced())
    assert "no input can be named" in nothing.note
    with pytest.raises(ValueError, match=r"outputs x, y; name one"):
        measure_next(lambda a: {"x": a, "y": a}, {"a": Interval(0, 1)}, Reduced())


def test_an_error_above_the_width_is_the_plan_s_and_says_what_to_take() -> None:
    """Measuring two inputs instead would help as little."""
    found = advice(lambda inputs: (1.0, 1.64), {"a": Interval(0, 1)})
    assert "328 % of the width; the plan's error is too large to tell" in found.note
    assert "take plan=Optimisation() or BranchAndBound()" in found.note


def test_an_error_of_an_answer_that_a_difference_does_not_hold_hides_nothing() -> None:
    """The plan was poor of one box at an end of a, which the gains at the modal value leave out."""

    def answer(inputs: Mapping[str, FuzzyNumber]) -> tuple[float, float]:
        a, b = (inputs[name].cut(0) for name in "ab")
        return 2 * a.width + b.width, 0.8 if tuple(a) == (0, 0.5) else 0.01

    found = advice(answer, {"a": Interval(0, 1), "b": Interval(0, 1)})
    assert found.note == ""
    assert found.error == pytest.approx(0.81)
    poor = advice(lambda x: (answer(x)[0], 0.3), {"a": Interval(0, 1), "b": Interval(0, 1)})
    assert poor.note.startswith("a cannot be told from b: ")
    assert "the error, 20 % of the width" in poor.note


def test_claims_are_joined_before_they_are_cut() -> None:
    rng = np.random.default_rng(3)
    inputs = {name: from_data(rng.normal(size=20), "mean", law="normal") for name in "ab"}
    found = measure_next(lambda a, b: a + b, inputs, Reduced(), alpha=0.1)
    apart = sum(number.cut(0.05).width for number in inputs.values())
    assert found.width == pytest.approx(apart, rel=0.02)


@pytest.mark.parametrize("alpha", [[0, 1], 1.5, None])
def test_widths_are_compared_at_one_level(alpha):
    with pytest.raises(ValueError, match="compared at one level, a number from 0 to 1"):
        measure_next(lambda x: x, {"x": Triangular(0, 1, 2)}, Reduced(), alpha=alpha)


def test_an_interruption_counts_the_samples_of_all_answers(tmp_path):
    calls = []

    def stopped(x, y):
        calls.append((x, y))
        if len(calls) == 12:
            raise KeyboardInterrupt
        return x * y

    inputs = {"x": Triangular(0, 1, 2), "y": Triangular(1, 2, 3)}
    kept = {"store": tmp_path / "s.db", "identity": {"a": 1}}
    with pytest.raises(KeyboardInterrupt, match=r"s\.db keeps \d+ samples of all answers") as told:
        measure_next(stopped, inputs, Reduced(), **kept)
    count = int(str(told.value).split("keeps ")[1].split()[0])
    assert 4 < count < 12
    del calls[:]
    with pytest.raises(KeyboardInterrupt, match="none of the samples is kept"):
        measure_next(stopped, inputs, Reduced())


def test_a_wrong_output_is_refused_after_one_sample():
    calls = []

    def function(x, y):
        calls.append(x)
        return {"a": x + y, "b": x * y}

    inputs = {"x": Triangular(0, 1, 2), "y": Triangular(0, 1, 2)}
    for output in ("A", None):
        with pytest.raises(ValueError, match="a, b"):
            measure_next(function, inputs, output=output)
    assert len(calls) <= 2 + 2  # the one sample, and whether it gives the same again


def test_gains_that_are_round_off_are_written_as_none() -> None:
    told = Gain("x", 0.5, 1e-13, 1.0, -2e-14).shares(100 / 2.0)
    assert told == ["25", "0", "50", "0"]
