"""Evidence that corners suffice: jumps and waves beside a trend, and what monotone outputs cost."""

from itertools import product

import numpy as np
import pytest

from alphacut.fuzzy import Interval, Nature, Triangular, propagate

WIDE = {"x": Interval(-5, 5), "y": Interval(-5, 5)}
DENSE = np.linspace(0, 1, 400_001)


def square_wave(y):
    return np.sign(np.cos(10 * y))


@pytest.mark.parametrize(
    ("function", "inputs", "right"),
    [
        # at y = 15.5 π / 10, where the last wave begins to reduce the output
        (lambda y: y - 0.1 * square_wave(y), ["y"], 1.55 * np.pi + 0.1),
        (lambda y: y - 0.3 * np.cos(10 * y), ["y"], 5.029218),  # of 2,000,001 points
        (lambda x, y: x - 0.1 * square_wave(y) + y - 0.5, ["x", "y"], 5 + 1.55 * np.pi - 0.4),
        (lambda x, y: x + y - 0.3 * np.cos(10 * y), ["x", "y"], 10.029218),
    ],
    ids=["jumps", "waves", "jumps of one input", "waves of one input"],
)
def test_jumps_and_waves_beside_a_trend_are_not_bounded_by_corners(function, inputs, right):
    """They exceed the corner by 0.7 % of the range, and the differences of few points rise."""
    bounds = propagate(function, {name: WIDE[name] for name in inputs}, vectorised=True)
    assert "corners alone" not in " ".join(bounds.notes)
    is_estimated = bounds.nature is Nature.ESTIMATED
    assert not is_estimated or (bounds.upper + bounds.error >= right - 1e-6).all()
    assert (bounds.upper <= right + 1e-6).all()
    assert bounds.upper.max() > right - 0.08 * is_estimated - 0.08


def test_a_valley_of_roots_beside_a_slope_is_not_bounded_by_corners():
    """The least value at α = ½ is −14736.98, at (−0.26622, 0.95380), by 60,000 samples and a local search."""
    turn = np.array(
        [[1.11831368, -0.96182691], [-0.11738445, 0.10671793], [0.55862854, -0.59621315]]
    )

    def function(x, y):
        u, v, w = turn @ np.stack([x, y])
        roots = 0.5761012455720962 * np.sqrt(np.abs(u - 0.46753346649364136))
        roots += 1.2120538077292087 * np.sqrt(np.abs(v - 0.13303762892417004))
        return 37307.03276086409 * (roots + 1.5923373696868033 * w)

    inputs = {
        "x": Triangular(-0.9189822907021551, 0.045554036262517195, 0.7564649785098387),
        "y": Interval(-0.8841742650211875, 0.9537991382652937),
    }
    bounds = propagate(function, inputs, alpha=[0, 0.5], vectorised=True)
    assert bounds.nature is Nature.ATTAINED or bounds.lower[1, 0] - bounds.error[1, 0] <= -14736.9


def test_a_descent_that_stalls_in_a_cusp_is_followed_by_the_other_input():
    """It ends above the value of the smooth optimum at a corner; with y at its upper end, below."""

    def function(x, y):
        cusp = 0.6309654877974369 * np.sqrt(np.abs(x - 0.6581892431485322))
        return cusp + 0.48149344111319314 * x - 0.6150719473307159 * y

    inputs = {
        "x": Interval(-0.9426466164541686, 0.8277394226793051),
        "y": Interval(-0.7607540627298616, 0.8671835842965365),
    }
    bounds = propagate(function, inputs, alpha=[0], vectorised=True)
    right = function(0.6581892431485322, 0.8671835842965365)
    assert bounds.nature is Nature.ATTAINED or bounds.lower[0, 0] - bounds.error[0, 0] <= right
    assert bounds.lower[0, 0] < function(-0.9426466164541686, 0.8671835842965365)


WAVES = {
    "square": lambda t: np.sign(np.cos(t)),
    "sine": np.sin,
    "saw": lambda t: t / (2 * np.pi) % 1 * 2 - 1,
}


@pytest.mark.parametrize("wave", WAVES)
@pytest.mark.parametrize("length", [0.02, 0.07, 0.3])
@pytest.mark.parametrize(
    "phase", [2.0, *(pytest.param(x, marks=pytest.mark.slow) for x in (0.5, 4.0))]
)
def test_waves_of_many_lengths_and_sizes_exceed_no_declared_error(phase, wave, length):
    """Right values are those of 400,001 points; some waves leave the output monotone."""
    for size, slope in product((0.01, 0.04, 0.15), (0.2, 2.0)):

        def of_x(x, size=size, slope=slope):
            trend = np.expm1(slope * x) / np.expm1(slope)
            return trend + size * WAVES[wave](2 * np.pi * x / length + phase)

        values = of_x(DENSE)
        bounds = propagate(
            lambda x, y, of_x=of_x: of_x(x) - y,
            {"x": Interval(0, 1), "y": Interval(0, 1)},
            alpha=[0],
            vectorised=True,
            budget=1000,
        )
        if bounds.nature is Nature.ESTIMATED:
            error = bounds.error.item() + 1e-6
            assert bounds.upper.item() + error >= values.max(), (size, slope)
            assert bounds.lower.item() - error <= values.min() - 1, (size, slope)


@pytest.mark.parametrize(("inputs", "most"), [(1, 110), (2, 150), (3, 220), (7, 440)])
def test_a_monotone_output_is_estimated_by_its_corners(inputs, most):
    """Laws of different curvature, one with an infinite slope at an end of its input."""
    laws = np.sqrt, np.expm1, lambda x: -1 / (0.1 + x), lambda x: x, np.square

    def function(**x):
        return np.prod([2 + laws[i % 5](x[f"x{i}"]) / 5 for i in range(inputs)], axis=0)

    numbers = {f"x{i}": Triangular(0.0, 0.5, 1.0) for i in range(inputs)}
    bounds = propagate(function, numbers, vectorised=True)
    assert bounds.nature is Nature.ESTIMATED
    assert "corners alone" in bounds.notes[0]
    assert bounds.evaluations <= most
    ends = [[law(x) / 5 + 2 for law in laws] for x in (0.0, 1.0)]
    right = [np.prod([end[i % 5] for i in range(inputs)]) for end in ends]
    assert bounds.bounds()[0][0] == pytest.approx(right[0], rel=1e-12)
    assert bounds.bounds()[1][0] == pytest.approx(right[1], rel=1e-12)


def test_a_smooth_turn_near_a_corner_is_estimated_by_the_search():
    """(x − 0.02)² + y is least at x = 0.02, and the walk alone takes it for monotone."""
    inputs = {"x": Interval(0, 1), "y": Interval(0, 1)}
    bounds = propagate(lambda x, y: (x - 0.02) ** 2 + y, inputs, alpha=[0], vectorised=True)
    assert bounds.nature is Nature.ESTIMATED
    assert bounds.bounds() == pytest.approx((0, 0.98**2 + 1), abs=1e-5)


def test_an_optimum_beside_a_corner_of_any_cut_is_found():
    """At α = ½ it is 0.00283625, on a face (a grid of 2001² points), and the corner 0.00283044."""
    turn = np.array([[0.26501223, 1.26789829], [-0.45505702, -0.15450735], [-0.168391, 0.0107871]])
    factors = np.array(
        [
            [1.81000705, 1.63243209, -0.17344578, -0.75248719],
            [-2.0237598, -0.7308207, 0.07120307, -0.75695097],
            [0.11074471, -0.78280492, 1.81982962, 0.2670886],
        ]
    )

    def product_of_polynomials(x, y):
        values = [
            sum(c * z**k for k, c in enumerate(row, start=1))
            for row, z in zip(factors, turn @ np.stack([x, y]), strict=True)
        ]
        return 0.6651144635338473 * np.prod(values, axis=0)

    inputs = {
        "x": Triangular(-0.730531622336565, 0.19181929493080407, 0.9940924338640771),
        "y": Interval(-0.7798962386097238, 0.7603214826878335),
    }
    bounds = propagate(product_of_polynomials, inputs, alpha=[0, 0.5], vectorised=True)
    assert bounds.upper[1, 0] == pytest.approx(0.00283625, abs=1e-7)
