"""What results say of themselves in text, in a notebook, and in a CSV file."""

import csv
import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Envelope, StoreyFrame, envelope, guard, plan
from alphacut.fuzzy import (
    Automatic,
    BranchAndBound,
    Crisp,
    Extended,
    General,
    Interval,
    IntervalQuasiMonteCarlo,
    Known,
    Metamodel,
    MonteCarlo,
    Optimisation,
    RandomInput,
    Reduced,
    Signed,
    Triangular,
    decide,
    explain,
    from_data,
    propagate,
    safe_scale,
    width_shares,
)
from alphacut.fuzzy.decisions.measure_next import measure_next
from alphacut.fuzzy.plans.automatic import _per_cent
from alphacut.fuzzy.plans.interval_quasi_monte_carlo import IntervalResponse
from alphacut.fuzzy.random_response import RandomResponse
from alphacut.fuzzy.samples.model import Values
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.tables import html_table
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.result import Homogenised, StressCurve

X = {"x": Triangular(0, 1, 2), "y": Interval(1, 2)}


def product(x, y):
    return x * y


def bounds(inputs):
    found = propagate(product, inputs, Reduced(), alpha=[0, 1])
    return found.bounds()


SHOWN = {
    "explanation": (lambda: explain(product, X, Reduced()), "would run", "<td>0</td>"),
    "advice": (lambda: measure_next(product, X, Reduced()), "known twice as well", "<td>x</td>"),
    "shares": (lambda: width_shares(bounds, X), "  x: ", "<td>y</td>"),
    "decision": (
        lambda: decide(product, X, {"y": 3}),
        "possible, not certain: pos",
        "<td>0.75</td>",
    ),
    "threshold": (
        lambda: safe_scale(product, {"x": 1, "y": 1}, {"x": 0.1}, {"y": 1.2}),
        "proved safe up to 1.9999",
        "<td>unsafe from</td>",
    ),
}


@pytest.mark.parametrize("name", SHOWN)
def test_what_is_found_shows_itself_as_lines_and_as_a_table(name):
    make, words, cell = SHOWN[name]
    found = make()
    assert words in str(found) == repr(found)
    assert max(map(len, str(found).splitlines())) < 200
    page = found._repr_html_()
    assert cell in page
    assert page.startswith("<table>")


def test_a_plan_of_an_envelope_and_a_guard_show_themselves_in_a_line_each():
    frame = StoreyFrame(masses=[2e4], lengths=[3.0], modulus=25e9, second_moment=1e-6, q0=[0.01])
    (first, *_) = plan(frame, {"E": Interval(24e9, 26e9)}, duration=0.4, step=0.2)
    assert repr((first,)) == f"({first},)"
    assert str(first).startswith(f"{first.name}: ")
    assert repr(guard(frame, 0.2, 0.4)) == guard(frame, 0.2, 0.4).message


def test_a_number_from_data_says_its_claim_and_its_widest_cut():
    number = from_data([1.0, 2.0, 3.0], "median", bounds=(0, 9))
    assert f"{[number]}" == "[Claimed(median: 0 … 9 at α = 0)]"
    free = from_data([1.0, 2.0, 3.0], "median")
    assert str(free) == "Claimed(median: 1 … 3 at α = 0.25)"


def table(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_bounds_go_into_a_csv_file_with_all_digits_and_where_they_are_reached(tmp_path):
    found = propagate(lambda x, y: {"a, b": x * y / 3, "c": x}, X, Reduced(), alpha=[0, 0.3, 1])
    found.to_csv(tmp_path / "found.csv")
    rows = table(tmp_path / "found.csv")
    assert len(rows) == 6
    for row in rows:
        level, column = list(found.alpha).index(float(row["alpha"])), found.column(row["output"])
        assert float(row["lower"]) == found.lower[level, column]
        assert float(row["upper"]) == found.upper[level, column]
        assert float(row["y at upper"]) == found.upper_at[level, column, 1]
    found.to_csv(str(tmp_path / "found.csv"))
    assert [path.name for path in tmp_path.iterdir()] == ["found.csv"]


PLANS = (Reduced(), General(), Extended(), Signed(), MonteCarlo(9), Optimisation())


@pytest.mark.parametrize("way", PLANS, ids=lambda way: type(way).__name__)
def test_an_error_that_nothing_estimates_is_told_as_such(way, tmp_path):
    inputs = {"x": Triangular(0, 1, 2), "y": Triangular(1, 2, 4)}
    found = propagate(product, inputs, way, alpha=[0, 1])
    assert np.isnan(found.error[0, 0])
    assert found.error[1, 0] == 0  # of one point
    assert str(found).splitlines()[0].endswith("; their error is not estimated")
    assert "not estimated" in found._repr_html_()
    found.to_csv(tmp_path / "found.csv")
    assert [row["error"] for row in table(tmp_path / "found.csv")] == ["", "0.0"]
    assert np.isnan(found.to_dataset().error[0, 0])


def test_an_error_is_known_where_bounds_are_proved_and_attained_or_inputs_are_crisp():
    for way in PLANS[:4]:
        known = Known(signs={"x": 1, "y": 1})
        found = propagate(product, X, way, alpha=[0, 1], known=known)
        assert found.error.tolist() == [[0], [0]]
        assert "error" not in str(found)
    crisp = propagate(product, {"x": Crisp(2), "y": 3}, General(), alpha=[0, 1])
    assert not crisp.error.any()
    wrong = Known(monotone=("x", "y"))
    refuted = propagate(lambda x, y: (x - 1) ** 2 + y, X, Reduced(), alpha=[0, 1], known=wrong)
    assert np.isnan(refuted.error[0, 0])


def test_gains_of_bounds_without_an_error_are_told_apart_by_a_share_of_the_width():
    found = measure_next(product, X, Reduced())
    assert found.error == pytest.approx(2 * 0.02 * found.width)


def test_an_envelope_goes_into_a_csv_file_with_its_units(tmp_path):
    frame = StoreyFrame(masses=[2e4], lengths=[3.0], modulus=25e9, second_moment=1e-6, q0=[0.01])
    found = envelope(frame, {"E": Interval(24e9, 26e9)}, duration=0.4, step=0.2, alpha=[0, 1])
    found.to_csv(tmp_path / "motion.csv")
    rows = table(tmp_path / "motion.csv")
    assert len(rows) == 2 * 3
    assert {row["unit"] for row in rows} == {"m"}
    last = rows[-1]
    assert (float(last["time [s]"]), float(last["alpha"])) == (0.4, 1.0)
    assert float(last["lower"]) == found.lower[-1, -1, 0]
    assert float(last["E at upper"]) == found.upper_at[-1, -1, 0, 0]
    assert found.nature == "guaranteed"
    assert float(last["error within the bounds"]) == found.error[-1, -1, 0]
    estimated = replace(found, nature="estimated", inner_lower=None, inner_upper=None)
    estimated.to_csv(tmp_path / "estimated.csv")
    assert "error to be added" in table(tmp_path / "estimated.csv")[0]


@pytest.mark.parametrize("place", ["none/found.csv", "."])
def test_a_table_that_cannot_be_written_is_refused_and_leaves_nothing(place, tmp_path):
    found = propagate(product, X, Reduced(), alpha=[0, 1])
    with pytest.raises(ValueError, match=r"cannot be written to .* a folder that exists"):
        found.to_csv(tmp_path / place)
    assert not list(tmp_path.iterdir())


def test_an_array_is_drawn_as_bands_over_its_index_and_printed_in_part():
    found = propagate(lambda x, y: x * np.arange(30.0) + y, X, Reduced())
    axes = found.plot("y")
    assert len(axes.collections) == len(found.alpha)
    assert axes.get_xlabel() == "index"
    assert axes.get_xlim()[1] > 29
    assert len(str(found).splitlines()) == 28
    assert "… and 25 outputs more: bounds(NAME) has them" in found._repr_html_()
    with pytest.raises(ValueError, match=r"no output 'z'; there are y\[0\], .*, y\[24\], …$"):
        found.plot("z")


def test_results_with_arrays_are_compared_and_hashed_as_objects():
    found = propagate(product, X, Reduced(), alpha=[0])
    again = propagate(product, X, Reduced(), alpha=[0])
    assert found == found
    assert found != again
    assert len({found, again}) == 2
    for kind in (FuzzyResult, Values, RandomResponse, IntervalResponse):
        assert kind.__eq__ is object.__eq__
    for kind in (Envelope, Homogenised, StressCurve, StiffnessBounds):
        assert kind.__eq__ is object.__eq__


def test_a_table_without_notes_has_no_empty_paragraph():
    assert html_table(("a",), [("1",)]).endswith("</table>")
    assert html_table(("a",), [("1",)], below="x\ny").endswith("</table><p>x<br>y</p>")


def test_a_metamodel_names_outputs_errors_and_what_its_teacher_sees():
    two = lambda x, y: {"w": x * y, "s": 1e6 * x**2 * y}  # noqa: E731
    found = propagate(two, X, Metamodel(boxes=9, held_out=4, teacher=General()))
    half = found.error[0] / 2
    assert f"by up to {half[0]:.3g} of w, {half[1]:.3g} of s; the error is 2 times" in str(found)
    assert "the teacher General has the corners alone, widened by the samples" in str(found)
    assert " runs a box" in str(found)
    assert str(found).splitlines()[1].endswith(f", error {found.error[0, 0]:.2g}")
    assert f"<td>{found.error[0, 0]:.2g}</td></tr>" in found._repr_html_()


def test_a_budget_that_ends_a_search_is_told_in_plain_words():
    inputs = {name: Interval(0, 1 + k) for k, name in enumerate("abcdef")}
    wave = lambda a, b, c, d, e, f: np.sin(9 * a * b) + np.cos(7 * c - d) * e * f  # noqa: E731
    text = str(propagate(wave, inputs, Automatic(budget=200), alpha=[0, 1]))
    assert "the budget of 200 samples ended the search in its first round" in text
    assert "% of the width" in text


def test_the_first_of_several_outputs_is_drawn_and_an_array_says_how_to_get_it():
    found = propagate(lambda x, y: {"w": x, "a": [x, y]}, X, Reduced(), alpha=[0, 1])
    axes = found.plot()
    assert axes.get_xlabel() == "w"
    assert "first output, others by plot(NAME)" in axes.get_title()
    assert "first output" not in propagate(product, X, Reduced()).plot().get_title()
    with pytest.raises(
        ValueError, match=r"bounds\('a\[0\]'\) are those of an entry, plot\('a'\) draws"
    ):
        found.bounds("a")


def test_shares_are_told_by_output():
    two = lambda x, y: {"w": 3 * x, "s": 5 * y}  # noqa: E731
    found = width_shares(lambda inputs: propagate(two, inputs, Reduced(), alpha=[0.5]), X)
    lines = ["  w, x: 100 %", "  w, y: 0 %", "  s, x: 0 %", "  s, y: 100 %"]
    assert str(found).splitlines()[1:5] == lines
    assert "<th>output</th><th>input</th>" in found._repr_html_()
    unnamed = propagate(two, X, Reduced(), alpha=[0.5])
    bare = width_shares(lambda inputs: (unnamed.lower, unnamed.upper), X)
    assert "  output 1, y: 0 %" in str(bare)


def test_one_level_of_random_inputs_works():
    load = {"load": RandomInput(lambda u, m: m + u, {"m": Triangular(0, 0.5, 2)})}
    run = lambda alpha: IntervalQuasiMonteCarlo(8).run(lambda load: load, load, {}, alpha=alpha)  # noqa: E731
    one, some, both = run([0]), run([0, 0.5]), run([0, 0.5, 1])
    assert (one.lower[:, 0] == both.lower[:, 0]).all()
    assert (some.upper == both.upper[:, :2]).all()
    with pytest.raises(ValueError, match="α-levels are"):
        run([])


def test_an_error_is_told_in_plain_per_cents_and_as_unknown_from_half_the_width():
    assert [_per_cent(x) for x in (0, 1e-4, 0.12, 1.0)] == ["0 %", "0.01 %", "10 %", "100 %"]
    wild = lambda a, b, c, d: np.sin(40 * a) * np.cos(50 * b) * np.sin(60 * c * d)  # noqa: E731
    inputs = {name: Interval(0, 3) for name in "abcd"}
    found = propagate(wild, inputs, Automatic(budget=60), alpha=[0])
    assert found.error[0, 0] > 0.5 * np.ptp([found.lower[0, 0], found.upper[0, 0]])
    assert "as wide as the answer itself: take it as unknown; BranchAndBound" in str(found)


def test_trial_boxes_beyond_the_domain_of_the_function_warn_of_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        root = lambda q, a: q * np.sqrt(a)  # noqa: E731
        found = safe_scale(root, {"q": 8, "a": 2}, {"q": 1, "a": 0.5}, {"y": 13.5}, tolerance=0.01)
    assert 0 < found.safe < found.unsafe


def test_shares_and_gains_say_what_their_bounds_are_worth():
    humped = lambda x, y: x * (2 - x) + 0.1 * x * y  # noqa: E731
    inputs = {"x": Triangular(0, 0.9, 2), "y": Interval(0, 1)}
    shares = width_shares(lambda i: propagate(humped, i, Reduced(), alpha=[0]), inputs)
    gains = measure_next(humped, inputs, Reduced())
    for text in (str(shares), shares._repr_html_(), str(gains), gains._repr_html_()):
        assert "by inner bounds of the plan reduced, whose error is not estimated" in text
    assert "a negative share, -" in str(gains)
    assert "2 % of each width is assumed as its error" in str(gains)
    assert "wrong by that much at least" in str(gains)
    proved = measure_next(product, X, BranchAndBound(product))
    assert "by guaranteed bounds of the plan branch and bound" in str(proved)
    assert "negative" not in str(proved)
    assert "assumed" not in str(proved)


def test_a_proof_that_ended_at_its_budget_says_its_gap():
    bent = lambda x, y: np.sin(3 * x * y) * x + np.cos(5 * x) * y  # noqa: E731
    found = str(propagate(bent, X, BranchAndBound(bent, 1e-6, 20), alpha=[0]))
    gap = r"at its budget of 20 boxes: the gap is [\d.]+ % instead of 0.0001 % of"
    assert re.search(gap, found)
    assert "budget" not in str(propagate(bent, X, BranchAndBound(bent, 1e-2), alpha=[0]))
