"""Questions to a motion: peaks, passing of limits, tolerances, probabilities."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    Limit,
    MatrixStructure,
    Peak,
    StoreyFrame,
    decide,
    envelope,
    over_records,
    peaks,
    pendulum,
    probability,
    tolerances,
)
from alphacut.frame.analyses.limits import about_limit
from alphacut.frame.analyses.peaks import loose_peaks, tightest
from alphacut.fuzzy import Crisp, Interval, Nature, RefusedError, Triangular
from tests.frame.motions import exact_motions, random_points
from tests.refused import refuses

ANY = "any of them"
OUTPUTS = ("q1", "drift2", "base_shear")
MOTION = {"dampers": (90, 60), "damper_placement": "storey", "q0": (0.05, 0.0), "v0": (0.0, 0.4)}
FRAME = StoreyFrame((9e3, 7e3), (2.4, 3.0), 25e9, 1e-6, **MOTION, outputs=OUTPUTS)
INPUTS = {"E": Triangular(23e9, 25e9, 26e9), "m2": Triangular(6.8e3, 7e3, 7.3e3)}
ALPHA = (0.0, 0.25, 0.5, 0.75, 1.0)
ONE = StoreyFrame(  # q = v0 / ω sin ωt with ω² = 24 E I / (l³ m): it peaks at v0 √(l³ m / (24 E I))
    (1e3,), (3.0,), 25e9, 1e-6, (0.0,), "storey", (0.0,), (0.3,), outputs=("q1",)
)


def decided(found, limits):
    """Decisions on limits of peaks by name, such as "q1" and "max q2"."""
    sides = {"max": True, "min": False}
    words = {name: name.rpartition(" ") for name in limits}
    of = [Limit(words[x][2], limit, sides.get(words[x][0])) for x, limit in limits.items()]
    return decide(found, of).limits


def motions(rng, frame, inputs, count, *, level=0.0, duration=4, step=0.05):
    points = random_points(inputs, count, rng, level)
    return np.abs(exact_motions(frame, points, inputs, duration, step)).max(1)


def amplitude(mass):
    return 0.3 * np.sqrt(27 * mass / (24 * 25e9 * 1e-6))


@pytest.fixture(scope="module")
def proved():
    return peaks(envelope(FRAME, INPUTS, duration=4, step=0.05, alpha=ALPHA))


def bounds(found, name, level=0):
    """Bounds of all peaks on a level, shape (m,)."""
    return np.array([getattr(peak, name)[level] for peak in found.values()])


@pytest.mark.parametrize("level", [0, 2])
def test_no_motion_peaks_outside_the_fuzzy_peak(proved, level, rng):
    size = motions(rng, FRAME, INPUTS, 400, level=ALPHA[level])
    upper, lower, error = (bounds(proved, name, level) for name in ("upper", "lower", "error"))
    assert (size <= upper + error).all()
    assert (size >= lower - error).all()
    assert size.max(0) == pytest.approx(upper, rel=0.01)


def test_the_limit_that_a_level_just_reaches_is_possible_to_that_level():
    inputs = {"m1": Triangular(900, 1000, 1100)}
    alpha = (0.0, 0.2, 0.4, 0.6, 0.8, 1.0)
    of = peaks(envelope(ONE, inputs, duration=1, step=0.01, alpha=alpha))
    assert of["q1"].nature is Nature.GUARANTEED
    middle = decided(of, {"q1": amplitude(1050)})["q1"]  # reached at the mass of level 0.5
    assert middle.possibility == (0.4, 0.6)
    assert middle.necessity == (0.0, 0.0)
    assert decided(of, {"q1": amplitude(1101)})["q1"].verdict == "not exceeded"
    surely = decided(of, {"q1": amplitude(899)})["q1"]
    assert surely.possibility == (1.0, 1.0)
    assert surely.verdict != "undecided"  # the least peak is a bound, not attained


def test_any_of_several_limits_is_as_possible_as_the_most_possible(proved):
    q1, drift2 = (0.999 * proved[name].upper for name in ("q1", "drift2"))
    limits = {"q1": q1[1], "drift2": drift2[3], "base_shear": 1e9}
    answers = decided(proved, limits)
    assert answers["base_shear"].possibility == (0.0, 0.0)
    assert answers[ANY].possibility == answers["drift2"].possibility
    assert answers[ANY].possibility[0] >= answers["q1"].possibility[0]
    far_below = decided(proved, {name: 0.9 * peak.lower[0] for name, peak in proved.items()})
    assert {answer.verdict for answer in far_below.values()} == {"exceeded"}
    assert far_below[ANY].necessity == (1.0, 1.0)


def exact(peak):
    """Bounds of a peak that every motion has."""
    row = np.array([peak])
    return Peak(np.zeros(1), row, row, 0 * row, row, row, row, Nature.GUARANTEED, side="max")


def test_the_margin_of_any_limit_is_the_least_share_and_a_limit_of_0_has_all_or_none():
    """Peaks of 0.5, −0.2 and 0.9 below limits of 2, 0 and 1: 75 % is left, all, and 10 %."""
    found = {name: exact(peak) for name, peak in (("q1", 0.5), ("max q2", -0.2), ("q3", 0.9))}
    limits = {"q1": 2.0, "max q2": 0.0, "q3": 1.0}
    assert decided(found, limits)[ANY].margin.lower == pytest.approx(0.1)
    assert decided(found, {"q1": 2.0, "max q2": 0.0})[ANY].margin.lower == pytest.approx(0.75)
    above = {"q1": 2.0, "max q2": -0.3}
    assert decided(found, above)[ANY].margin.lower == pytest.approx(-1 / 3)
    passed = {name: exact(peak) for name, peak in (("q1", 0.9), ("max q2", 0.2), ("q3", 1.3))}
    assert decided(passed, limits | {"q3": 9.0})[ANY].margin.lower == pytest.approx(-1.0)


def test_attained_bounds_exclude_nothing_and_say_so():
    given = {"duration": 4, "step": 0.05, "alpha": (0, 1), "method": "quasi-monte-carlo"}
    of = peaks(envelope(FRAME, INPUTS, **given))
    assert {peak.nature for peak in of.values()} == {Nature.ATTAINED}
    far = decided(of, {"q1": 10 * of["q1"].upper[0]})["q1"]
    assert (far.possibility, far.nature, far.verdict) == ((0, 1), Nature.ATTAINED, "undecided")
    near = decided(of, {"q1": 0.9 * of["q1"].reached[1]})["q1"]
    assert near.possibility == (1.0, 1.0)
    assert near.necessity == (0.0, 1.0)


def test_what_lies_between_nodes_lowers_no_peak():
    """Of estimated bounds: a coarse step widens them above, and all structures still exceed."""
    found = envelope(FRAME, INPUTS, duration=4, step=0.05, alpha=(0, 1))
    largest = np.abs(found.upper).max((0, 1))
    coarse = replace(
        found,
        nature=Nature.ESTIMATED,
        inner=None,
        outer=None,
        least_peaks=None,
        error=np.full_like(found.error, 1e-3 * largest.min()),
        between=np.tile(largest, (len(found.time), 1)),
    )
    peak = peaks(coarse)["q1"]
    assert peak.error[0] >= largest[0]
    limit = 0.98 * peak.lower[0]
    assert decided({"q1": peak}, {"q1": limit})["q1"].verdict == "exceeded"


@pytest.mark.parametrize("alpha", [[0.0], [0.0, 1.0]])
def test_nothing_is_more_necessary_than_it_is_possible(alpha):
    """Also where the lowest level alone is known: a limit that no response reaches is not passed."""
    found = peaks(envelope(FRAME, INPUTS, duration=1.0, step=0.05, alpha=alpha))
    for factor, degrees in ((1.1, (0.0, 0.0)), (0.01, (1.0, 1.0))):
        limits = [Limit(name, factor * float(found[name].upper[0])) for name in ("q1", "drift2")]
        for part in decide(found, limits).limits.values():
            assert part.possibility == degrees
            assert part.necessity == degrees


def test_levels_below_the_lowest_are_left_open():
    motion = envelope(FRAME, INPUTS, duration=4, step=0.05, alpha=(0.5, 1))
    answer = decided(motion, {"q1": 1.0})["q1"]
    assert answer.possibility == (0.0, 0.5)
    assert (answer.verdict, answer.from_level) == ("not exceeded", 0.5)


def test_the_scale_of_tolerances_is_kept_and_a_greater_one_passed(rng):
    inputs = {"m1": Triangular(900, 1000, 1100)}
    limit = amplitude(1000 + 1.4 * 100)
    answer = tolerances(
        ONE, inputs, Limit("q1", limit), duration=1, step=0.01, most=2, precision=0.005, error=2e-4
    )
    assert answer.nature is Nature.GUARANTEED
    assert answer.kept <= answer.clear < answer.passed
    assert answer.kept <= 1.4 <= answer.passed
    assert answer.passed - answer.kept <= 0.03
    reach = 100 * answer.kept
    assert answer.supports["m1"].kept == pytest.approx((1000 - reach, 1000 + reach))
    scaled = {"m1": Interval(*answer.supports["m1"].kept)}
    assert motions(rng, ONE, scaled, 500, duration=1, step=0.01).max() <= limit


@pytest.mark.parametrize(("limit", "kept", "passed"), [(1e-3, None, 0.0), (9.0, 2.0, None)])
def test_tolerances_at_their_ends(limit, kept, passed):
    inputs = {"m1": Triangular(900, 1000, 1100)}
    answer = tolerances(ONE, inputs, Limit("q1", limit), duration=1, step=0.02)
    assert (answer.kept, answer.passed) == (kept, passed)


def speed(rng, count):
    return rng.normal(0.4, 0.1, count)


def probable(frame=FRAME, inputs=INPUTS, limits=None, **changes):
    settings = {"duration": 4, "step": 0.05, "alpha": (0, 0.5, 1)}
    settings |= {"samples": 400, **changes}
    limits = [Limit(*pair) for pair in (limits or {"drift2": 0.16, "q1": 0.14}).items()]
    return probability(frame, inputs, limits, {"v2_0": speed}, **settings).events


def test_probabilities_are_nested_and_agree_with_independent_draws(rng):
    answers = probable()
    one = answers["drift2"]
    assert (np.diff(one.upper) <= 0).all()
    assert (np.diff(one.lower) >= 0).all()
    assert one.lower[-1] == one.upper[-1]
    assert (answers[ANY].upper >= one.upper).all()
    curve = answers["q1"].curve  # falls from 1 to 0
    for end in (curve.lower, curve.upper):
        assert (np.diff(end, axis=-1) <= 0).all()
        assert end[0, 0] == 1
    assert curve.upper[0, -1] == 0
    draws = rng.normal(0.4, 0.1, 4000)
    points = np.column_stack([np.full(4000, 25e9), np.full(4000, 7e3), draws])
    size = np.abs(exact_motions(FRAME, points, ("E", "m2", "v2_0"), 4, 0.05)).max(1)
    share = (size[:, 1] > 0.16).mean()
    low, high = (end[-1] for end in one.interval)
    assert low < share < high
    assert low < one.lower[-1] <= one.upper[-1] < high


def test_the_interval_is_that_of_clopper_and_pearson_at_the_level_of_bonferroni():
    """Of one fuzzy input with 66 points on two levels and one on the last, at which 0 or all pass."""
    inputs = {"E": Triangular(24e9, 25e9, 26e9)}
    answers = probable(inputs=inputs, limits={"drift2": 1e3, "q1": 1e-9}, samples=50)
    miss = 0.05 / (2 * (66 + 66 + 1))
    np.testing.assert_allclose(answers["drift2"].interval.upper, 1 - miss ** (1 / 50))
    assert (answers["drift2"].interval.lower == 0).all()
    np.testing.assert_allclose(answers["q1"].interval.lower, miss ** (1 / 50))
    assert (answers["q1"].interval.upper == 1).all()


@pytest.mark.parametrize(
    ("limits", "random", "key"),
    [
        ({"q9": 1.0}, {}, "output"),
        ({"q1": 0.0}, {}, "limit of q1"),
        ({"q1": 1.0}, {"E": speed}, "random"),
        ({"q1": 1.0}, {"v2_0": lambda rng, n: rng.random(3)}, "values of v2_0"),
        ({"q1": 1.0}, ["m2", "stiffness"], "random"),
    ],
)
def test_wrong_questions_are_refused(limits, random, key):
    asked = [Limit(*pair) for pair in limits.items()]
    with pytest.raises(RefusedError) as refused:
        probability(FRAME, INPUTS, asked, random, duration=1, step=0.1)
    assert refused.value.key == key


def test_the_interval_without_random_inputs_contains_the_bounds_and_what_lies_between_nodes():
    """The limit of 27 N lies within the error of the time steps, that of 28 N between the nodes."""
    of_force = pendulum().with_outputs(("force",))
    for limit, bounds, error in ((27.0, (0.0, 1.0), 0.0), (28.0, (0.0, 0.0), 1.0)):
        asked = Limit("force", limit)
        inputs = {"l": Interval(0.9999, 1.0001)}
        found = probability(of_force, inputs, asked, duration=4, step=0.1, alpha=[0])
        of_limit = found.events["force"]
        assert (of_limit.lower[0], of_limit.upper[0], of_limit.error[0]) == (*bounds, error)
        assert (of_limit.interval.lower[0], of_limit.interval.upper[0]) == (0.0, 1.0)


def test_a_mean_takes_one_value_and_several_records():
    band = envelope(ONE, {"m1": Interval(900, 1100)}, duration=1, step=0.05, progress=False)
    with refuses("limits"):
        decide(band, Limit("q1", (0.01, 0.1), mean=True))
    with refuses("output"):
        decide(band, Limit("q1", 0.1, mean=True))


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"suite": []}, "suite"),
        ({"duration": -1.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"step": 0.0}, "step"),
    ],
)
def test_suites_without_records_and_times_are_refused(changes, key):
    arguments = {"suite": [Accelerogram(0.05, np.ones(20))], "duration": 1.0, "step": 0.05}
    with refuses(key):
        over_records(ONE, {"m1": Interval(900, 1100)}, **(arguments | changes))


def test_two_records_of_one_name_are_refused():
    twice = [Accelerogram(0.05, scale * np.ones(20), name="push") for scale in (1.0, 3.0)]
    with refuses("suite"):
        over_records(ONE, {"m1": Interval(900, 1100)}, twice, duration=1, step=0.05)


def test_an_output_whose_name_begins_as_minimum_has_the_peak_of_its_magnitude():
    rows = {"minor": [1.0], "q": [1.0]}
    model = MatrixStructure({"k": 1e3}, [(1.0, np.eye(1))], [("k", np.eye(1))], rows, q0=[0.1])
    inputs = {"k": Interval(800, 1200)}
    found = peaks(envelope(model, inputs, duration=0.05, step=0.01, progress=False))
    assert found["minor"].reached_at == found["q"].reached_at


def test_records_need_a_structure_that_oscillates():
    free = np.array([[1e3, -1e3], [-1e3, 1e3]])
    drifting = MatrixStructure({"k": 1.0}, [(1.0, np.eye(2))], [("k", free)], {"q2": [0.0, 1.0]})
    record = Accelerogram(0.05, np.ones(20))
    with refuses("stiffness"):
        over_records(drifting, {"k": Interval(0.9, 1.1)}, [record], duration=1, step=0.05)


def one_level(lower, upper, reached, nature, error=0.0, outputs=("q1",)):
    ends = [np.array([x]) for x in (lower, upper, error, reached, 0.0, np.inf)]
    return dict.fromkeys(outputs, Peak(np.zeros(1), *ends, nature))


@pytest.mark.parametrize("order", [1, -1])
def test_the_tighter_proved_and_the_larger_reached_value_is_taken(order):
    first = one_level(1.0, 3.0, 2.0, Nature.GUARANTEED)
    second = one_level(0.5, 2.5, 2.2, Nature.GUARANTEED, outputs=("q1", "q2"))
    both = tightest(*(first, second)[::order])
    assert set(both) == {"q1", "q2"}
    peak = both["q1"]
    assert (peak.lower[0], peak.upper[0], peak.reached[0]) == (1.0, 2.5, 2.2)
    weaker = one_level(1.5, 2.1, 2.4, Nature.ATTAINED)
    mixed = tightest(*(first, weaker)[::order])["q1"]
    assert (mixed.lower[0], mixed.upper[0], mixed.reached[0]) == (1.0, 3.0, 2.4)
    assert mixed.nature is Nature.GUARANTEED


def test_peaks_are_wide_where_the_gap_is_or_nothing_is_proved():
    one = np.ones(2)

    def peak(upper, nature=Nature.GUARANTEED):
        return Peak(np.array([0.0, 1.0]), one, upper, 0 * one, one, one, one, nature)

    bounds = {"q1": peak(one), "q2": peak(np.array([1.1, 1.0])), "q3": peak(one, Nature.ESTIMATED)}
    assert loose_peaks(bounds, ("q1", "q2", "q3", "max q1"), 0.05) == ("q2", "q3", "max q1")
    assert loose_peaks(bounds, ("q1", "q2"), 0.1) == ()


def test_random_inputs_have_the_shape_of_their_membership(rng):
    """With masses of 900, 1000 and 1200 kg a third lies below 1000 kg and 3/8 above 1050 kg."""
    random = {"m1": Triangular(900, 1000, 1200)}
    for mass, share in ((1000, 2 / 3), (1050, 3 / 8)):
        found = probability(
            ONE,
            {"v1_0": Crisp(0.3)},
            Limit("q1", amplitude(mass)),
            random,
            duration=0.5,
            step=0.01,
            alpha=[1],
            samples=3000,
            seed=int(rng.integers(10**9)),
        ).events["q1"]
        # Peaks between the time nodes are left out of both bounds, and counted as their error. A
        # fraction of draws is off by more than six standard deviations once in 5e8.
        six_deviations = 6 * np.sqrt(share * (1 - share) / 3000)
        assert found.lower[0] - six_deviations < share
        assert share < found.upper[0] + found.error[0] + six_deviations
        assert found.error[0] < 0.02


def test_the_table_of_a_decision_has_a_row_for_each_limit_and_one_for_any_of_them(proved):
    limits = [Limit(name, 1.1 * float(peak.upper[0])) for name, peak in proved.items()]
    head, rows = decide(proved, limits).table()
    gaps = [row[head.index("gap")] for row in rows]
    assert all(text.endswith("%") for text in gaps[:-1])  # of single peaks
    assert (rows[-1][0], gaps[-1], rows[-1][head.index("bound of peak")]) == (ANY, "", "")
    assert all(row[head.index("verdict")] == "not exceeded" for row in rows)


@pytest.mark.parametrize(
    ("stated", "unit"),
    [("1.5 %", None), ("62.5 %", None), ("1/200", None), ("2.5", None), ("1.5 mm", "mm")],
)
def test_a_percentage_has_no_unit_of_its_own(stated, unit):
    result = about_limit(Limit("drift1", 0.02, stated=stated), "m")
    shown = result.stated_unit
    assert (shown and shown.label) == unit
