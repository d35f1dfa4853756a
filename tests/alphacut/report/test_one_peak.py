"""The peak of an output is one number: in table, CSV, decision, tolerances and page."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from alphacut.entry import main
from alphacut.frame.questions.peaks import Peaks, tightest
from alphacut.fuzzy.result import Nature, rounded
from alphacut.io.quantity import axis_prefix, between

LIMITS = """
[decision]
limits = ["drift1 <= 30 mm", "q2 <= 60 mm"]
[tolerances]
limits = ["drift1 <= 26 mm"]
"""
SHORTER = ("duration=2 s", "step=0.02 s", "alpha=[0, 0.5, 1]")


@pytest.fixture(scope="module")
def building(tmp_path_factory):
    """Results of the shipped building, shortened, with questions on two limits, and its tables."""
    folder = tmp_path_factory.mktemp("building")
    text = Path("cases/building.toml").read_text(encoding="utf-8").partition("[probability]")[0]
    text = text.replace('"building.record.csv"', '"record.csv"') + LIMITS
    record = Path("cases/building.record.csv").read_text(encoding="utf-8")
    (folder / "record.csv").write_text(record, encoding="utf-8")
    (folder / "case.toml").write_text(text, encoding="utf-8")
    changes = [f"--set=envelope.{change}" for change in SHORTER]
    out = folder / "out"
    words = ["run", str(folder / "case.toml"), "--out", str(out), "--quiet", "--no-figures"]
    assert main([*words, *changes]) == 0
    assert main(["report", str(out), "--csv", str(folder / "csv"), "--quiet"]) == 0
    with (folder / "csv" / "peaks.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    page = (out / "report.html").read_text(encoding="utf-8")
    return json.loads((out / "summary.json").read_text(encoding="utf-8")), rows, page


def test_one_peak_has_one_value_in_every_place(building):
    summary, rows, page = building
    study = summary["envelopes"]["all"]
    assert {"drift1", "q2", "q8"} <= set(study["peak"])
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
            upper = rounded(peak["upper"][level], "upper", nature, 6)
            assert float(row["greatest peak"]) == pytest.approx(upper, rel=1e-9)
            gap = 1 - peak["reached"][level] / peak["upper"][level]
            assert float(row["gap, share"]) == pytest.approx(gap, rel=0.06)
        factor, _ = axis_prefix(peak["upper"][0], "m")
        shown = between(factor * peak["lower"][0], factor * peak["upper"][0], nature)
        assert shown in page
    at_one = summary["tolerances"]["peaks"]["drift1"]
    assert at_one["upper"] == study["peak"]["drift1"]["upper"]
    assert at_one["reached"] == study["peak"]["drift1"]["reached"]


def test_tolerances_agree_with_the_peak_at_scale_one(building):
    summary, _, _ = building
    peak, limit = summary["tolerances"]["peaks"]["drift1"], 0.026
    kept, passed = summary["tolerances"]["kept"], summary["tolerances"]["passed"]
    if peak["upper"][0] + peak["error"][0] <= limit:
        assert kept >= 1
    if peak["reached"][0] > limit:
        assert passed <= 1


def peaks_of(lower, upper, reached, nature, error=0.0, outputs=("q1",)):
    ends = [np.full((1, len(outputs)), x) for x in (lower, upper, error, reached, 0.0, np.inf)]
    return Peaks(np.zeros(1), outputs, *ends, (nature,) * len(outputs))


@pytest.mark.parametrize("order", [1, -1])
def test_the_tighter_proved_and_the_larger_reached_value_is_taken(order):
    first = peaks_of(1.0, 3.0, 2.0, Nature.GUARANTEED)
    second = peaks_of(0.5, 2.5, 2.2, Nature.GUARANTEED, outputs=("q1", "q2"))
    both = tightest(*(first, second)[::order])
    assert set(both.outputs) == {"q1", "q2"}
    k = both.outputs.index("q1")
    assert (both.lower[0, k], both.upper[0, k], both.reached[0, k]) == (1.0, 2.5, 2.2)
    weaker = peaks_of(1.5, 2.1, 2.4, Nature.ATTAINED)
    mixed = tightest(*(first, weaker)[::order])
    assert (mixed.lower[0, 0], mixed.upper[0, 0], mixed.reached[0, 0]) == (1.0, 3.0, 2.4)
    assert mixed.natures == (Nature.GUARANTEED,)
