"""The certificate: green on right results, red on each way of being wrong."""

import numpy as np
import pytest

from alphacut.rve import LOADS, Phase
from alphacut.rve.result.checks import CertificateError, checks_within_limits, stress_checks
from alphacut.stochastic import HermiteMap

SOFT, HARD = Phase(20e9), Phase(80e9, 0.2)
PAIR = SOFT.stiffness, HARD.stiffness
PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)


def shares(fraction):
    """Area fractions of both phases from that of the second."""
    return np.stack([1 - fraction, fraction])


def layered(fraction):
    """Stiffness of a laminate in direction 1 by the exact mixture rules of its continuous fields."""
    a, b = SOFT.stiffness, HARD.stiffness
    share = shares(fraction)
    c = np.stack([a, b])
    c11 = 1 / (share / c[:, 0, 0]).sum()
    ratio = share @ (c[:, 0, 1] / c[:, 0, 0])
    c22 = share @ (c[:, 1, 1] - c[:, 0, 1] ** 2 / c[:, 0, 0]) + ratio**2 * c11
    return np.array(
        [[c11, ratio * c11, 0], [ratio * c11, c22, 0], [0, 0, 1 / (share / c[:, 2, 2]).sum()]]
    )


def voigt(fraction):
    return np.tensordot(shares(fraction), PAIR, axes=1)


def reuss(fraction):
    return np.linalg.inv(np.tensordot(shares(fraction), np.linalg.inv(PAIR), axes=1))


def checks_of(stress, loads, fraction=0.4):
    return stress_checks(stress[None], loads, shares(fraction)[:, None], np.ones(1), (SOFT, HARD))


@pytest.mark.parametrize("fraction", [0.0, 0.2, 0.7, 1.0])
def test_bounds_enclose_a_laminate_and_close_at_the_ends(fraction):
    exact = checks_of(layered(fraction), np.eye(3), fraction)
    assert max(exact["reuss"], exact["voigt"]) < 1e-12
    for name, factor in (("reuss", 0.999), ("voigt", 1.001)):
        found = checks_of(factor * layered(fraction), np.eye(3), fraction)[name]
        assert found > 1e-4 or fraction not in (0.0, 1.0)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda c: c + np.triu(np.ones((3, 3)), 1) * 1e6, "not symmetric"),
        (lambda c: reuss(0.4) * 0.99, "below the Reuss bound"),
        (lambda c: voigt(0.4) * 1.01, "above the Voigt bound"),
        (lambda c: voigt(0.4) * 0.9999, "outside the Hashin–Shtrikman bounds"),
        (lambda c: c * np.nan, "is allowed; do not use this result"),
    ],
)
def test_a_wrong_stiffness_is_refused_by_name(wrong, message):
    c = layered(0.4)
    with pytest.raises(
        (CertificateError, np.linalg.LinAlgError), match=f"{message}|did not converge"
    ):
        checks_within_limits(checks_of(wrong(c), np.eye(3)))


def test_two_loads_see_the_bulk_modulus_of_the_whole_stiffness():
    c = voigt(0.4) * 0.9999
    whole, seen = checks_of(c, np.eye(3)), checks_of(c @ LOADS.T, LOADS)
    assert whole["hashin_shtrikman"] == pytest.approx(seen["hashin_shtrikman"], rel=1e-9)
    assert whole["hashin_shtrikman"] > 0


class TestProductSpace:
    """The same on the finite element model, broken on purpose."""

    def solve(self, **options):
        pytest.importorskip("alphacut.rve.fenicsx")
        from alphacut.rve import PrismModel

        options = {"mesh_size": 0.4, "layers": 3, "stiffness": True, **options}
        return PrismModel(**options).solve(PAPER, SOFT, [HARD])[0]

    def test_green_with_every_property_measured(self):
        checks = self.solve().checks
        algebraic = {"residual", "hill_mandel", "symmetry"}
        assert set(checks) == algebraic | {"reuss", "voigt", "hashin_shtrikman"}
        assert max(checks[k] for k in algebraic) < 2e-8
        assert max(checks[k] for k in ("reuss", "voigt")) == 0

    def test_a_solver_stopped_early_is_found_though_it_claims_success(self):
        with pytest.raises(CertificateError, match=r"linear system is not solved|Hill.Mandel"):
            self.solve(petsc={"ksp_rtol": "1e-2"})
