"""Damping in case files: by ratios, by dampers, by Rayleigh's factors; and what a structure cannot
do without.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from alphacut.case.checks_structure import incomplete
from alphacut.case.load import load
from alphacut.entry import main
from alphacut.stages.vibration.structure import structure

CASES = Path(__file__).parents[3] / "cases"
PAPER = (CASES / "paper.toml").read_text(encoding="utf-8")
BUILDING = (
    (CASES / "building.toml")
    .read_text(encoding="utf-8")
    .replace("building.record.csv", str(CASES / "building.record.csv"))
)
TOWER = (
    (CASES / "tower.toml")
    .read_text(encoding="utf-8")
    .replace("building.record.csv", str(CASES / "building.record.csv"))
)


def changed(text, drop=(), **keys):
    """The case without some lines and with others."""
    for name in (*drop, *keys):
        text = re.sub(rf"(?m)^{name} = .*\n", "", text)
    lines = "".join(f"{name} = {value}\n" for name, value in keys.items())
    return re.sub(r"(?m)^\[(frame|tower)\]\n", lambda match: f"[{match[1]}]\n{lines}", text)


def case(tmp_path, text):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("value", "names", "modal"),
    [
        ("0.05", ["zeta"], [0.05]),
        ('"[4, 5, 7] %"', ["zeta"], [0.05]),
        ('["5 %"]', ["zeta"], [0.05]),
        ('[0.02, "[4, 5, 6] %", 0.1]', ["zeta1", "zeta2", "zeta3"], [0.02, 0.05, 0.1]),
    ],
)
def test_a_ratio_damps_the_modes_of_the_frame(value, names, modal, tmp_path):
    path = case(tmp_path, changed(PAPER, ("dampers", "damper_placement"), damping_ratio=value))
    made = structure(load(path), None)
    assert [name for name in made.numbers if name.startswith("zeta")] == names
    assert list(made.frame.damping_ratio) == modal
    assert set(made.frame.dampers) == {0.0}
    assert made.frame.damper_placement == "ground"


def test_a_fuzzy_ratio_widens_the_envelope_from_the_command_line(tmp_path, capfd):
    path = case(
        tmp_path, changed(PAPER, ("dampers", "damper_placement"), damping_ratio='"[2, 5, 9] %"')
    )
    found = []
    for names in ("E", "E,zeta"):
        arguments = [
            "envelope",
            str(path),
            "--fuzzy",
            names,
            "--duration",
            "4",
            "--alpha",
            "0",
            "--method",
            "modal",
            "--tolerance",
            "1 mm",
            "--json",
            "-",
        ]
        assert main(arguments) == 0, capfd.readouterr().err
        found.append(json.loads(capfd.readouterr().out))
    assert found[1]["parameters"] == ["E", "zeta"]
    assert (np.array(found[1]["max"]) > np.array(found[0]["max"]) + 0.002).all()


def test_ratios_of_a_tower_and_of_each_mode_are_fuzzy_inputs(tmp_path):
    path = case(
        tmp_path,
        changed(
            TOWER,
            ("rayleigh_mass", "rayleigh_stiffness"),
            damping_ratio='"[1, 2, 3] %"',
            storeys="3",
            bays="1",
        ),
    )
    made = structure(load(path), None)
    assert made.members("zeta") == ("zeta",)
    path = case(tmp_path, changed(PAPER, damping_ratio='[0.02, "[4, 5, 6] %", 0.1]'))
    assert structure(load(path), None).members("zeta") == ("zeta2",)  # the others are crisp


@pytest.mark.parametrize(
    ("text", "key", "words"),
    [
        (
            changed(PAPER, damping_ratio="[0.1, 0.2]"),
            "frame.damping_ratio",
            "got 2 values for 3 modes",
        ),
        (changed(PAPER, damping_ratio="1.0"), "frame.damping_ratio", "below 1"),
        (changed(PAPER, damping_ratio='"5"'), "frame.damping_ratio", "stands in quotes"),
        (changed(PAPER, damping_ratio='"5 kg"'), "frame.damping_ratio", 'unit "kg" is wrong'),
        (
            changed(PAPER, damping_ratio='[0.1, "-2 %", 0.1]'),
            "frame.damping_ratio",
            'entry 2, "-2 %"',
        ),
        (changed(PAPER, ("dampers",)), "frame.dampers", "missing"),
        (changed(PAPER, ("damper_placement",)), "frame.damper_placement", "missing"),
        (changed(PAPER, ("dampers", "damper_placement")), "frame.dampers", "no damping"),
        (changed(PAPER, ("displacements",)), "frame.displacements", "without an accelerogram"),
        (
            changed(PAPER, displacements='"0 mm"', velocities='"0 m/s"'),
            "frame.displacements",
            "nothing moves the frame",
        ),
        (changed(TOWER, ("rayleigh_mass",)), "tower.rayleigh_mass", "needs damping"),
        (
            TOWER.replace('fuzzy = ["E_columns",', 'fuzzy = ["zeta",'),
            "envelope.fuzzy",
            "no damping ratio",
        ),
        (
            re.sub(r'fuzzy = \["E", "m"\] .*', 'fuzzy = ["zeta"]', PAPER),
            "envelope.fuzzy",
            "the frame has no input zeta: no damping_ratio is given",
        ),
    ],
)
def test_what_is_wrong_or_missing_is_said_in_one_line(text, key, words, tmp_path, capfd):
    assert main(["check", str(case(tmp_path, text))]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert f" {key}" in line
    assert words in line


def test_an_earthquake_needs_no_start_and_one_value_holds_for_all_floors(tmp_path):
    path = case(tmp_path, changed(BUILDING, ("displacements", "velocities"), lengths='"3.2 m"'))
    made = structure(load(path), load(path).cell.matrix_modulus)
    assert set(made.frame.lengths) == {3.2}
    assert set(made.frame.q0) == set(made.frame.v0) == {0.0}


def test_shipped_cases_are_complete():
    for name in ("paper", "building", "tower", "pendulum"):
        assert not list(incomplete(load(CASES / f"{name}.toml")))
