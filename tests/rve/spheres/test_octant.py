"""Finite elements on one eighth of the cell, beside the series: another method, from above."""

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.spheres.model import cubic_stiffness

pytest.importorskip("alphacut.rve.fenicsx")
from tests.rve.spheres.octant import Octant

MATRIX = Phase(20e9)


@pytest.mark.parametrize(
    ("radius", "inclusion", "near"),
    [(0.5, Phase(80e9), 4e-4), (0.8, Phase(80e9, 0.2), 2e-3), (0.6, Phase(20e5, 0.2), 2e-3)],
)
def test_energies_lie_above_the_series_and_near_it(radius, inclusion, near):
    exact = cubic_stiffness(np.array([radius]), MATRIX, [inclusion]).moduli[0, 0]
    excess = Octant(radius, 0.25).moduli(MATRIX, inclusion) / exact - 1
    assert (excess > -1e-6).all()
    assert (excess < near).all()


def test_a_homogeneous_cell_is_exact():
    result = Octant(0.6, 0.5).moduli(MATRIX, MATRIX)
    assert result == pytest.approx((20e9 / 1.2, 20e9 / 2.6, 20e9 / 2.6), rel=1e-10)
