"""Sizes that betray a wrong unit are doubted by `check`, which still ends well."""

import pytest

from alphacut import main
from tests.alphacut.small import FRAME as ONE_FLOOR
from tests.alphacut.small import told_by, written

FRAME = """
title = "Two storeys"
stages = ["envelope"]
[frame]
stiffness = ["60 MN/m ± 5 %", "50 MN/m"]
masses = ["40 t", "30 t"]
lengths = ["3.5 m", "3 m"]
damping_ratio = "3 %"
outputs = ["drift1"]
velocities = "0.1 m/s"
[envelope]
fuzzy = ["k1"]
alpha = [0, 1]
duration = "0.1 s"
step = "2 ms"
"""
RATIO = 'damping_ratio = "3 %"'


def warnings_of(folder, text):
    return [
        line
        for line in told_by("check", written(folder, text)).splitlines()
        if line.startswith("warning: ")
    ]


@pytest.mark.parametrize(
    ("old", "new", "doubt"),
    [
        (RATIO, 'rayleigh_stiffness = "2.5 s"', "damping ratios are up to"),
        (RATIO, RATIO + '\nyield_force = "30 N"', "frame.yield_force is at most 4.4e-05 of the"),
        (RATIO, RATIO + '\nyield_drift = "12 m"', "frame.yield_drift is up to 12 m"),
        (RATIO, RATIO + '\ndisplacements = ["1 m", "20 m"]', "shear a storey by 19 m"),
        (RATIO, RATIO + '\ngravity = "9.81 g"', 'frame.gravity is 96.2032 m/s^2: write "1 g"'),
    ],
)
def test_a_size_that_betrays_a_wrong_unit_is_doubted(tmp_path, old, new, doubt):
    assert warnings_of(tmp_path, FRAME) == []
    (warning, *_) = warnings_of(tmp_path, FRAME.replace(old, new))
    assert doubt in warning


def test_a_yield_force_that_is_never_reached_is_no_doubt(tmp_path, capsys):
    text = ONE_FLOOR.replace('masses = ["[9, 10, 11] t"]', 'masses = ["100 t", "10 t"]')
    text = text.replace('fuzzy = ["E", "m"]', 'fuzzy = ["E"]')
    for force, is_doubted in (("1 GN", False), ("0.5 kN", True)):
        text = text.replace('method = "graph-follower"\n', "").replace('tolerance = "0.1 mm"\n', "")
        forces = f'yield_force = ["200 kN", "{force}"]\n[envelope]'
        case = written(tmp_path, text.replace("[envelope]", forces))
        main(["check", str(case), "--quiet"])
        assert ("frame.yield_force of two storeys differ" in capsys.readouterr().err) == is_doubted
