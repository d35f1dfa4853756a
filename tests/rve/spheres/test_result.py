from dataclasses import replace

import numpy as np
import pytest

from alphacut.rve import Phase, SpheresModel
from alphacut.rve.result.checks import CertificateError
from alphacut.rve.result.moduli import hashin_shtrikman, mori_tanaka
from alphacut.rve.spheres.result import cubic_moduli, cubic_voigt, hill_average, spheres_with_checks
from alphacut.stochastic import HermiteMap

MATRIX, STIFF, MAP = Phase(20e9), Phase(80e9), HermiteMap(0.1337, 0.1, 0.8663, 0.1692)


def test_mean_over_theta_is_that_of_a_fine_rule():
    result = SpheresModel().solve(MAP, MATRIX, [STIFF])[0]
    fine = SpheresModel(points=60, accuracy=1e-11).solve(MAP, MATRIX, [STIFF])[0]
    np.testing.assert_allclose(result.moduli, fine.moduli, rtol=1e-9)
    true = abs(result.moduli / fine.moduli - 1)
    assert (true <= result.modulus_errors + 1e-12).all()
    assert abs(result.modulus / fine.modulus - 1) <= result.estimated_error


def test_bounds_meet_the_phases_and_mori_and_tanaka():
    for share, phase in ((0.0, MATRIX), (1.0, STIFF)):
        ends = hashin_shtrikman(np.array([1 - share, share]), [MATRIX, STIFF], space=True)
        np.testing.assert_allclose(ends.T, np.broadcast_to(phase.bulk_and_shear, (2, 2)))
    ends = hashin_shtrikman(np.array([0.7908, 0.2092]), [MATRIX, STIFF], space=True)
    for k, (share, phases) in enumerate([(0.2092, [MATRIX, STIFF]), (0.7908, [STIFF, MATRIX])]):
        estimate = mori_tanaka(np.array(share), phases, space=True)
        np.testing.assert_allclose(estimate, ends[:, k])
    bulk, shear = ends[:, 0]
    assert hill_average(np.array([bulk, shear, shear]))[0] == pytest.approx(25.78e9, abs=5e6)


@pytest.mark.parametrize(
    ("factors", "words"),
    [((0.9, 1.0, 1.0), "Reuss|Hashin"), ((1.08, 1.0, 1.0), "Hashin"), ((1.0, 3.0, 1.0), "Voigt")],
)
def test_a_wrong_stiffness_has_no_certificate(factors, words):
    result = SpheresModel(accuracy=1e-6).solve(MAP, MATRIX, [STIFF])[0]
    moduli = cubic_moduli(result.curve.stiffness) * factors
    wrong = replace(result.curve, stiffness=cubic_voigt(*moduli.T))
    with pytest.raises(CertificateError, match=words):
        spheres_with_checks(replace(result, curve=wrong))
