"""What the words of a case mean as fuzzy numbers, and how `check` tells it."""

import json
from pathlib import Path

import pytest

from alphacut.entry import main
from alphacut.fuzzy import Interval
from alphacut.io import quantity
from tests.alphacut.one_floor import one_floor

PAPER = Path(__file__).parents[3] / "cases" / "paper.toml"


@pytest.mark.parametrize("text", ["20 t ± 5 %", "20 ± 1 t", "20 t +- 1 t", "20 t ± 1000 kg"])
def test_a_spread_is_an_interval(text):
    assert quantity.fuzzy(text, "kg") == Interval(19e3, 21e3)
    assert quantity.fuzzy(f"-{text}", "kg") == Interval(-21e3, -19e3)


@pytest.mark.parametrize(
    ("text", "si", "cure"),
    [
        ("25170 cm^4 ± 10", "m^4", "write ± 10 % or ± 10 cm^4"),
        ("3 % ± 1 %", "", "write the ends, such as [2, 4] %"),
        ("3 % ± 1", "", "write the ends, such as [2, 4] %"),
    ],
)
def test_a_spread_that_may_mean_two_things_is_refused(text, si, cure):
    with pytest.raises(ValueError, match="may mean two things") as refusal:
        quantity.fuzzy(text, si)
    assert cure in str(refusal.value)


def test_check_prints_what_every_fuzzy_input_was_read_as(tmp_path, capfd):
    case = tmp_path / "case.toml"
    text = PAPER.read_text(encoding="utf-8").replace('"[19, 20, 21] t"', '"20 t ± 5 %"')
    case.write_text(text.replace('"[75, 80, 85] GPa"', '"[75, 79, 81, 85] GPa"'), encoding="utf-8")
    assert main(["check", str(case)]) == 0
    told = capfd.readouterr().out
    assert "frame.masses 1: interval 1.9e+04 kg … 2.1e+04 kg\n" in told
    assert "cell.inclusion_modulus: trapezoid 75.00 GPa … 79.00 GPa … 81.00 GPa … 85.00 GPa" in told
    assert "radius.a2: triangle 0.001 … 0.1 … 0.3145" in told
    assert "matrix_modulus" not in told  # crisp


def test_check_hands_the_inputs_on_as_data(capfd):
    assert main(["check", str(PAPER), "--json", "-"]) == 0
    inputs = json.loads(capfd.readouterr().out)["inputs"]
    masses = [one for one in inputs if one["key"].startswith("frame.masses")]
    assert masses[0]["shape"] == "triangle"
    assert masses[0]["values"] == [19e3, 20e3, 21e3]
    assert masses[0]["unit"] == "kg"


def test_check_says_what_is_fixed_which_levels_are_alike_and_what_the_record_is(tmp_path, capfd):
    text = one_floor(fuzzy='["m1"]', duration=1, step=0.01, mass="1 t ± 5 %", moved="10 mm ± 1 mm")
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(tmp_path / "case.toml")]) == 0
    told = capfd.readouterr().out
    assert "fixed at the middle of the top cut, since no study names them: q1_0\n" in told
    assert "all inputs are intervals, so all 5 levels are alike: envelope.alpha = [0]" in told
    assert main(["check", str(PAPER.parent / "laboratory-frame.toml")]) == 0  # learned: they differ
    assert "levels are alike" not in capfd.readouterr().out
    assert main(["check", str(PAPER.parent / "building.toml")]) == 0
    told = capfd.readouterr().out
    assert "frame.accelerogram: 2001 values every 0.01 s, to 20 s, peak 2.5 m/s² (0.255 g)" in told
    assert "ends on -0.0089 m/s², then the ground rests" in told
    assert "fixed at" not in told
