from dataclasses import replace

import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.certificate import CertificateError
from alphacut.rve.spheres.bounds import (
    bulk_and_shear,
    hashin_shtrikman,
    mori_tanaka,
    space_stiffness,
)
from alphacut.rve.spheres.cubic import cubic_moduli, cubic_voigt, hill_average
from alphacut.rve.spheres.result import certified_spheres
from alphacut.rve.spheres.series.model import SphereSeriesModel
from alphacut.stochastic import HermiteMap

MATRIX, STIFF, MAP = Phase(20e9), Phase(80e9), HermiteMap(0.1337, 0.1, 0.8663, 0.1692)


def test_mean_over_theta_is_that_of_a_fine_rule():
    result = SphereSeriesModel().solve(MAP, MATRIX, [STIFF])[0]
    fine = SphereSeriesModel(points=60, accuracy=1e-11).solve(MAP, MATRIX, [STIFF])[0]
    np.testing.assert_allclose(result.moduli, fine.moduli, rtol=1e-9)
    true = abs(result.moduli / fine.moduli - 1)
    assert (true <= result.modulus_errors + 1e-12).all()
    assert abs(result.modulus / fine.modulus - 1) <= result.estimated_error


def test_homogeneous_cell_is_the_matrix():
    result = SphereSeriesModel().solve(MAP, MATRIX, [MATRIX])[0]
    assert result.modulus == pytest.approx(20e9, rel=1e-11)
    assert result.poisson == pytest.approx(0.3, rel=1e-11)
    np.testing.assert_allclose(result.stiffness, space_stiffness(MATRIX), rtol=1e-11, atol=1e-2)


def test_bounds_meet_the_phases_and_mori_and_tanaka():
    for share, phase in ((0.0, MATRIX), (1.0, STIFF)):
        ends = hashin_shtrikman(np.array(share), MATRIX, STIFF)
        np.testing.assert_allclose(ends.T, np.broadcast_to(bulk_and_shear(phase), (2, 2)))
    ends = hashin_shtrikman(np.array(0.2092), MATRIX, STIFF)
    np.testing.assert_allclose(mori_tanaka(np.array(0.2092), MATRIX, STIFF), ends[:, 0])
    np.testing.assert_allclose(mori_tanaka(np.array(0.7908), STIFF, MATRIX), ends[:, 1])
    bulk, shear = ends[:, 0]
    assert hill_average(np.array([bulk, shear, shear]))[0] == pytest.approx(25.78e9, abs=5e6)


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        ((0.9, 1.0, 1.0), "Reuss|Hashin"),
        ((1.08, 1.0, 1.0), "Hashin"),
        ((1.0, 0.97, 0.97), "trace bounds"),
        ((1.0, 3.0, 1.0), "Voigt"),
    ],
)
def test_a_wrong_stiffness_has_no_certificate(factors, words):
    result = SphereSeriesModel(accuracy=1e-6).solve(MAP, MATRIX, [STIFF])[0]
    moduli = cubic_moduli(result.curve.stiffness) * factors
    wrong = replace(result.curve, stiffness=cubic_voigt(*moduli.T))
    with pytest.raises(CertificateError, match=words):
        certified_spheres(replace(result, curve=wrong), MAP, MATRIX, STIFF)


@pytest.mark.parametrize("options", [{"points": 1}, {"accuracy": 1e-12}, {"accuracy": np.nan}])
def test_a_resolution_out_of_range_is_refused(options):
    with pytest.raises(ValueError, match=r"rule in θ has 1|accuracy of the series of spheres"):
        SphereSeriesModel(**options)
