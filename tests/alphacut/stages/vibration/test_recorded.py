"""A run whose inputs are learned from a recorded motion, made by SciPy's matrix exponential."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from alphacut.entry import main
from alphacut.stages.vibration.modes_csv import motion_rows

CASE = """
schema = 1
title = "Two floors"
about = "A frame whose motion was recorded"
stages = ["envelope"]
[frame]
masses = ["2 t", "1.5 t"]
lengths = ["3 m"]
modulus = "25 GPa"
second_moment = "1e-5 m^4"
columns = ["[1.6, 2.4]", "[1.6, 2.4]"]
rayleigh_mass = "0.2 1/s"
displacements = ["10 mm", "20 mm"]
velocities = ["0 m/s"]
outputs = ["q2"]
[update]
recorded = "motion.csv"
learn = ["c"]
alpha = [0.05, 0.5]
[envelope]
fuzzy = ["c"]
alpha = [0.05, 1]
method = "quasi-monte-carlo"
integrator = "exact"
duration = "1 s"
step = "0.05 s"
"""
TRUTH = np.array([1.8, 2.25])


def recorded(rng: np.random.Generator, noise: float) -> str:
    """Displacements of both floors in mm, with errors."""
    stiff = 12 * TRUTH * 2.5e10 * 1e-5 / 27
    M, K = np.diag([2e3, 1.5e3]), np.array([[stiff.sum(), -stiff[1]], [-stiff[1], stiff[1]]])
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-np.linalg.solve(M, K), -0.2 * np.eye(2)]])
    start, lines = np.array([10.0, 20.0, 0.0, 0.0]), ["time [s],q1 [mm],q2 [mm]"]
    for k in range(60):
        one, two = (expm(0.02 * k * A) @ start)[:2] + noise * rng.standard_normal(2)
        lines.append(f"{0.02 * k:.2f},{one:.6f},{two:.6f}")
    return "\n".join([*lines, ""])


def written(folder: Path, text: str, case: str = CASE) -> Path:
    (folder / "motion.csv").write_text(text, encoding="utf-8")
    path = folder / "two.toml"
    path.write_text(case, encoding="utf-8")
    return path


def test_a_recorded_motion_teaches_both_storeys(tmp_path: Path) -> None:
    path, out = written(tmp_path, recorded(np.random.default_rng(7), 0.05)), tmp_path / "out"
    assert main(["run", str(path), "--out", str(out), "--quiet"]) == 0
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))["update"]
    for name, truth in zip(("c1", "c2"), TRUTH, strict=True):
        ends = found["inputs"][name]
        assert ends["lower"][0] <= truth <= ends["upper"][0]
        assert found["narrowed"][name] < 0.1
        assert found["prior"][name] == [1.6, 2.4]
    assert found["envelope_width"]["q2"] < 0.2
    assert found["not_learned"] == []
    assert "normal errors" in found["claim"]
    assert main(["report", str(out), "--quiet"]) == 0
    page = (out / "report.html").read_text(encoding="utf-8")
    assert "Envelope of q2 before and after the measurement" in page
    assert "Learned from a recorded motion" in page
    assert "Inputs before and after the measurement, level by level" in page
    assert not re.search("measured modes|modes were measured", page)


def test_noise_as_large_as_the_motion_teaches_little(tmp_path: Path) -> None:
    path = written(tmp_path, recorded(np.random.default_rng(8), 300.0))
    told = tmp_path / "told.json"
    assert main(["update", str(path), "--json", str(told), "--quiet"]) == 0
    assert json.loads(told.read_text(encoding="utf-8"))["not_learned"]


GOOD = "time [s],q1 [mm]\n0,10\n0.02,9\n0.04,8\n0.06,7\n"


@pytest.mark.parametrize(
    ("text", "old", "new", "pattern"),
    [
        ("time [s],q1\n0,1\n0.1,2\n", "", "", "the column 'q1' is not q1 with its unit"),
        ("time [s],q9 [mm]\n0,1\n0.1,2\n", "", "", "the header is wrong"),
        (GOOD.replace("q1 [mm]", "q1 [mm],a2 [m/s^2]"), "", "", "outputs have different units"),
        ("time [s],q1 [kN]\n0,1\n0.1,2\n", "", "", "update.recorded"),
        ("time [s],q1 [mm]\n0,1\n0.1,2;5\n", "", "", "this row is no instant"),
        ("time [s],q1 [mm]\n0,1\n0.1,2\n0.3,2\n", "", "", "not evenly spaced"),
        ("time [s],q1 [mm]\n5,1\n5.1,2\n5.2,2\n", "", "", "0 s; subtract the first time from all"),
        ("time [s],q1 [mm]\n0,1\n0.1,2\n", "", "", "parameters need more"),
        (GOOD, 'recorded = "motion.csv"', 'recorded = "none.csv"', "there is no such file"),
        (GOOD, 'recorded = "motion.csv"\n', "", "learned from one file"),
        (GOOD, "alpha = [0.05, 0.5]", "held_out = [1]", "this is of measured modes"),
    ],
)
def test_recorded_motions_that_make_no_sense(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    text: str,
    old: str,
    new: str,
    pattern: str,
) -> None:
    path, out = written(tmp_path, text, CASE.replace(old, new, 1)), tmp_path / "out"
    assert main(["update", str(path), "--out", str(out)]) == 2
    told = capsys.readouterr().err.strip()
    assert pattern in told
    assert len(told.splitlines()) == 1
    assert not out.exists()


def test_recorded_outputs_whose_errors_differ_are_refused_and_sets_are_no_proof(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = recorded(np.random.default_rng(7), 0.05)
    alike = written(tmp_path, rows)
    assert main(["update", str(alike)]) == 0
    assert "inputs at α = 0.05, searched, not proved:" in capsys.readouterr().out
    head, *lines = rows.splitlines()
    finer = [line.rpartition(",") for line in recorded(np.random.default_rng(8), 1e-4).splitlines()]
    mixed = [
        f"{line.rpartition(',')[0]},{fine[2]}" for line, fine in zip(lines, finer[1:], strict=True)
    ]
    assert main(["update", str(written(tmp_path, "\n".join([head, *mixed, ""])))]) == 2
    assert "the recorded outputs' errors are not alike: deviations" in capsys.readouterr().err


def test_rounding_alone_is_no_error_of_the_outputs(tmp_path: Path) -> None:
    head, *lines = recorded(np.random.default_rng(7), 0.0).splitlines()
    rows = [line.split(",") for line in lines]
    digits = [f"{t},{float(one):.3g},{float(two):.3g}" for t, one, two in rows]
    assert main(["update", str(written(tmp_path, "\n".join([head, *digits, ""])))]) == 0


def test_a_recorded_motion_may_have_rounded_times(tmp_path: Path) -> None:
    file = tmp_path / "motion.csv"
    rows = "".join(f"{k / 128:.3f},{k % 5}\n" for k in range(300))
    file.write_text(f"time [s],q1 [mm]\n{rows}", encoding="utf-8")
    found = motion_rows(file, ("q1",))
    assert found.step == pytest.approx(1 / 128, rel=1e-3)
    assert found.values[:6, 0] == pytest.approx([0, 1e-3, 2e-3, 3e-3, 4e-3, 0])
