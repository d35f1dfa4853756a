"""Forces of a case: amplitudes by name, courses of files, and one line on what is wrong."""

import numpy as np
import pytest

from alphacut import main
from alphacut.case.content import load
from alphacut.frame import envelope, peaks
from tests.alphacut.small import refusals, written

WIND = "time [s],force [kN]\n0,2\n0.5,-4\n1,3\n"
FRAME = """
title = "Two floors in the wind"
stages = ["envelope"]
[frame]
masses = ["10 t", "8 t"]
stiffness = "9 MN/m"
damping_ratio = "2 %"
[[force]]
history = "wind.csv, static"
amplitude = { 1 = "1", 2 = "1 ± 10 %" }
[[force]]
history = "harmonic, 2 Hz, 90 deg, from 0.3 s"
amplitude = { 2 = "[1, 2, 3] kN" }
[[force]]
history = "impulse"
amplitude = { 1 = "0.4 kN s" }
[envelope]
fuzzy = ["F", "F2_2"]
alpha = [0, 1]
duration = "1 s"
step = "0.02 s"
"""


def in_the_wind(folder, **changes):
    (folder / "wind.csv").write_text(WIND, encoding="utf-8")
    return written(folder, FRAME, **changes)


def test_amplitudes_are_parameters_and_courses_have_their_files_samples(tmp_path):
    structure = load(in_the_wind(tmp_path)).content.structure
    assert structure.inputs(("F",)).keys() == {"F2", "F2_2"}
    numbers = {name: structure.numbers[name].support for name in structure.model.force_names}
    assert numbers == {"F1": (1.0, 1.0), "F2": (0.9, 1.1), "F2_2": (1e3, 3e3), "J1": (4e2, 4e2)}
    wind, _, machine, hammer = structure.model.loads
    np.testing.assert_allclose(wind.history.values([0.0, 0.25, 1.0, 9.0]), [2e3, -1e3, 0.0, 0.0])
    assert wind.history.is_static
    assert machine.history.values([0.29, 0.3]) == pytest.approx([0.0, 1.0])
    assert hammer.history is None
    units = {"F1": "", "F2": "", "F2_2": "N", "J1": "N*s", "m1": "kg"}  # no unit: factors of a file
    assert {name: structure.input_unit(name) for name in units} == units


MACHINE = """
title = "A machine below resonance"
stages = ["envelope"]
[frame]
masses = ["50 t"]
stiffness = ["10 MN/m ± 1 %"]
damping_ratio = "0 %"
outputs = ["q1"]
[[force]]
history = "harmonic, 1.5 Hz"
amplitude = { 1 = "10 kN" }
[envelope]
fuzzy = ["k1"]
alpha = [0, 1]
duration = "6 s"
step = "0.01 s"
"""


@pytest.mark.parametrize(
    "frequency", ["1.5 Hz", "9.42477796076938 rad/s", "90 rpm", "540 deg/s", "1.5 turn/s"]
)
def test_a_frequency_counts_turns_in_whatever_unit_it_is_given(tmp_path, capsys, frequency):
    case = written(tmp_path, MACHINE, **{"1.5 Hz": frequency})
    assert main(["check", str(case)]) == 0
    assert "1.5 Hz, period 0.6667 s" in capsys.readouterr().out
    (machine,) = load(case).content.structure.model.loads
    assert machine.history.frequency == pytest.approx(3 * np.pi, rel=1e-14)


def test_bounds_under_a_machine_in_turns_per_minute_hold_the_largest_displacement(tmp_path):
    structure = load(written(tmp_path, MACHINE, **{"1.5 Hz": "90 rpm"})).content.structure
    found = envelope(
        structure.model, structure.inputs(("k1",)), alpha=(1,), duration=6.0, step=0.01
    )
    # q(t) = F/(m (ω² - Ω²)) (sin Ω t - Ω/ω sin ω t), without damping, at rest at t = 0
    mass, force, turning, time = 50e3, 10e3, 2 * np.pi * 1.5, np.linspace(0.0, 6.0, 60001)
    omega = np.sqrt(np.linspace(9.9e6, 10.1e6, 41) / mass)[:, None]
    amplitude = force / (mass * (omega**2 - turning**2))
    shape = np.sin(turning * time) - turning / omega * np.sin(omega * time)
    largest = np.abs(amplitude * shape).max()
    assert largest == pytest.approx(3.0055e-3, rel=1e-4)
    assert largest <= peaks(found)["q1"].upper[0] <= 3.0095e-3
    attained = np.maximum(found.inner.upper, -found.inner.lower).max()
    assert 3.002e-3 <= attained <= largest


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('{ 2 = "[1, 2, 3] kN" }', '{ 3 = "1 kN" }', "force.amplitude is 3"),
        ('"impulse"', '"drum"', "a file, from the folder"),
        ('"impulse"', '"impulse, from 1 s"', "force[3].history is impulse, from 1 s"),
        ('"0.4 kN s"', '"0.4 kN"', "force.amplitude.1 is N"),
        (", 2 Hz, 90 deg", "", "force[2].history is harmonic"),
        ("2 Hz", "2 m", "2 m"),
        ("2 Hz", "2 s", "no unit of frequency"),
        ("from 0.3 s", "static", "force[2].history"),
        ("from 0.3 s", "from -1 s", "force[2]"),
        ("from 0.3 s", "from 1 s", "force[2].history is from 1 s"),  # at the end of the motion
        ('"wind.csv, static"', '"case.toml"', "case.toml, line"),
        ('"1 ± 10 %"', '"3 lb"', "3 lb; allowed: a force"),
        ('{ 1 = "0.4 kN s" }', "{}", "one floor or more"),
    ],
)
def test_what_is_wrong_with_a_force_is_said_in_one_line(tmp_path, old, new, words):
    (line,) = refusals(in_the_wind(tmp_path, **{old: new}))
    assert words in line


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time [s],force [bar]\n0,1\n1,2\n", "line 1"),
        ("time [s],force\n0,1\n1,x\n", "line 3"),
        ("time [s],force\n0,0\n1,0\n", "zeros throughout"),
        ("time [s],force\n0,1\n1,2\n1.5,2\n", "even steps"),
    ],
)
def test_files_that_hold_no_force_are_refused_by_their_line(tmp_path, text, words):
    (tmp_path / "wind.csv").write_text(text, encoding="utf-8")
    (line,) = refusals(written(tmp_path, FRAME))
    assert words in line
