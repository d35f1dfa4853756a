"""Mistakes in a case are told with the key and what to write in its place."""

import pytest

from alphacut import main
from tests.alphacut.small import refusals

CASE = """
title = "t"
stages = ["envelope"]
[frame]
masses = ["30 t", "30 t"]
stiffness = ["[9, 10, 11] MN/m", "10 MN/m"]
damping_ratio = "5 %"
outputs = ["drift1"]
displacements = ["1 mm", "2 mm"]
[envelope]
fuzzy = ["k1"]
duration = "2 s"
step = "0.02 s"
"""
YIELDS = 'yield_force = ["50 kN", "50 kN"]\noutputs'


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('"5 %"', "5", ("frame.damping_ratio is 5", 'write "5 %" or 0.05')),
        ('"5 %"', '"5"', ("frame.damping_ratio is 5", '"5 %" for 0.05')),
        (
            'stiffness = ["[9, 10, 11] MN/m", "10 MN/m"]',
            'modulus = "200 GPa"\nsecond_moment = "1e-6 m^4"',
            ("frame.lengths is missing", "give lengths", "or stiffness"),
        ),
        (
            "outputs",
            f'yield_drift = ["5 mm", "5 mm"]\n{YIELDS}',
            ("frame.yield_force is beside yield_drift", "leave out yield_drift"),
        ),
        ("outputs", "gravity = 9.81\noutputs", ("frame.gravity is 9.81", "as 9.81 m/s^2")),
        (
            '"0.02 s"',
            '"0.03 s"',
            ("envelope.duration is 2 s", 'envelope.step = "0.0298507463 s"', '"2.01 s"'),
        ),
        ('"0.02 s"', '"1e-9 s"', ("envelope.duration is 2 s", 'envelope.step = "2e-06 s"')),
        ('"2 s"', '"1e999999999 s"', ("envelope.duration is 1e999999999 s", "magnitudes")),
        (
            "[envelope]",
            f'[identify]\nmeasured = "{300 * "a"}.csv"\nlearn = ["k1"]\n[envelope]',
            ("identify.measured is aaa", "file name too long"),
        ),
        (
            "[envelope]",
            f'[[force]]\nhistory = "{300 * "a"}.csv"\namplitude = {{ 2 = "1 kN" }}\n[envelope]',
            ("force[1].history is aaa",),
        ),
        (
            "[envelope]",
            f'[records]\nfiles = ["{300 * "a"}"]\n[envelope]',
            ("records.files[1] is aaa", "files or patterns"),
        ),
    ],
)
def test_one_line_names_the_key_and_the_cure(tmp_path, old, new, words):
    (tmp_path / "t.toml").write_text(CASE.replace(old, new, 1), encoding="utf-8")
    (line,) = refusals(tmp_path / "t.toml")
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'outputs = ["drift1"]',
            'dampers = "1 MN s/m"\ndamper_placement = "storey"\noutputs = ["shear2"]',
            "warning: shear2: forces of the columns, without those of the dampers",
        ),
        (
            "outputs",
            f'lengths = ["3 m", "3 m"]\nhardening = ["0 %", "5 %"]\n{YIELDS}',
            "warning: storey 1 yields to 0 of its stiffness, and its weight takes up to 0.022",
        ),
    ],
)
def test_check_warns_of_what_a_model_leaves_out(tmp_path, capsys, old, new, words):
    case = tmp_path / "case.toml"
    case.write_text(CASE, encoding="utf-8")
    assert main(["check", str(case)]) == 0
    assert words not in " ".join(capsys.readouterr().out.split())
    case.write_text(CASE.replace(old, new, 1), encoding="utf-8")
    assert main(["check", str(case)]) == 0
    assert words in " ".join(capsys.readouterr().out.split())
