"""Series of random spheres beside finite elements from above, Hashin and Shtrikman, finer rules."""

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.result.bounds import hashin_shtrikman
from alphacut.rve.spheres.model import SphereSeriesModel, cubic_stiffness
from alphacut.rve.spheres.result import volume_fraction
from alphacut.stochastic import HermiteMap
from tests.calibration.declared import Calibration, free_seed

GEOMETRY = 1e-5  # of a modulus: curved tetrahedra of second order are not quite a ball


def phases(rng):
    """A matrix and an inclusion, stiffer or softer by up to a thousand."""
    ratio = 10.0 ** rng.uniform(-3, 3)
    first, second = rng.uniform(-0.2, 0.45, 2)
    return Phase(1e9, float(first)), Phase(1e9 * ratio, float(second))


@pytest.mark.slow
def test_moduli_lie_between_a_bound_and_finite_elements():
    pytest.importorskip("alphacut.rve.fenicsx")
    from tests.rve.spheres.octant import Octant

    seed = free_seed("spheres")
    table = Calibration("Spheres beside finite elements", seed)
    for k in range(16):
        rng = np.random.default_rng([seed, k])
        radius, (matrix, inclusion) = float(rng.uniform(0.3, 0.8)), phases(rng)
        exact = cubic_stiffness(np.array([radius]), matrix, [inclusion]).moduli[0, 0]
        above = Octant(radius, 0.25).moduli(matrix, inclusion) * (1 + GEOMETRY)
        share = volume_fraction(radius)
        bulk = hashin_shtrikman(np.array([1 - share, share]), [matrix, inclusion], space=True)[0]
        low = np.array([bulk[0], 0.0, 0.0])
        case = f"{k}: radius {radius:.3f}, {matrix}, {inclusion}"
        only = {"most": np.inf, "case": case}  # bounds of many arrangements, of which this is one
        table.guaranteed("K", (low[0], above[0]), (exact[0],) * 2, size=above[0], **only)
        table.guaranteed("K, both bounds", bulk, (exact[0],) * 2, size=bulk[1], **only)
        near = above[1:] / 1.03, above[1:]  # elements of this size are right to 3 %
        table.guaranteed("shear", near, (exact[1:],) * 2, size=above[1:], case=case)
    table.judge()


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
            SphereSeriesModel(accuracy=one).solve(radius_map, matrix, [inclusion])[0]
            for one in (accuracy, 1e-11)
        )
        declared = rough.moduli * sum(np.asarray(error) for error in rough.errors.values())
        true = np.abs(rough.moduli - fine.moduli)
        table.estimated("K, shear", declared, true, size=fine.moduli, case=k)
    table.judge()


def test_a_declared_error_of_nothing_fails():
    table = Calibration("no error", 0)
    table.estimated("K", np.zeros(3), np.full(3, 1e-3))
    with pytest.raises(AssertionError, match="K"):
        table.judge()
