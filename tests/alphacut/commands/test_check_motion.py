"""What `check` says of the motion beforehand: modes, weight, and steps that miss accelerations."""

import json
import re

import numpy as np
import pytest

from alphacut import main
from tests.alphacut.small import told_by

CASE = """
title = "Two equal storeys"
stages = ["envelope"]
[frame]
masses = ["50 t", "50 t"]
lengths = "3 m"
stiffness = ["[39, 41] MN/m", "40 MN/m"]
YIELD
damping_ratio = "4 %"
GROUND
outputs = ["drift1", "a2"]
[envelope]
fuzzy = ["k1"]
alpha = [0]
duration = "4 s"
step = "0.01 s"
"""
TIME = 0.01 * np.arange(400)
RECORD = np.sin(14 * TIME) + np.sin(9 * TIME)
YIELD = 'yield_force = "100 kN"\nhardening = "5 %"'


def said(folder, *, step="0.01 s", yields="", suite=False, digits=2):
    rows = "".join(f"{t:.{digits}f},{a:.6f}\n" for t, a in zip(TIME, RECORD, strict=True))
    (folder / "record.csv").write_text("time [s],acceleration [m/s^2]\n" + rows)
    ground = "" if suite else 'accelerogram = "record.csv"'
    text = CASE.replace("GROUND", ground).replace("YIELD", yields).replace('"0.01 s"', f'"{step}"')
    if yields:  # an output that no elastic frame has, beside the acceleration
        text = text.replace('"a2"]', '"a2", "ductility1"]')
    text += '[records]\nfiles = "record.csv"\n' if suite else ""
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return told_by("check", folder / "case.toml", f"--json={folder}/check.json")


def test_modes_and_weight_are_those_of_two_equal_storeys(tmp_path):
    """ω² = k/m (3 ∓ √5) / 2; effective masses are (5 ± 2 √5) / 10 of both floors."""
    text = said(tmp_path)
    periods = 2 * np.pi / np.sqrt(800 * (3 - np.array([1, -1]) * np.sqrt(5)) / 2)
    shares = (5 + 2 * np.sqrt(5) * np.array([1, -1])) / 10
    for number, period, share in zip((1, 2), periods, shares, strict=True):
        row = rf"^{number} +{period:.4g} s +4.00% +{100 * share:.1f}%$"
        assert re.search(row, text, re.MULTILINE), text
    assert "total weight: 980.7 kN, of 100,000 kg" in text
    modes = json.loads((tmp_path / "check.json").read_text())["modes"]
    assert modes["periods_s"] == pytest.approx(periods.tolist(), rel=1e-9)
    assert modes["effective_masses_kg"] == pytest.approx((1e5 * shares).tolist(), rel=1e-9)


@pytest.mark.parametrize("suite", [False, True], ids=["record", "suite"])
def test_a_step_that_misses_accelerations_of_yielding_columns_is_warned_of(tmp_path, suite):
    coarse = said(tmp_path, step="0.2 s", yields=YIELD, suite=suite)
    assert "warning: a2: the step of 0.2 s is too coarse: its peak may be missed" in coarse
    assert "drift1: the step" not in coarse  # its peaks are found between nodes
    fine = said(tmp_path, step="0.002 s", yields=YIELD, suite=suite)
    assert "too coarse" not in fine


def test_spectral_acceleration_is_said_to_be_pseudo_acceleration_with_own_damping(tmp_path):
    text = said(tmp_path, suite=True)
    assert re.search(r"Sa\(T1\): pseudo-acceleration .* T1 = 0.3594 s .* ratio, 4.0%", text), text


def test_a_force_whose_times_are_in_milliseconds_is_doubted(tmp_path):
    rows = "".join(f"{250 * k},{k % 3}\n" for k in range(20))
    (tmp_path / "force.csv").write_text("time [s],force [kN]\n" + rows)
    force = '[[force]]\namplitude = {2 = "1"}\nhistory = "force.csv"\n'
    case = (
        CASE.replace("GROUND", "").replace("YIELD", "").replace("[envelope]", force + "[envelope]")
    )
    (tmp_path / "case.toml").write_text(case, encoding="utf-8")
    assert "ends before the second sample, at 250 s: are its times" in told_by(
        "check", tmp_path / "case.toml"
    )


def said_of_force(folder, samples, *, history="force.csv", duration="4 s"):
    rows = "".join(f"{0.25 * k:.2f},{x}\n" for k, x in enumerate(samples))
    (folder / "force.csv").write_text("time [s],force [kN]\n" + rows)
    force = f'[[force]]\namplitude = {{2 = "1"}}\nhistory = "{history}"\n'
    case = CASE.replace("GROUND", "").replace("YIELD", "") + force
    (folder / "case.toml").write_text(case.replace('"4 s"', f'"{duration}"'), encoding="utf-8")
    return told_by("check", folder / "case.toml")


@pytest.mark.parametrize(
    ("history", "end"), [("force.csv", 2), ("force.csv, static", 2), ("force.csv, from 1 s", 3)]
)
def test_a_force_that_ends_within_the_motion_without_being_zero_is_warned_of(
    tmp_path, history, end
):
    text = said_of_force(tmp_path, [1, 2, 3, 4, 3, 2, 1, 2, 3], history=history)
    words = (
        f"warning: force1 ends at {end} s with 75.0% of its largest value, and is 0 from then on"
    )
    assert words in text


@pytest.mark.parametrize(
    ("samples", "duration"),
    [([1, 2, 3, 2, 1, 0.5, 0.2, 0.1, 0], "4 s"), ([1, 2, 3, 4, 3, 2, 1, 2, 3], "2 s")],
    ids=["it fades away", "it lasts as long"],
)
def test_a_force_that_does_not_jump_within_the_motion_is_not_warned_of(tmp_path, samples, duration):
    assert "force1 ends" not in said_of_force(tmp_path, samples, duration=duration)


@pytest.mark.parametrize("suite", [False, True], ids=["record", "suite"])
def test_a_record_that_is_shorter_than_half_the_first_period_is_warned_of(
    tmp_path, monkeypatch, suite
):
    words = "less than half the first natural period, 0.3594 s: is its step right?"
    assert words not in said(tmp_path, suite=suite)
    monkeypatch.setattr(f"{__name__}.TIME", TIME / 25)  # steps of 0.4 ms
    text = said(tmp_path, suite=suite, digits=4)
    assert f"record{' record' if suite else ''} lasts 0.1596 s, {words}" in text


def test_nothing_is_said_of_a_step_before_anything_moves(tmp_path, capfd):
    """The first 16,000 steps, which are timed, end before the force sets in."""
    force = '[[force]]\nhistory = "step, from 20 s"\namplitude = {2 = "10 kN"}\n'
    text = CASE.replace("GROUND", "").replace("YIELD", "") + force
    text = text.replace('"4 s"', '"30 s"').replace('"0.01 s"', '"0.001 s"')
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    seen = capfd.readouterr()
    assert "nan" not in seen.out + seen.err
    assert "total weight: 980.7 kN" in seen.out
