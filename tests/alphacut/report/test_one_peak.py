"""The peak of an output is one number: in table, CSV, decision, tolerances and page."""

import csv
import json

import numpy as np
import pytest

from alphacut.frame.questions.peaks import Peak, tightest
from alphacut.fuzzy.result import Nature
from alphacut.io.quantity import axis_prefix, range_text
from alphacut.io.results import ResultsFolder
from alphacut.questions.summary import Summary
from alphacut.report.page import render_page
from alphacut.report.tables import write_tables


@pytest.fixture(scope="module")
def told(results, tmp_path_factory):
    """Summary, rows of the table of peaks, and page of a frame with questions on two limits."""
    summary = json.loads((results / "summary.json").read_text(encoding="utf-8"))
    opened, folder = ResultsFolder.read(results), tmp_path_factory.mktemp("csv")
    write_tables(Summary.read(opened), opened, folder)
    with (folder / "peaks.csv").open(encoding="utf-8") as file:
        return summary, list(csv.DictReader(file)), render_page(opened)


def test_one_peak_has_one_value_in_every_place(told):
    summary, rows, page = told
    study = summary["envelopes"]["all"]
    assert set(summary["decision"]["limits"]) >= {"drift1", "q2"} == set(study["peak"])
    for output, one in summary["decision"]["limits"].items():
        if output not in study["peak"]:
            continue
        peak = study["peak"][output]
        assert {key: one["peak"][key] for key in ("lower", "upper", "error", "reached")} == {
            key: peak[key] for key in ("lower", "upper", "error", "reached")
        }
        assert peak["nature"] == one["nature"]
        proved = np.array(peak["upper"]) + np.array(peak["error"])
        assert one["limit"] - np.array(one["margin"]["lower"]) == pytest.approx(proved, rel=1e-12)
        here = [row for row in rows if row["output"] == output]
        nature = Nature(peak["nature"])
        for level, row in enumerate(here):
            assert float(row["greatest peak"]) == peak["upper"][level]
            gap = 1 - peak["reached"][level] / peak["upper"][level]
            assert float(row["gap, share"]) == pytest.approx(gap)
        factor, _ = axis_prefix(peak["upper"][0], "m")
        shown = range_text(factor * peak["lower"][0], factor * peak["upper"][0], nature)
        assert shown in page
    at_one = summary["tolerances"]["peaks"]["q2"]
    assert at_one["upper"] == study["peak"]["q2"]["upper"]
    assert at_one["reached"] == study["peak"]["q2"]["reached"]
    # no motion passes the limit within the supports as they are, so more than these are kept
    assert at_one["upper"][0] + at_one["error"][0] <= 0.28
    assert summary["tolerances"]["kept"] >= 1


def peaks_of(lower, upper, reached, nature, error=0.0, outputs=("q1",)):
    ends = [np.array([x]) for x in (lower, upper, error, reached, 0.0, np.inf)]
    return dict.fromkeys(outputs, Peak(np.zeros(1), *ends, nature))


@pytest.mark.parametrize("order", [1, -1])
def test_the_tighter_proved_and_the_larger_reached_value_is_taken(order):
    first = peaks_of(1.0, 3.0, 2.0, Nature.GUARANTEED)
    second = peaks_of(0.5, 2.5, 2.2, Nature.GUARANTEED, outputs=("q1", "q2"))
    both = tightest(*(first, second)[::order])
    assert set(both) == {"q1", "q2"}
    peak = both["q1"]
    assert (peak.lower[0], peak.upper[0], peak.reached[0]) == (1.0, 2.5, 2.2)
    weaker = peaks_of(1.5, 2.1, 2.4, Nature.ATTAINED)
    mixed = tightest(*(first, weaker)[::order])["q1"]
    assert (mixed.lower[0], mixed.upper[0], mixed.reached[0]) == (1.0, 3.0, 2.4)
    assert mixed.nature is Nature.GUARANTEED
