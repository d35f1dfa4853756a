"""Series of random spheres: declared errors beside finer rules."""

import numpy as np
import pytest

from alphacut.rve import Phase, SpheresModel
from alphacut.stochastic import HermiteMap
from tests.calibration.declared import Calibration, free_seed


def phases(rng):
    """A matrix and an inclusion, stiffer or softer by up to a thousand."""
    ratio = 10.0 ** rng.uniform(-3, 3)
    first, second = rng.uniform(-0.2, 0.45, 2)
    return Phase(1e9, float(first)), Phase(1e9 * ratio, float(second))


@pytest.mark.slow
def test_declared_errors_of_rules_cover_the_true_ones():
    """Rules in θ of few nodes and of rough accuracy beside a rule a million times finer."""
    seed = free_seed("rules of spheres")
    table = Calibration("Mean moduli of spheres", seed)
    for k in range(60):
        rng = np.random.default_rng([seed, k])
        a1, a3 = np.sort(rng.uniform(0.1, 0.85, 2))
        slopes = (a3 - a1) * rng.uniform(0, 2.9, 2)
        radius_map, (matrix, inclusion) = HermiteMap(a1, slopes[0], a3, slopes[1]), phases(rng)
        accuracy = 10.0 ** rng.uniform(-8, -2)
        rough, fine = (
            SpheresModel(accuracy=one).solve(radius_map, matrix, [inclusion])[0]
            for one in (accuracy, 1e-11)
        )
        declared = rough.moduli * sum(np.asarray(error) for error in rough.errors.values())
        true = np.abs(rough.moduli - fine.moduli)
        table.estimated("K, shear", declared, true, size=fine.moduli, case=k)
    table.judge()
