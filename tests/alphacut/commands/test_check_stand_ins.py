"""`check` judges a structure by the material that its cell has, and not by a stand-in for it."""

import json

import numpy as np
import pytest

from tests.alphacut.small import CELL, summary_of_run, told_by, written

FRAME = """
[frame]
masses = "10 t"
lengths = "3 m"
second_moment = "1.75e-6 m^4"
damping_ratio = "material"
displacements = "10 mm"
GRAVITY
[envelope]
fuzzy = ["E"]
alpha = [0, 1]
duration = "0.4 s"
step = "0.02 s"
"""
LOSSES = '[cell]\nmatrix_loss = "6 %"\ninclusion_loss = "1 %"\n'
CASE = (CELL + FRAME).replace('["modulus"]', '["modulus", "envelope"]').replace("[cell]\n", LOSSES)
GRAVITY = 'gravity = "1 g"'
"""With it the storey stands from 21 GPa on. A stand-in of 20 GPa would buckle."""


def checked(case, folder):
    told = told_by("check", case, f"--json={folder}/check.json")
    return json.loads((folder / "check.json").read_text()), told


def test_a_storey_that_stands_with_the_cells_modulus_is_not_refused(tmp_path):
    case = written(tmp_path, CASE, GRAVITY=GRAVITY)
    found, _ = checked(case, tmp_path)
    summary = summary_of_run(case)
    assert found["period_s"] == pytest.approx(summary["structure"]["period_s"], rel=1e-3)
    lower, nominal, upper = summary["damping"]["zeta"]
    assert lower <= found["modes"]["damping_ratios"][0] * (1 + 1e-3)
    assert found["modes"]["damping_ratios"][0] == pytest.approx(nominal, rel=1e-3)
    assert upper < 0.03


def test_a_weight_that_is_left_out_is_warned_of_by_the_cells_modulus(tmp_path):
    case = written(tmp_path, CASE, GRAVITY="", **{"1.75e-6": "1.6e-5"})
    _, text = checked(case, tmp_path)
    assert "P-Delta" not in text  # with 20 GPa the coefficient would be 0.12


def test_what_the_solid_of_a_porous_image_connects_is_said(tmp_path):
    y, x = np.mgrid[:12, :12]
    text = """title = "Pores"
stages = ["modulus"]
[cell]
image = "image.npy"
pixel = "1 µm"
labels = [0, 1]
modulus = ["0 GPa", "20 GPa"]
poisson = 0.3
"""
    case = written(tmp_path, text)
    np.save(tmp_path / "image.npy", 1.0 * ((x > 5) | (y > 5)))
    _, out = checked(case, tmp_path)
    assert "connected along x, y; walls 9.0 pixels" in out
    assert "bounds of E: some 5 % apart" in out
    np.save(tmp_path / "image.npy", 1.0 * ((x > 5) & (y > 5)))
    _, out = checked(case, tmp_path)
    assert "no axis; 100.00% of it loose" in out
    assert "none from below along x, y, nor of the mean E" in out


def test_of_an_unknown_modulus_nothing_is_judged_that_depends_on_it(tmp_path):
    y, x = np.mgrid[:24, :24]
    np.save(tmp_path / "image.npy", np.where((x - 12) ** 2 + (y - 12) ** 2 < 49, 150.0, 50.0))
    image = """[cell]
image = "image.npy"
pixel = "1 µm"
threshold = [100]
modulus = ["20 GPa", "80 GPa"]
poisson = 0.3
loss = ["6 %", "1 %"]
"""
    text = CASE[: CASE.index("[radius]")] + image + CASE[CASE.index("[modulus]") :]
    text = text.replace('method = "series"\nplan = "reduced"\n', "").replace("tolerance = 1e-6", "")
    case = written(tmp_path, text, GRAVITY=GRAVITY)
    found, out = checked(case, tmp_path)
    assert found["period_s"] is None
    assert "P-Delta" not in out
    assert "envelope.tolerance" in told_by(
        "check", case, "--set", "envelope.tolerance=1 N", status=2
    )
    assert "buckles" in told_by("check", case, "--set", "frame.masses=1e9 t", status=2)
