"""Floor spectra of a case: its answer, figure and table, and what is refused."""

import numpy as np
import pandas as pd
import pytest

from alphacut import main
from alphacut.case.content import load
from alphacut.figures.answers import draw_floor_spectrum
from alphacut.figures.style import figure_style
from alphacut.frame import FloorSpectrum, floor_spectrum
from alphacut.frame.structures.linear import frequencies
from alphacut.io.typed_json import from_document
from alphacut.stages.suite import suite_records
from tests.alphacut.small import refusals, summary_of

CASE = """
title = "A floor under a record"
stages = ["envelope"]
shares = false
[frame]
stiffness = ["8 MN/m ± 4 %"]
masses = ["20 t"]
damping_ratio = "5 %"
accelerogram = "record.csv"
[envelope]
fuzzy = ["k1"]
alpha = [0, 1]
duration = "1.5 s"
step = "0.02 s"
[floor_spectrum]
outputs = "a1"
periods = ["0 s", "0.3 s"]
"""


RECORD = 'accelerogram = "record.csv"\n'


def written(folder, text=CASE):
    for seed, name in enumerate(("record", "other")):
        samples = np.random.default_rng(5 + seed).normal(size=40)
        rows = "".join(f"{0.02 * k:.2f},{x:.6f}\n" for k, x in enumerate(samples))
        (folder / f"{name}.csv").write_text(f"time [s],acceleration [m/s^2]\n{rows}")
    path = folder / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


def run(folder, text):
    """The answer to a case that is run, its content, and the lines and title of its figure."""
    case, out = written(folder, text), folder / "out"
    assert main(["run", str(case), "--out", str(out)]) == 0
    found = from_document(FloorSpectrum, summary_of(out)["floor_spectrum"])
    with figure_style():
        (axes,) = draw_floor_spectrum(found).axes
    lines = {line.get_label(): line.get_ydata() * 9.80665 for line in axes.lines}
    return found, load(case).content, lines, axes.get_title(loc="left")


def by_function(content, damping=0.05, **motion):
    structure = content.structure
    options = {"duration": 1.5, "step": 0.02, "alpha": [0, 1], "progress": False} | motion
    inputs = structure.inputs(["k1"])
    return floor_spectrum(structure.model, inputs, "a1", [0.0, 0.3], damping, **options)


def test_a_case_has_the_answer_of_the_function_with_its_figure_and_table(tmp_path, capsys):
    """Each damping ratio has the answer that it has alone, and they share a figure."""
    found, content, lines, _ = run(tmp_path, CASE + 'damping = ["2 %", "5 %"]\n')
    shown = capsys.readouterr().out
    assert (found.outputs, found.damping) == (("a1", "a1"), (0.02, 0.05))
    for k, ratio in enumerate(found.damping):
        alone = by_function(content, ratio)
        for name in ("bound", "attained", "nominal"):
            values = getattr(found, name)[..., k, :]
            assert values == pytest.approx(getattr(alone, name)[..., 0, :], rel=1e-9)
        assert found.natures[k] == alone.natures[0] == ("guaranteed", "guaranteed")
        assert lines[f"bound, α = 0, ζ = {ratio}"] == pytest.approx(found.bound[0, k])
        for period in ("0 s", "0.3 s"):
            assert f"floor_spectrum: a1, T = {period}, ζ = {ratio}: ≤" in shown
    out = tmp_path / "out"
    assert (out / "figures/floor_spectrum.png").exists()
    assert main(["report", str(out), "--csv", str(tmp_path / "csv")]) == 0
    rows = pd.read_csv(tmp_path / "csv/floor_spectrum.csv")
    assert rows["period [s]"].tolist() == [0.0, 0.3] * 4
    assert (rows["attained [m/s^2]"] <= rows["bound [m/s^2]"]).all()


def test_a_suite_of_records_has_mean_spectra(tmp_path, capsys):
    text = CASE.replace(RECORD, '[records]\nfiles = ["record.csv", "other.csv"]\n')
    found, content, lines, title = run(tmp_path, text)
    assert "floor_spectrum: a1, T = 0.3 s: ≤" in capsys.readouterr().out
    assert found.suite == ("record", "other")
    records = suite_records(content.records, content.envelope, content.structure)
    durations, grounds = [x.duration for x in records], [x.components for x in records]
    expected = by_function(content, records=grounds, duration=max(durations))
    assert found.bound == pytest.approx(expected.bound, rel=1e-9)
    assert lines["bound, α = 0"] == pytest.approx(found.bound[0, 0])
    assert lines["nominal"] == pytest.approx(found.nominal[0])
    assert title.endswith("of the mean over 2 records")


def test_periods_are_given_by_their_range(tmp_path):
    text = CASE.replace('periods = ["0 s", "0.3 s"]', 'shortest = "0.1 s"\ncount = 3')
    content = load(written(tmp_path, text)).content
    own = 2 * np.pi / frequencies(content.structure.linear)
    own = own[(own >= 0.1) & (own <= 2.0)]
    assert len(own) > 0
    question = content.floor_spectrum.question(content.structure)
    found = question.periods_of(content.structure.model)
    assert found == pytest.approx(sorted([0, 0.1, 0.2**0.5, 2, *own]))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"a1"', '"q1"', "floor_spectrum: output is q1; allowed: absolute accelerations, as a3"),
        ('"a1"', '"a2"', "floor_spectrum: output is a2; allowed:"),
        ('"0.3 s"]', '"0.3 s"]\ncount = 3', "floor_spectrum.periods is beside count; allowed"),
        ('"0.3 s"]', '"0 s"]', "floor_spectrum.periods is 0, 0; allowed: each once"),
        ('"0.3 s"]', '"0.1 ms"]', "floor_spectrum.periods is 0.0001 s; allowed: 0 s, and"),
        ('periods = ["0 s", "0.3 s"]', 'longest = "10 ms"', "floor_spectrum.longest is 0.01 s"),
        ('periods = ["0 s", "0.3 s"]', 'damping = "120 %"', "floor_spectrum.damping[1] is 120 %"),
        (
            'periods = ["0',
            'damping = [0.05, 0.05]\nperiods = ["0',
            "floor_spectrum.damping is 0.05,",
        ),
        ('"5 %"', '"5 %"\ndisplacements = "1 mm"', "floor_spectrum: structure is displaced"),
        ('"5 %"', '"5 %"\nyield_force = "30 kN"', "floor_spectrum: structure is StoreyFrame"),
        (RECORD, '[records]\nfiles = "record.csv"\n', "floor_spectrum: output is q1; allowed:"),
    ],
)
def test_what_has_no_floor_spectrum_is_one_line(tmp_path, old, new, message):
    assert old in CASE
    text = CASE.replace(old, new)
    if "[records]" in text:  # which stand in place of the accelerogram
        text = text.replace('"a1"', '"q1"')
    lines = refusals(written(tmp_path, text))
    assert any(message in line for line in lines), lines
