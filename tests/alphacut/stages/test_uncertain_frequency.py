"""A machine on a foundation whose frequency lies in a range, from the case to the terminal."""

from math import sqrt

from alphacut.frame.analyses.peaks import Peak
from alphacut.io.typed_json import from_document
from tests.alphacut.small import summary_of, table_of, told_by, written

CASE = table_of("machine")["case"]


def test_the_peak_is_that_of_resonance_and_no_figure_is_over_time(tmp_path):
    case, out = written(tmp_path, CASE), tmp_path / "out"
    shown = " ".join(told_by("run", case, "--out", out).split())
    assert "over as many periods of the force as its nominal frequency has" in shown
    assert "|q1| ≤ 1 mm: not exceeded (guaranteed)" in shown
    study = summary_of(out)["envelopes"]["all"]
    assert study["fuzzy"] == ["k1", "frequency"]
    peak = from_document(Peak, study["peak"]["q1"])
    # F / (2 ζ k √(1 − ζ²)) at the smallest k, whose resonance at 9.55 Hz lies in the range. The
    # response from rest comes near it within 30 periods, to exp(−60 π ζ).
    right = 5e3 / (2 * 0.05 * 72e6 * sqrt(1 - 0.05**2))
    assert right * 0.995 < peak.reached[0] < right * 1.001 < peak.upper[0] < right * 1.01
    assert not [path.name for path in (out / "figures").glob("envelope*")]
    told_by("report", out, "--csv", tmp_path / "csv")
    assert sorted(path.stem for path in (tmp_path / "csv").iterdir()) == ["decision", "peaks"]
