"""Scenes 7 and 8: a structure of matrices, and stiffnesses identified from measured modes."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from alphacut.frame import MatrixStructure, envelope
from alphacut.fuzzy import Triangular

ROOT = Path(__file__).parents[2]
LEARNED = {  # c1 … c4 in units of the nominal stiffness, at every level
    "c1": (1.4, 1.515187541276735),
    "c2": (1.5405008539352458, 1.9424533877448815),
    "c3": (1.8940043064380268, 2.1893854715436145),
    "c4": (2.409583756128488, 2.77784397591472),
}


def test_matrices_have_the_exact_envelope_of_their_motion():
    """Two masses on like springs that start alike move as one: q = q0 cos(√(k/m) t)."""
    structure = MatrixStructure(
        {"m": 2.0, "k": 50.0, "c": 30.0},
        mass=[("m", np.eye(2))],
        stiffness=[("k", np.eye(2)), ("c", np.array([[1.0, -1], [-1, 1]]))],
        observed={"q1": np.array([1.0, 0])},
        q0=np.array([0.1, 0.1]),
    )
    inputs = {"k": Triangular(45, 50, 55), "m": Triangular(1.9, 2.0, 2.1)}
    bounds = envelope(structure, inputs, duration=3.0, step=0.05, alpha=[0, 0.5, 1])
    time = np.asarray(bounds.time)
    for row, alpha in enumerate((0, 0.5, 1)):
        slow, fast = (
            np.sqrt((50 + s * 5 * (1 - alpha)) / (2 - s * 0.1 * (1 - alpha))) for s in (-1, 1)
        )
        motions = 0.1 * np.cos(np.linspace(slow, fast, 4001)[:, None] * time)
        assert bounds.lower[row, :, 0] == pytest.approx(motions.min(axis=0), abs=1e-4)
        assert bounds.upper[row, :, 0] == pytest.approx(motions.max(axis=0), abs=1e-4)


def test_measured_modes_narrow_the_stiffnesses_and_predict_the_others():
    words = [sys.executable, "-m", "alphacut", "identify", "cases/laboratory-frame.toml"]
    run = subprocess.run(
        [*words, "--quiet", "--json", "-"], cwd=ROOT, capture_output=True, text=True
    )
    assert run.returncode == 0, run.stderr
    result = json.loads(run.stdout)
    for name, ends in LEARNED.items():
        learned = result["inputs"][name]
        got = [learned[side][0] for side in ("lower", "upper")]
        assert got == pytest.approx(ends, abs=0.05)  # of a support of 1.6
    assert [mode["mode"] for mode in result["held_out"]] == [3, 4]
    assert all(mode["inside"] for mode in result["held_out"])
