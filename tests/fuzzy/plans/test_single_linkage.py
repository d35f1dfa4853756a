"""Estimates by single linkage: optima that are found, samples that the rule asks for, and kinks."""

from functools import cache

import numpy as np
import pytest

from alphacut.fuzzy import Interval, Nature, Triangular, propagate
from tests.calibration.functions import named, rastrigin, schwefel, sines
from tests.calibration.test_functions import shortfall, wide

SQUARE = {"x": Interval(0, 1), "y": Interval(0, 1)}
# least and greatest value over the unit square: a grid of 801² points, polished by L-BFGS-B, and
# scipy.optimize.direct with 10,000 evaluations
HUMPS = {
    "sines": (
        lambda x, y: np.sin(20 * x) + np.sin(17 * y) + np.sin(9 * x + 13 * y),
        (-2.958992, 2.987918),
    ),
    "growing sines": (lambda x, y: x * np.sin(12 * x) + y * np.sin(15 * y), (-1.656111, 1.604548)),
    "product of sines": (
        lambda x, y: np.sin(14 * x + 3) * np.sin(11 * y) + 0.4 * np.cos(23 * x * y),
        (-1.399801, 1.381311),
    ),
    "Rastrigin": (
        lambda x, y: 20 + sum(z * z - 10 * np.cos(2 * np.pi * z) for z in (4 * x - 2, 4 * y - 1)),
        (0.0, 48.543300),
    ),
    "Schwefel": (
        lambda x, y: -sum(z * np.sin(np.sqrt(abs(z))) for z in (1000 * x - 500, 1000 * y - 500)),
        (-837.965775, 837.965775),
    ),
}


@cache
def bounds_of(name):
    return propagate(HUMPS[name][0], SQUARE, alpha=[0.0], vectorised=True)


@pytest.mark.parametrize("name", [*[*HUMPS][:-1], pytest.param("Schwefel", marks=pytest.mark.slow)])
def test_no_hump_is_missed(name):
    (low, high), result = HUMPS[name][1], bounds_of(name)
    near = result.error[0, 0] + 1e-6 * (high - low)
    assert result.lower[0, 0] == pytest.approx(low, abs=near)
    assert result.upper[0, 0] == pytest.approx(high, abs=near)
    assert result.nature is Nature.ESTIMATED
    assert result.error[0, 0] <= 2e-5 * (high - low)
    assert result.evaluations < 8000


def test_symmetric_optima_are_several_and_a_valley_is_one():
    """Four corners of one value ask for as many samples as four of different values."""
    notes = [
        propagate(function, SQUARE, alpha=[0.0], vectorised=True).notes[0]
        for function in (
            lambda x, y: (x - 0.5) ** 2 + (y - 0.5) ** 2,
            lambda x, y: (x + y - 1) ** 2,
        )
    ]
    assert notes[0].startswith("W = 4 ")
    assert notes[1].startswith("W = 2 optima found from N = 100 ")  # corners off the diagonal


@pytest.mark.parametrize(
    ("family", "seed"),
    [(rastrigin, [3, 3]), (rastrigin, [3, 7]), (schwefel, [3, 18]), (sines, [1, 9])],
)
def test_basins_that_a_long_first_step_leaves_are_found(family, seed):
    """They cover 8, 8, 20 and 27 % of a cut; descents that pass over humps missed them."""
    rng = np.random.default_rng([*seed, sum(map(ord, family.__name__))])
    function, inputs = family(rng, n := int(rng.integers(1, 5))), wide(rng, n)
    result = propagate(named(function), inputs, alpha=(0.0, 0.5), vectorised=True)
    assert result.nature is Nature.ESTIMATED
    assert shortfall(function, inputs, result) <= 1


@pytest.mark.parametrize("function", [
    lambda x, y: np.clip(3 * x - 1.5, -0.4, 0.5) + np.maximum(0, 1 - 20 * np.hypot(x, y - 0.5)),
    lambda x, y: np.maximum((x - 0.5) ** 2 + (y - 0.5) ** 2, 0.1),
], ids=["cone at an end", "flat bottom"])  # fmt: skip
def test_a_plateau_is_not_taken_as_explored(function):
    """A cone of 0.4 % of the square on it may be missed: the bounds are attained only."""
    result = propagate(function, SQUARE, alpha=[0.0], vectorised=True)
    assert result.nature is Nature.ATTAINED
    assert "on plateaus" in " ".join(result.notes)
    assert result.evaluations < 6000


def test_a_cone_between_uniform_samples_is_found():
    """It rises from a plateau and reaches 0.557376 (dense samples, local search) at a face."""
    turn = np.array([[-0.195, -1.009, 0.167], [-0.119, -0.651, 0.234], [-0.687, 0.411, -0.583]])
    apex = np.array([0.1221, 0.7406, 0.6893])

    def function(**inputs):
        x = np.array([*inputs.values()])
        u, v, w = turn @ x
        base = 0.634 * np.tanh(u) + 0.378 * v**2 + 0.63 * np.sin(1.5 * w + 4.83)
        return np.clip(base, -0.4, 0.5) + 1.5 * max(0, 1 - 4 * np.linalg.norm(x - apex))

    ends = (-0.5223, 1.1228), (-0.8109, 0.7384), (-1.0089, 0.5989)
    result = propagate(function, {f"x{k}": Interval(*x) for k, x in enumerate(ends)}, alpha=[0.0])
    assert (result.lower.item(), result.upper.item()) == pytest.approx((-0.4, 0.557376), abs=2e-4)


def flat_with_a_cone(rng):
    """Steps, or a wave cut at two values, and on its highest plateau a cone: with the apex's value."""
    n, steps = int(rng.integers(1, 4)), int(rng.integers(0, 4))
    names, ends = [f"x{k}" for k in range(n)], [1, 2] * rng.uniform(-1, -0.5, (n, 1)) + [0, 2.5]
    turn, weights = rng.normal(size=(3, n)) / np.sqrt(n), rng.uniform(0.3, 1, 3)
    points = rng.uniform(*ends.T, (2000, n)).T

    def wave(x):
        u, v, w = np.tensordot(turn, x, axes=1)
        return weights @ [np.tanh(u), v**2, np.sin(1.5 * w + weights[0])]

    cuts = np.quantile(wave(points), [rng.uniform(0.05, 0.4), rng.uniform(0.6, 0.95)])

    def flat(x):
        return np.floor(steps * wave(x)) / steps if steps else np.clip(wave(x), *cuts)

    apex, radius, height = points[:, flat(points).argmax()], *rng.uniform([0.03, 0.02], [0.3, 1.5])

    def function(**inputs):
        x = np.array([inputs[name] for name in names])
        distance = np.linalg.norm(x - apex.reshape(-1, *[1] * (x.ndim - 1)), axis=0)
        return flat(x) + height * np.maximum(0, 1 - distance / radius)

    inputs = {name: Interval(*sorted(x)) for name, x in zip(names, ends.tolist(), strict=True)}
    return function, inputs, flat(points).max() + height


def test_the_nature_of_bounds_covers_a_cone_on_a_plateau(rng):
    function, inputs, peak = flat_with_a_cone(rng)
    result = propagate(function, inputs, alpha=[0.0], vectorised=True)
    is_covered = peak <= (result.upper + result.error).item() + 1e-9
    assert is_covered or result.nature is Nature.ATTAINED


def test_what_never_changes_is_attained_without_a_search():
    result = propagate(lambda x, y: {"u": x + y, "v": 0 * x}, SQUARE, alpha=[0], vectorised=True)
    assert result.natures == (Nature.ESTIMATED, Nature.ATTAINED)
    assert result.evaluations < 150
    assert any(note.startswith("v does not change") for note in result.notes)


@pytest.mark.parametrize(
    "function",
    [
        lambda x, y: np.abs(x - 0.3) + (y - 0.4) ** 2,
        lambda x, y: (x - 0.5) ** 2 + (y - 0.5) ** 2 + 1.0 * (x + 0.3 * y > 0.6),
    ],
    ids=["kink", "jump"],
)
def test_a_bound_at_a_kink_or_a_jump_is_attained(function):
    result = propagate(function, SQUARE, alpha=[0.0], vectorised=True)
    assert result.nature is Nature.ATTAINED
    assert (result.error == 0).all()
    assert any("kink or a jump" in note for note in result.notes)
    assert result.evaluations < 2000


@pytest.mark.parametrize(
    ("count", "evaluations", "points"),
    # nominal point, walk, two staircases that begin at corners, and the other corners of four cuts
    [(1, 1 + 21 + 2 * 41 + 3 * 2, 100), (4, 1 + 81 + 2 * 81 + 4 * 2**4 - 2, 60)],
)
def test_corners_bound_a_monotone_function_at_little_cost(count, evaluations, points):
    inputs = {f"x{i}": Triangular(0.0, 0.3, 1.0) for i in range(count)}
    result = propagate(lambda **x: sum(np.exp(v) for v in x.values()), inputs, vectorised=True)
    assert (result.nature, result.evaluations) == (Nature.ESTIMATED, evaluations)
    assert f"differences of each input keep their sign at {points} points" in result.notes[0]
    np.testing.assert_allclose(result.upper[0, 0], count * np.e, rtol=1e-14)


@pytest.mark.parametrize(
    "function",
    [
        lambda x, y: (x - 0.02) ** 2 + y,  # turns beside a corner
        lambda x, y: x + y - 0.5 * (x + y > 1.7),  # jumps beside one
        lambda x, y: x + 2 * y + 5 * (x - y > 0.95),  # jumps beside another corner
        lambda x, y: x + y + 3 * np.maximum(1 - ((x - 0.4) ** 2 + (y - 0.6) ** 2) / 0.04, 0) ** 2,
    ],
    ids=["hump", "jump", "jump elsewhere", "spike"],
)
def test_corners_that_do_not_suffice_are_seen(function):
    result = propagate(function, SQUARE, alpha=[0.0], vectorised=True)
    assert not any(note.startswith("corners") for note in result.notes)
