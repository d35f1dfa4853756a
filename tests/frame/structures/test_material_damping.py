"""Damping ratios from loss factors, against the formula of a mode in free oscillation."""

import numpy as np
import pytest

from alphacut.frame import damping_from_loss
from alphacut.fuzzy import Triangular
from tests.refused import refuses


def test_joints_come_on_top_on_every_level():
    loss, joints = Triangular(0.01, 0.02, 0.04), Triangular(0.005, 0.01, 0.02)
    ratio = damping_from_loss(loss, joints=joints, energy_fraction=0.5)
    for level in (0.0, 1.0):
        expected = np.sin(np.arctan(np.array(loss.cut(level)) / 2) / 2) + joints.cut(level)
        assert np.allclose(ratio.cut(level), expected, rtol=1e-12)
    assert damping_from_loss(0.02).nominal == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("fraction", [-0.1, 1.1, float("nan")])
def test_a_fraction_of_the_energy_lies_within_0_and_1(fraction):
    with refuses("energy_fraction"):
        damping_from_loss(0.02, energy_fraction=fraction)
