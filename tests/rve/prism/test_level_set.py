"""Particles by the sign of a function of the user's own, on a mesh that ignores them."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve import LevelSetModel, Phase, SeriesModel
from alphacut.stochastic import HermiteMap, TruncatedNormal
from tests.refused import refuses

CONE, LAW = HermiteMap(0.2, 0.1, 0.7, 0.1), TruncatedNormal(-3, 3)
PHASES = {"inclusion": Phase(80e9), "matrix": Phase(20e9)}


def cone(x, y, theta):
    return np.hypot(x, y) - CONE(theta)


def solve(level_set, size, layers=1, law=LAW, phases=PHASES):
    model = LevelSetModel(level_set, size, layers)
    return model.solve(law, phases)[0]


def test_the_cone_of_a_map_is_too_stiff_by_first_order_and_declares_no_error():
    exact = SeriesModel(energies=True).solve(CONE, PHASES["matrix"], [PHASES["inclusion"]])[0]
    results = [solve(cone, size, 4) for size in (0.24, 0.12)]
    errors = [result.modulus / exact.modulus - 1 for result in results]
    assert 0 < errors[1] < errors[0]
    assert 0.5 < np.log2(errors[0] / errors[1]) < 1.6
    right = exact.energies.values[::-1]  # in the order of `PHASES`
    assert abs(results[1].energies.values - right).max() < 0.02 * right.sum(axis=(0, 1)).max()
    assert not results[1].errors
    assert "error of E not declared" in repr(results[1])


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (lambda: solve(lambda x, y, t: np.sqrt(x), 0.5), "level set"),
        (lambda: solve(lambda x, y, t: 1.0, 0.5), "level set"),
        (lambda: solve(lambda x, y, t: np.hypot(x, y) < 0.5, 0.5), "level set"),
        (lambda: solve(lambda x, y, t: (np.hypot(x, y) < 0.5) * 1, 0.5), "level set"),
        (lambda: solve(lambda x, y, t: 500 - np.hypot(x, y), 0.5), "level set"),
        (lambda: solve(lambda x, y, t: np.hypot(x, y) - 500, 0.5), "level set"),
        (lambda: solve(cone, 0.5, law=CONE), "law of θ"),
        (lambda: solve(cone, 0.5, phases={"matrix": Phase(1e9)}), "phase"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_what_is_no_level_set_is_refused(make, key):
    with refuses(key):
        make()
