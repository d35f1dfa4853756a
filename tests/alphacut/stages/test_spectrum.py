"""Stage response_spectrum: combined peaks, verdicts and errors of a case."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.content import load
from alphacut.frame import (
    Limit,
    eurocode8_spectrum,
    spectrum_checks,
    spectrum_response,
)
from tests.alphacut.small import summary_of, summary_of_run, table_of, told_by, written

ROOT = Path(__file__).parents[3]


CASE = table_of("spectrum")["case"]
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
    told_by("run", case, "--quiet", "--out", folder)
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
    told_by("report", folder, "--quiet")
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
