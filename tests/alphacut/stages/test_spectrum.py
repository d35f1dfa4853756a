"""Stage response_spectrum: combined peaks, verdicts and errors of a case."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from alphacut import main
from alphacut.case.content import load
from alphacut.frame import (
    Limit,
    eurocode8_spectrum,
    spectrum_checks,
    spectrum_response,
)
from tests.alphacut.small import refusals, summary_of, summary_of_run, written

ROOT = Path(__file__).parents[3]
CASE = """
title = "Three storeys under a design spectrum"
stages = ["response_spectrum"]
[frame]
masses = ["50 t", "50 t", "[45, 50, 60] t"]
lengths = ["3.5 m", "3 m", "3 m"]
stiffness = ["90 MN/m ± 10 %", "80 MN/m", "70 MN/m"]
damping_ratio = "5 %"
outputs = ["drift1", "shear1", "a3"]
[response_spectrum]
ground_acceleration = "0.25 g"
ground_type = "C"
q = 3.9
fuzzy = ["k1", "m3"]
alpha = [0, 1]
limits = ["drift <= 0.5 %", "base_shear <= 300 kN"]
base_shear_floor = "250 kN"
theta = 0.1
"""
RECORDS = """
[records]
files = ["*.AT2"]
baseline = "mean"
[envelope]
fuzzy = ["k1"]
alpha = [0]
duration = "2 s"
step = "0.02 s"
"""


def test_a_case_has_the_peaks_and_verdicts_of_the_python_interface(tmp_path):
    case = written(tmp_path, CASE)
    folder = tmp_path / "out"
    assert main(["run", str(case), "--quiet", "--out", str(folder)]) == 0
    summary = summary_of(folder)
    structure = load(case).content.structure
    frame = structure.model.with_outputs(("drift1", "shear1", "drift2", "drift3", "base_shear"))
    inputs = structure.inputs(["k1", "m3"])
    design = eurocode8_spectrum(0.25 * 9.80665, "C", q=3.9)
    found = spectrum_response(frame, inputs, design, alpha=[0.0, 1.0])
    peaks = summary["response_spectrum"]
    assert peaks["outputs"] == list(found.outputs)
    assert np.array(peaks["proved"]) == pytest.approx(found.proved)
    limits = summary["spectrum_checks"]["limits"]
    checks = spectrum_checks(
        found, [Limit("drift1", 0.0175)], displacement_factor=3.9, base_shear_floor=250e3
    )
    assert limits["drift1"]["peak"]["upper"] == pytest.approx(checks.limits["drift1"].peak.upper)
    assert limits["theta1"]["limit"] == 0.1
    assert limits["min base_shear"]["verdict"] == "can be exceeded"
    for name in ("response_spectrum", "spectrum_checks"):
        assert (folder / f"figures/{name}.svg").is_file()
    assert main(["report", str(folder), "--quiet"]) == 0
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "as at k1 = " in page
    assert "kN" in page
    assert "12.9.1.4.1" in page


def test_beside_records_the_method_tells_its_errors(tmp_path):
    for name in ("record-2001.AT2", "record-2005.AT2"):
        shutil.copy(ROOT / "cases/suite" / name, tmp_path)
    summary = summary_of_run(written(tmp_path, CASE + RECORDS))
    errors = summary["spectrum_accuracy"]
    assert errors["names"] == ["record-2001", "record-2005"]
    assert errors["nature"] == "guaranteed"
    assert np.abs(np.array(errors["combined"]) / np.array(errors["peaks"])[..., 0] - 1).max() < 0.5


VALUES = f"values = {['0.3 g'] * 22}"


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({'ground_type = "C"': 'ground_type = "F"'}, "response_spectrum.ground_type is F"),
        ({'ground_type = "C"': ""}, "response_spectrum.ground_type is empty"),
        ({'ground_acceleration = "0.25 g"\nground_type = "C"\n': ""}, "ground_acceleration is missing"),
        ({'fuzzy = ["k1", "m3"]': 'fuzzy = ["k2"]'}, "response_spectrum.fuzzy"),
        ({'"base_shear <= 300 kN"': '"max base_shear <= 300 kN"'}, "response_spectrum.limits"),
        ({'"base_shear <= 300 kN"': '"a1 <= 1 g"'}, "response_spectrum: output is a1"),
        ({'ground_acceleration = "0.25 g"': VALUES, "q = 3.9": ""}, "ground_type is C; allowed: be"),
        ({'lengths = ["3.5 m", "3 m", "3 m"]\n': "", '"drift <= 0.5 %", ': ""}, "theta"),
        ({'stages = ["response_spectrum"]': 'stages = ["envelope"]'}, "envelope"),
        ({'q = 3.9': 'q = 0.5'}, "response_spectrum.q"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_refused_by_its_key(changes, word, tmp_path):
    case = written(tmp_path, CASE)
    text = case.read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    case.write_text(text, encoding="utf-8")
    (line, *_) = refusals(case)
    assert word in line
