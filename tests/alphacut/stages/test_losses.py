"""Loss factors of phases in a case: their α-cuts, and the damping of a frame of the material."""

import numpy as np
import pytest

from tests.alphacut.small import CELL, refusals, summary_of_run, written

LOSSES = 'matrix_loss = "[1.4, 2, 2.6] %"\ninclusion_loss = "[0.35, 0.5, 0.65] %"\n'
CASE = CELL.replace('["modulus"]', '["modulus", "envelope"]').replace("tolerance = 1e-6\n", "")
CASE = CASE.replace("alpha = [0, 1]", "alpha = [0, 0.5, 1]").replace('method = "series"\n', "")
CASE = CASE.replace("[modulus]\n", LOSSES + "[modulus]\n")
CASE += """
[frame]
masses = "10 t"
lengths = "3 m"
second_moment = "1e-5 m^4"
damping_ratio = "material"
displacements = "10 mm"
[envelope]
fuzzy = ["E", "zeta"]
alpha = [0, 1]
duration = "0.5 s"
step = "0.02 s"
"""


def test_the_frame_is_damped_by_half_the_loss_factor_of_its_material(tmp_path):
    document = summary_of_run(written(tmp_path, CASE))
    loss = document["modulus"]["loss"]["E"]
    low, nominal, high = document["damping"]["zeta"]
    expected = np.sin(np.arctan([loss["lower"][0], loss["lower"][-1], loss["upper"][0]]) / 2)
    assert np.allclose([low, nominal, high], expected, rtol=1e-12)
    assert low > 0.35e-2 / 2
    assert high < 2.6e-2 / 2
    assert document["envelopes"]["all"]["nature"] == "guaranteed"
    without = CASE.partition("[frame]")[0].replace(', "envelope"]', "]")
    lines = (x for x in without.splitlines() if "_loss" not in x)
    other = summary_of_run(written(tmp_path, "\n".join(lines)))
    assert other["modulus"]["E_GPa"] == document["modulus"]["E_GPa"]
    assert other["modulus"]["loss"] is None


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        (LOSSES, "", "frame.damping_ratio", "loss factors in [cell]"),
        ('"[1.4, 2, 2.6] %"', '"-1 %"', "cell.matrix_loss", "from 0 up to 0.5"),
        ('"[1.4, 2, 2.6] %"', "0.51", "cell.matrix_loss", "from 0 up to 0.5"),
        ('matrix_loss = "[1.4, 2, 2.6] %"\n', "", "cell.matrix_loss", "a loss of either phase"),
        (
            CASE[CASE.index("[radius]") : CASE.index("[modulus]")],
            '[mesh]\nfile = "x.msh"\n[cell.phases]\na = { modulus = "1 GPa", poisson = 0, loss = 0.1 }\n'
            'b = { modulus = "1 GPa", poisson = 0 }\n',
            "cell.phases.b.loss",
            "0 for none",
        ),
        ('"material"', '"material - 1 %"', "frame.damping_ratio", "below 1"),
        (
            'lengths = "3 m"\nsecond_moment = "1e-5 m^4"',
            'stiffness = "1 MN/m"',
            "frame.damping_ratio",
            "columns of the material",
        ),
    ],
)
def test_what_is_wrong_is_said_in_one_line(tmp_path, old, new, key, words):
    lines = refusals(written(tmp_path, CASE, **{old: new}))
    assert any(f": {key} is " in line for line in lines)
    assert any(words in line for line in lines)
