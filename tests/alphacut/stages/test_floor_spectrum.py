"""Floor spectra of a case: its answer, figure and table, and what is refused."""

import numpy as np
import pandas as pd
import pytest

from alphacut.case.content import load
from alphacut.figures.answers import draw_floor_spectrum
from alphacut.figures.style import figure_style
from alphacut.frame import FloorSpectrum, floor_spectrum
from alphacut.frame.structures.linear import frequencies
from alphacut.io.typed_json import from_document
from alphacut.stages.suite import suite_records
from tests.alphacut.case.files import prepared
from tests.alphacut.small import summary_of, told_by

PERIODS = 'periods = ["0 s", "0.3 s"]'


def run(folder, changes):
    """The answer to a case that is run, its content, lines and title of its figure, and its text."""
    case, out = prepared(folder, "floor", changes), folder / "out"
    told = told_by("run", case, "--out", out)
    found = from_document(FloorSpectrum, summary_of(out)["floor_spectrum"])
    with figure_style():
        (axes,) = draw_floor_spectrum(found).axes
    lines = {line.get_label(): line.get_ydata() * 9.80665 for line in axes.lines}
    return found, load(case).content, lines, axes.get_title(loc="left"), told


def by_function(content, damping=0.05, **motion):
    structure = content.structure
    options = {"duration": 1.5, "step": 0.02, "alpha": [0, 1], "progress": False} | motion
    inputs = structure.inputs(["k1"])
    return floor_spectrum(structure.model, inputs, "a1", [0.0, 0.3], damping, **options)


def test_a_case_has_the_answer_of_the_function_with_its_figure_and_table(tmp_path):
    """Each damping ratio has the answer that it has alone, and they share a figure."""
    found, content, lines, _, shown = run(
        tmp_path, {PERIODS: f'{PERIODS}\ndamping = ["2 %", "5 %"]'}
    )
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
    told_by("report", out, "--csv", tmp_path / "csv")
    rows = pd.read_csv(tmp_path / "csv/floor_spectrum.csv")
    assert rows["period [s]"].tolist() == [0.0, 0.3] * 4
    assert (rows["attained [m/s^2]"] <= rows["bound [m/s^2]"]).all()


def test_a_suite_of_records_has_mean_spectra(tmp_path):
    records = '[records]\nfiles = ["record.csv", "other.csv"]'
    found, content, lines, title, told = run(tmp_path, {'accelerogram = "record.csv"': records})
    assert "floor_spectrum: a1, T = 0.3 s: ≤" in told
    assert found.suite == ("record", "other")
    records = suite_records(content.records, content.envelope, content.structure)
    durations, grounds = [x.duration for x in records], [x.components for x in records]
    expected = by_function(content, records=grounds, duration=max(durations))
    assert found.bound == pytest.approx(expected.bound, rel=1e-9)
    assert lines["bound, α = 0"] == pytest.approx(found.bound[0, 0])
    assert lines["nominal"] == pytest.approx(found.nominal[0])
    assert title.endswith("of the mean over 2 records")


def test_periods_are_given_by_their_range(tmp_path):
    changes = {PERIODS: 'shortest = "0.1 s"\ncount = 3'}
    content = load(prepared(tmp_path, "floor", changes)).content
    own = 2 * np.pi / frequencies(content.structure.linear)
    own = own[(own >= 0.1) & (own <= 2.0)]
    assert len(own) > 0
    question = content.floor_spectrum.question(content.structure)
    found = question.periods_of(content.structure.model)
    assert found == pytest.approx(sorted([0, 0.1, 0.2**0.5, 2, *own]))
