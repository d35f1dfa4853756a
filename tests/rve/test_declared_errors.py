"""Declared errors cover on random cells, and each estimate is tight where it is built to be seen."""

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.result.moduli import square_moduli
from alphacut.rve.series.model import SeriesModel, square_stiffness
from alphacut.stochastic import HermiteMap

PAPER, MATRIX, PARTICLE = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), Phase(20e9), Phase(80e9)
TIGHT = 1.0, 1.8


def apart(stiffness, moduli):
    """True relative errors of the three moduli."""
    return abs(square_moduli(stiffness) / moduli - 1)


def exact_means(radius_map=PAPER, particle=PARTICLE):
    return square_moduli(SeriesModel().solve(radius_map, MATRIX, [particle])[0].stiffness)


def test_the_series_estimate_is_tight():
    cells = square_stiffness(np.array([0.9]), MATRIX, [PARTICLE], tolerance=1e-4)
    exact = square_stiffness(np.array([0.9]), MATRIX, [PARTICLE])
    true = apart(cells.matrix[0, 0], square_moduli(exact.matrix[0, 0]))
    ratio = cells.errors[0, 0] / true
    assert (ratio > TIGHT[0]).all()
    assert (ratio < TIGHT[1]).all()


@pytest.mark.parametrize(
    ("radius", "modulus", "size"), [(0.68, 4e8, 0.69), (0.88, 7e8, 0.56), (0.67, 1e9, 0.99)]
)
def test_the_estimate_of_a_slice_is_tight(radius, modulus, size):
    pytest.importorskip("alphacut.rve.fenicsx")
    from alphacut.rve.slices.model import solve_slice

    phases = [Phase(modulus)]
    [solved] = solve_slice(radius, MATRIX, phases, mesh_size=size)
    exact = square_stiffness(np.array([radius]), MATRIX, phases)
    ratio = solved.errors / apart(solved.stiffness, square_moduli(exact.matrix[0, 0]))
    assert TIGHT[0] < ratio.min() < TIGHT[1]


def test_the_estimates_of_rules_in_theta_are_tight():
    coarse = SeriesModel(points=6).solve(PAPER, MATRIX, [PARTICLE])[0]
    ratio = coarse.errors["theta"] / apart(coarse.stiffness, exact_means())
    assert (ratio > TIGHT[0]).all()
    assert (ratio < TIGHT[1]).all()
