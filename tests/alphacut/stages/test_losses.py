"""Loss factors of phases in a case: their α-cuts, and the damping of a frame of the material."""

import numpy as np
import pytest
from scipy.linalg import eigvals

from alphacut.frame import MatrixStructure
from alphacut.frame.structures.matrix import modal_energy_fractions
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


def test_a_lossless_ground_storey_damps_modes_by_their_energy_elsewhere():
    """Against complex modes, whose distance is of third order in the loss factor."""
    upper = np.array([[1.0, -1, 0], [-1, 2, -1], [0, -1, 1]]) * 4e6
    ground = np.diag([9e6, 0, 0])
    mass = np.diag([2e4, 1e4, 1e4, 0.0])
    upper, ground = (np.pad(x, (0, 1)) for x in (upper, ground))
    joined = np.zeros((4, 4))  # an unknown without mass on the roof
    joined[2:, 2:] = np.array([[1, -1], [-1, 1.0]]) * 1e6
    ground_of_it = np.diag([0, 0, 0, 2e5])
    structure = MatrixStructure(
        {"E": 1.0},
        mass=[(1.0, mass)],
        stiffness=[("E", upper), (1.0, ground), ("E", joined), (1.0, ground_of_it)],
        observed={"roof": np.eye(4)[2]},
    )
    shares, gaps = modal_energy_fractions(structure, [0, 2]), []
    for loss in (0.04, 0.02):
        stiffness = (upper + joined) * (1 + 1j * loss) + ground + ground_of_it
        a, b = np.ix_(range(3), range(3)), stiffness[3:, :3]
        condensed = stiffness[a] - b.T @ b / stiffness[3, 3]
        squared = np.sort(eigvals(condensed, mass[a]))
        exact = np.sin(np.angle(squared) / 2)
        gaps.append(abs(np.sin(np.arctan(loss * shares) / 2) / exact - 1).max())
    assert gaps[0] < 1e-3
    assert np.log2(gaps[0] / gaps[1]) == pytest.approx(2, abs=0.05)
