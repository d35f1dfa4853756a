"""What the words of a case mean as fuzzy numbers, and how `check` tells it."""

import json
import re
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


@pytest.mark.parametrize(
    ("text", "cure"),
    [
        ("2600 ± 5 % MPa", "2600 MPa ± 5 %"),
        ("2600 ±5% MPa", "2600 MPa ± 5 %"),
        ("72000±2 % MPa", "72000 MPa ± 2 %"),
        ("2.6 +- 5 percent GPa", "2.6 GPa ± 5 %"),
        ("2600 (± 5 %) MPa", "2600 MPa ± 5 %"),
    ],
)
def test_a_percentage_before_the_unit_is_refused(text, cure):
    with pytest.raises(ValueError, match="stands before the unit: write") as refusal:
        quantity.fuzzy(text, "Pa")
    assert str(refusal.value).endswith(f"write {cure}")
    assert quantity.fuzzy(cure, "Pa").support.lower > 1e9


@pytest.mark.parametrize("text", ["5 % MPa", "[5, 10] % MPa", "2600 ± 5 MPa %", "9 ppm Pa"])
def test_a_share_is_no_part_of_a_unit(text):
    with pytest.raises(ValueError, match="is a share, no part of a unit"):
        quantity.fuzzy(text, "Pa")


def test_check_prints_what_every_fuzzy_input_was_read_as(tmp_path, capfd):
    case = tmp_path / "case.toml"
    text = PAPER.read_text(encoding="utf-8").replace('"[19, 20, 21] t"', '"20 t ± 5 %"')
    case.write_text(text.replace('"[75, 80, 85] GPa"', '"[75, 79, 81, 85] GPa"'), encoding="utf-8")
    assert main(["check", str(case)]) == 0
    told = capfd.readouterr().out
    assert "frame.masses 1: interval 19000 kg … 21000 kg\n" in told
    assert "cell.inclusion_modulus: trapezoid 75.00 GPa … 79.00 GPa … 81.00 GPa … 85.00 GPa" in told
    assert "radius.a2: triangle 0.001 … 0.1 … 0.3145" in told
    assert "cell.matrix_modulus: 20.00 GPa\n" in told


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


FRAME = """
schema = 1
title = "Steel"
about = "Two storeys."
stages = ["envelope"]

[frame]
masses = ["20 t", "20 t"]
lengths = ["3.5 m"]
columns = 8
second_moment = "25170 cm^4"
modulus = "210 GPa"
damping_ratio = "[2, 4] %"
accelerogram = "r.csv"
outputs = ["drift1", "a2"]

[envelope]
fuzzy = ["zeta"]
duration = "0.1 s"
step = "10 ms"

[decision]
limits = ["drift1 <= 0.5 %", "a2 <= 1 g"]
"""


def steel(folder, *changes, peak="2.5", capfd):
    """What `check` says on a frame of steel, with changes of its text."""
    text = FRAME
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    record = f"time [s],acceleration [m/s^2]\n0,0\n0.05,{peak}\n0.1,0\n"
    (folder / "r.csv").write_text(record, encoding="utf-8")
    (folder / "steel.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(folder / "steel.toml")]) == 0
    return "\n".join(capfd.readouterr())


def test_check_prints_crisp_values_and_limits_as_they_were_read(tmp_path, capfd):
    told = steel(tmp_path, capfd=capfd)
    for line in (
        "frame.masses 1 to 2: 20000 kg",
        "frame.lengths: 3.500 m",
        "frame.columns: 8",
        "frame.second_moment: 0.0002517 m^4",
        "frame.modulus: 210.0 GPa",
        "frame.damping_ratio: interval 0.02 … 0.04",
        "envelope.step: 10.00 ms",
        "frame.p_delta: false (default)",
        "decision limit of drift1: 17.50 mm, 0.5 % of the storey's height",
        "decision limit of a2: 9.807 m/s^2",
    ):
        assert f"\n{line}\n" in f"\n{told}"
    assert "is unusual" not in told
    assert "is the unit in its header right" not in told


def test_a_limit_of_exceedance_is_told_too(tmp_path, capfd):
    text = '[exceedance]\nrandom = ["zeta"]\nlimits = ["drift1 <= 12 mm"]\n\n[decision]'
    told = steel(tmp_path, ("[decision]", text), capfd=capfd)
    assert "exceedance limit of drift1: 12.00 mm, 0.343 % of the storey's height\n" in told


@pytest.mark.parametrize(
    ("change", "peak", "remark"),
    [
        (("210 GPa", "210 MPa"), "2.5", "frame.modulus: 210.0 MPa is unusual for a frame"),
        (("<= 0.5 %", "<= 0.012 mm"), "2.5", "decision: the limit of drift1: 12.00 µm is unusual"),
        (("<= 0.5 %", "<= 12 m"), "2.5", "decision: the limit of drift1: 12.00 m is unusual"),
        (("a2 <= 1 g", "a2 <= 0.1 mm/s^2"), "2.5", r"the limit of a2: 100.0 µm/s\^2 is unusual"),
        (("Two", "2"), "0.002", "warning: frame.accelerogram: a peak of 0.002 m/s² is unusual"),
        (("Two", "2"), "31", "warning: frame.accelerogram: a peak of 31 m/s² is unusual"),
        (("Two", "2"), "0.25", r"\(0.0255 g\); weak: is the unit in its header right\?"),
        (("Two", "2"), "24", r"\(2.45 g\); strong: is the unit in its header right\?"),
    ],
)
def test_what_a_unit_most_likely_spoilt_is_remarked_on(change, peak, remark, tmp_path, capfd):
    assert re.search(remark, steel(tmp_path, change, peak=peak, capfd=capfd))


def test_a_default_that_changes_the_stiffness_is_told(tmp_path, capfd):
    assert "\nframe.columns: 2 (default); second_moment is of one\n" in steel(
        tmp_path, ("columns = 8\n", ""), capfd=capfd
    )
    dampers = 'dampers = "9 kN s/m"\ndamper_placement = "storey"\n'
    told = steel(tmp_path, ("columns = 8\n", f"p_delta = true\n{dampers}"), capfd=capfd)
    assert "is unusual" not in told
    assert "\nframe.p_delta: true\n" in told
    assert "\nframe.damper_placement: storey\n" in told


SIX = 'masses = ["60 t", "60 t", "60 t", "60 t", "60 t", "60 t"]'
HIGH = '["3.5 m", "3.5 m", "3.5 m", "3.5 m", "3.5 m", "3.5 m"]'


@pytest.mark.parametrize(
    ("more", "remark"),
    [
        (("60 t", "60 kg"), "warning: frame.masses 1: 60 kg is 0.001 times the median of all stor"),
        (("60 t", "61000 t"), "frame.masses 1: 6.1e+07 kg is 1.02e+03 times the median"),
        (("3.5 m", "20 mm"), "frame.lengths 1: 20.00 mm is 0.00571 times the median of all stor"),
        (
            ("[2, 4] %", "[0.05, 4] %"),
            "frame.damping_ratio: 0.0005 is unusual for a damping ratio; check its",
        ),
        (("[2, 4] %", "[2, 21] %"), "frame.damping_ratio: 0.21 is unusual for a damping ratio"),
    ],
)
def test_one_storey_of_another_order_and_odd_damping_are_remarked_on(more, remark, tmp_path, capfd):
    six = ('masses = ["20 t", "20 t"]', SIX), ('["3.5 m"]', HIGH)
    assert "the median" not in steel(tmp_path, *six, capfd=capfd)
    assert remark in steel(tmp_path, *six, more, capfd=capfd).replace(HIGH, "")


@pytest.mark.parametrize("mass", ["400e3 t", "1 t"])
def test_masses_of_a_frame_in_another_unit_give_an_unusual_period(mass, tmp_path, capfd):
    told = steel(
        tmp_path, ('masses = ["20 t", "20 t"]', f'masses = ["{mass}", "{mass}"]'), capfd=capfd
    )
    assert "is unusual for a structure; check the units of masses" in told


@pytest.mark.parametrize(("stiffness", "period"), [("13500 MN/m", "0.05"), ("3.3 MN/m", None)])
def test_the_usual_period_grows_with_the_storeys(stiffness, period, tmp_path, capfd):
    six, own = ('masses = ["20 t", "20 t"]', SIX), (EI, f'stiffness = "{stiffness}"')
    told = steel(tmp_path, six, ('["3.5 m"]', HIGH), own, capfd=capfd)
    remark = f"first natural period of {period}"
    assert (remark in told) is bool(period)
    assert ("; 6 storeys usually take 0.3 to 1.8 s" in told) is bool(period)


def test_a_slip_that_may_have_made_the_step_too_coarse_is_told_before_it(tmp_path, capfd):
    text = FRAME.replace('lengths = ["3.5 m"]', 'lengths = ["3.5 m", "1.5 mm"]')
    assert text != FRAME
    (tmp_path / "r.csv").write_text("time [s],acceleration [m/s^2]\n0,0\n0.05,2\n0.1,0\n")
    (tmp_path / "low.toml").write_text(text, encoding="utf-8")
    assert main(["check", str(tmp_path / "low.toml"), "--set", "envelope.step=20 ms"]) == 2
    height, step = capfd.readouterr().err.splitlines()
    assert re.search(r"low.toml:\d+: frame.lengths 1: 3.500 m is 2.33e\+03 times the med", height)
    assert re.search(r"envelope.step: 0.02 s with motions as fast as .* take a step", step)


def test_steps_without_need_are_counted_and_a_longer_one_is_named(tmp_path, capfd):
    short = ('step = "10 ms"', 'step = "1 us"')
    told = steel(tmp_path, short, capfd=capfd)
    assert re.search(r"envelope.step: 1.00 µs makes [\d,]+ steps, [\d,]+ of them in the s", told)
    assert re.search(r"shortest natural period; [\d.]+ .s is fine enough", told)


EI = 'columns = 8\nsecond_moment = "25170 cm^4"\nmodulus = "210 GPa"'
RATIO = 'damping_ratio = "[2, 4] %"'


@pytest.mark.parametrize(
    ("old", "new", "remark"),
    [
        (EI, 'stiffness = "40 kN/m"', "frame: a first natural period of 7.19 s is unusual"),  # MN
        (EI, 'stiffness = "300 kN/m"', "frame: a first natural period of 2.62 s is unusual"),
        (
            '"20 t", "20 t"',
            '"20000 t", "20000 t"',
            "frame.masses 1 to 2: 2e+07 kg is unusual for a floor",
        ),  # kg
        ('"25170 cm^4"', '"25170 mm^4"', "natural period of 13.2 s is unusual"),
        ('["3.5 m"]', '["3.5 m", "3.5 cm"]', "frame.lengths 1: 3.500 m is 100 times the median"),
        ('["3.5 m"]', '["3.5 m", "35 cm"]', "frame.lengths 1: 3.500 m is 10 times the median"),
        ("<= 0.5 %", "<= 0.5 m", "the limit of drift1: 500.0 mm is unusual"),  # a share
        ("<= 0.5 %", "<= 0.005 %", "the limit of drift1: 175.0 µm is unusual"),  # a fraction
        ("a2 <= 1 g", "a2 <= 10 g", "the limit of a2: 98.07 m/s^2 is unusual"),  # m/s²
        ("a2 <= 1 g", "base_shear <= 90 N", "the limit of base_shear: 90.00 N is unusual"),  # kN
        ("a2 <= 1 g", "base_shear <= 90 MN", "the limit of base_shear: 90.00 MN is unusual"),
        ("210 GPa", "210 GPa ± 0.05 %", "frame.modulus: a width of 0.1 % is unusually small"),
        (RATIO, f'{RATIO}\nrayleigh_stiffness = "2 s"', "the slowest mode is damped by 47"),  # ms
        (RATIO, f'{RATIO}\ndampers = "9 MN s/m"\ndamper_placement = "storey"', "mode is damped by"),
    ],
)
def test_slips_of_an_engineer_are_remarked_on(old, new, remark, tmp_path, capfd):
    assert "unusual" not in steel(tmp_path, capfd=capfd)
    assert remark in steel(tmp_path, (old, new), capfd=capfd)
