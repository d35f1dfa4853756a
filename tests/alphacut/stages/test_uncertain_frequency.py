"""A machine on a foundation whose frequency lies in a range, from the case to the terminal."""

from math import sqrt

import pytest

from alphacut import main
from alphacut.frame.analyses.peaks import Peak
from alphacut.io.typed_json import from_document
from tests.alphacut.small import refusals, summary_of

CASE = """
title = "machine foundation"
stages = ["envelope"]
shares = false
[frame]
masses = ["20 t"]
stiffness = ["80 MN/m ± 10 %"]
damping_ratio = "5 %"
outputs = ["q1", "v1"]
[[force]]
history = "harmonic, [9, 11] Hz"
amplitude = { 1 = "5 kN" }
[envelope]
fuzzy = ["k1"]
alpha = [0]
duration = "3 s"
step = "0.002 s"
[decision]
limits = ["q1 <= 1 mm"]
"""


def written(folder, text=CASE):
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_peak_is_that_of_resonance_and_no_figure_is_over_time(tmp_path, capsys):
    case, out = written(tmp_path), tmp_path / "out"
    assert main(["run", str(case), "--out", str(out)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "over as many periods of the force as its nominal frequency has" in shown
    assert "|q1| ≤ 1 mm: not exceeded (guaranteed)" in shown
    study = summary_of(out)["envelopes"]["all"]
    assert study["fuzzy"] == ["k1", "frequency"]
    peak = from_document(Peak, study["peak"]["q1"])
    # F / (2 ζ k √(1 − ζ²)) at the smallest k, whose resonance at 9.55 Hz lies in the range. The
    # response from rest comes near it within 30 periods, to exp(−60 π ζ).
    right = 5e3 / (2 * 0.05 * 72e6 * sqrt(1 - 0.05**2))
    assert right == pytest.approx(0.6953e-3, rel=1e-4)
    assert right * 0.995 < peak.reached[0] < right * 1.001 < peak.upper[0] < right * 1.01
    assert not [path.name for path in (out / "figures").glob("envelope*")]
    assert main(["report", str(out), "--csv", str(tmp_path / "csv")]) == 0
    assert sorted(path.stem for path in (tmp_path / "csv").iterdir()) == ["decision", "peaks"]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[9, 11]", "[0, 11]", "frequencies are above 0 Hz"),
        ("[9, 11] Hz", "[9, 11] m", "force[1].history is harmonic, [9, 11] m; allowed"),
        ('"q1", "v1"', '"a1"', "force.history is of a fuzzy frequency"),
        (
            "[envelope]",
            '[[force]]\nhistory = "step"\namplitude = { 1 = "1 kN" }\n[envelope]',
            "only",
        ),
    ],
)
def test_what_has_no_range_of_frequencies_is_one_line(tmp_path, old, new, message):
    assert old in CASE
    lines = refusals(written(tmp_path, CASE.replace(old, new)))
    assert len(lines) == 1
    assert message in lines[0], lines
