"""The engineer's desk, cases shortened: a suite, wind on floors, matrices with a member's moment."""

import csv
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from alphacut import main
from tests.alphacut.small import summary_of

ROOT = Path(__file__).parents[2]
FEW = "records.files=['suite/record-200[1-2].AT2']"
BOUNDS = ("envelope.alpha=[0]", "shares=false")
QUICK = {
    "suite": (*BOUNDS, FEW, "envelope.duration='6 s'", "envelope.step='0.02 s'"),
    "wind": (*BOUNDS, "envelope.duration='8 s'", "envelope.fuzzy=['E', 'F4']"),
    "plane-frame": (
        *BOUNDS,
        "envelope.fuzzy=['Ec', 'ks']",
        "envelope.duration='2 s'",
        FEW.replace("[1-2]", "1"),
    ),
    "eccentric-frame": (
        *BOUNDS,
        "records.files=[['eccentric-frame/1_x.AT2', 'eccentric-frame/1_y.AT2']]",
        "envelope.fuzzy=['core']",
        "envelope.duration='4 s'",
    ),
}
GOLDEN = {
    "suite": (6.5604, 10.3512),  # median of the lognormal fit of Sa(T1) in m/s² at α = 0
    "wind": {"drift1": 4.3510e-3, "a4": 0.41193, "base_shear": 126.26e3},
    "plane-frame": 7.4881e-3,
    "eccentric-frame": 15.62e-3,
}


def quick(case, shipped_run):
    """The summary of a case, made quick."""
    return summary_of(shipped_run(case, QUICK[case]))


def test_a_suite_has_its_golden_fragility(shipped_run):
    answer = quick("suite", shipped_run)["fragility"]
    limit = answer["limits"]["drift1"]
    assert limit["nature"] == "guaranteed"
    low, reached, inner, high = (
        np.array(limit["critical"][x]) for x in ("low", "low_reached", "high_reached", "high")
    )
    assert (low <= reached + 1e-12).all()
    assert (inner <= high).all()
    fitted = limit["lognormal_median"]
    assert fitted["lower"][0] == pytest.approx(GOLDEN["suite"][0], rel=0.02)
    assert fitted["upper"][0] == pytest.approx(GOLDEN["suite"][1], rel=0.05)
    assert limit["median"]["lower"] == pytest.approx(np.median(low, axis=1))
    assert limit["median"]["upper"] == pytest.approx(np.median(high, axis=1))


def test_wind_has_its_golden_peaks(shipped_run):
    study = quick("wind", shipped_run)["envelopes"]["all"]
    peaks = study["peak"]
    for name, value in GOLDEN["wind"].items():
        assert peaks[name]["nature"] == "guaranteed"
        assert peaks[name]["reached"][0] <= peaks[name]["upper"][0]
        assert peaks[name]["upper"][0] == pytest.approx(value, rel=0.03)
    assert study["motions_tested"] > 0


def test_a_frame_from_matrices_answers_all_questions(shipped_run):
    summary = quick("plane-frame", shipped_run)
    limits = summary["decision"]["limits"]
    assert {limits[name]["nature"] for name in ("roof", "moment")} == {"guaranteed"}
    assert limits["moment"]["unit"] == "N*m"
    assert limits["roof"]["peak"]["proved"][0] == pytest.approx(GOLDEN["plane-frame"], rel=0.03)
    assert set(summary["fragility"]["limits"]) == {"roof"}


def test_a_frame_in_plan_has_its_golden_drift_over_all_angles(shipped_run):
    summary = quick("eccentric-frame", shipped_run)
    limit = summary["decision"]["limits"]["corner_y"]
    assert limit["nature"] == "guaranteed"
    assert limit["peak"]["proved"][0] == pytest.approx(GOLDEN["eccentric-frame"], rel=0.02)
    assert 0.98 * limit["peak"]["proved"][0] <= limit["peak"]["reached"][0]
    assert limit["record"] == f"1_x+1_y, {limit['peak']['worst']['angle']:.1f}°"
    assert summary["fragility"]["measure"] == "RotD50(T1)"


def is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def test_columns_of_csv_are_numbers_or_texts_and_name_units_of_the_case(shipped_run, tmp_path):
    out = ["--csv", str(tmp_path), "--out", str(tmp_path / "page.html")]
    folder = shipped_run("plane-frame", QUICK["plane-frame"])
    assert main(["report", str(folder), "--quiet", *out]) == 0
    tables = {x.stem: [*csv.reader(x.open(encoding="utf-8"))] for x in tmp_path.glob("*.csv")}
    assert {"decision", "fragility", "records"} <= set(tables)
    for name, (head, *rows) in tables.items():
        for title, column in zip(head, zip(*rows, strict=True), strict=True):
            kinds = {is_number(text) for text in column if text}
            assert len(kinds) <= 1, (name, title)
    head, *rows = tables["records"]
    units = {(row[head.index("output")], row[head.index("unit")]) for row in rows}
    assert units == {("roof", "m"), ("moment", "N*m")}


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("mpirun") is None, reason="there is no mpirun")
def test_three_ranks_give_the_bits_of_one_process(shipped_run, tmp_path):
    ranks = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", "3"]
    version = subprocess.run(["mpirun", "--version"], capture_output=True, text=True).stdout
    ranks = ranks if "Open MPI" in version else ["mpirun", "-n", "3"]
    words = ["-m", "mpi4py.futures", "-m", "alphacut", "run", "cases/suite.toml", "--no-figures"]
    sets = [f"--set={change}" for change in QUICK["suite"]]
    command = [*ranks, sys.executable, *words, f"--out={tmp_path / 'out'}", *sets]
    env = os.environ | {"OMP_NUM_THREADS": "1"}
    made = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, env=env)
    assert made.returncode == 0, made.stderr
    summary = summary_of(tmp_path / "out")
    expected = quick("suite", shipped_run)
    assert summary["records"]["by_record"] == expected["records"]["by_record"]
    assert summary["fragility"] == expected["fragility"]
