"""Declared errors cover on random cells, and each estimate is tight where it is built to be seen."""

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.cell import square_moduli
from alphacut.rve.series.model import SeriesModel
from alphacut.rve.series.stiffness import square_stiffness
from alphacut.rve.slices.model import solve_slice
from alphacut.stochastic import HermiteMap
from benchmarks.rve.calibration import calibrate, main

PAPER, MATRIX, PARTICLE = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), Phase(20e9), Phase(80e9)
TIGHT = 1.0, 1.8


def judged(cases, seed, models):
    """Numbers with their declared and true errors."""
    found = [found for _, _, found in calibrate(cases, seed, models) if not isinstance(found, str)]
    return [one for many in found for one in many]


@pytest.mark.parametrize("model", ["slices", "prism"])
def test_finite_elements_cover_on_a_random_cell(model):
    pytest.importorskip("alphacut.rve.planar.problem")
    every = judged(1, 3, [model])
    assert len(every) > 25
    assert [one for one in every if not one.covered] == []
    assert np.median([one.declared / max(one.true, one.noise) for one in every]) < 30


@pytest.mark.slow
def test_300_random_cells_are_within_their_declared_errors(capsys):
    pytest.importorskip("alphacut.rve.planar.problem")
    assert main(["--cases", "300", "--seed", "12"]) == 0
    *_, every = capsys.readouterr().out.splitlines()
    assert float(every.split()[-1]) <= 10


def exact_means(radius_map=PAPER, particle=PARTICLE):
    return square_moduli(SeriesModel().solve(radius_map, MATRIX, [particle])[0].stiffness)


def test_the_series_estimate_is_tight():
    cells = square_stiffness(np.array([0.9]), MATRIX, [PARTICLE], tolerance=1e-4)
    exact = square_stiffness(np.array([0.9]), MATRIX, [PARTICLE])
    true = abs(square_moduli(cells.matrix) / square_moduli(exact.matrix) - 1)[0, 0]
    ratio = cells.errors[0, 0] / true
    assert (ratio > TIGHT[0]).all()
    assert (ratio < TIGHT[1]).all()


@pytest.mark.parametrize(
    ("radius", "modulus", "orders", "order"),
    [(0.95, 80e9, (2, 3, 4), 4), (0.2, 1e9, (1, 2, 3), 2)],
)
def test_the_estimate_of_a_slice_is_tight(radius, modulus, orders, order):
    pytest.importorskip("alphacut.rve.planar.problem")
    phases = [Phase(modulus)]
    found = solve_slice(radius, MATRIX, phases, orders=orders, mesh_size=1.0, order=order)
    exact = square_stiffness(np.array([radius]), MATRIX, phases)
    ratio = found.error / abs(square_moduli(found.stiffness) / square_moduli(exact.matrix[0]) - 1)
    assert TIGHT[0] < ratio.min() < TIGHT[1]


def test_the_estimates_of_rules_in_theta_are_tight():
    coarse = SeriesModel(points=6).solve(PAPER, MATRIX, [PARTICLE])[0]
    ratio = coarse.errors["theta"] / abs(square_moduli(coarse.stiffness) / exact_means() - 1)
    assert (ratio > TIGHT[0]).all()
    assert (ratio < TIGHT[1]).all()


def test_the_prism_estimate_is_tight():
    pytest.importorskip("dolfinx")
    from alphacut.rve.prism.model import PrismModel

    model = PrismModel(mesh_size=0.5, layers=4, stiffness=True, estimate=True)
    result = model.solve(PAPER, MATRIX, [PARTICLE])[0]
    ratio = result.modulus_errors / abs(square_moduli(result.stiffness) / exact_means() - 1)
    assert (ratio > TIGHT[0]).all()
    assert (ratio < TIGHT[1]).all()
