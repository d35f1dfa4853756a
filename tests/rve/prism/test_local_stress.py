"""Local stresses of the product-space model: statistics by their identities, the interface by
equilibrium.
"""

import numpy as np
import pytest

pytest.importorskip("dolfinx")

from alphacut.rve.cell import Phase
from alphacut.rve.prism.model import PrismModel
from alphacut.stochastic import HermiteMap

PAPER = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)
MATRIX, PARTICLE = Phase(20e9), Phase(80e9)


@pytest.fixture(scope="module")
def local():
    return PrismModel(mesh_size=0.15, layers=6).local_stress(PAPER, MATRIX, PARTICLE)


def test_the_mean_is_the_homogenised_stress(local):
    s11, s12 = PrismModel(mesh_size=0.15, layers=6).solve(PAPER, MATRIX, [PARTICLE])[0].curve.mean
    assert local.whole.mean[0, 0] == pytest.approx(s11, rel=1e-12)
    assert local.whole.mean[2, 1] == pytest.approx(s12, rel=1e-12)


def test_spread_is_ordered_and_the_stiff_particle_carries_more(local):
    whole = local.whole
    assert (whole.least <= whole.mean).all()
    assert (whole.mean <= whole.greatest).all()
    assert (whole.deviation > 0).all()
    assert local.particle.mean[0, 0] > local.matrix.mean[0, 0]


def crisp_jump(size):
    return (
        PrismModel(mesh_size=size, layers=1)
        .local_stress(HermiteMap(0.5, 0, 0.5, 0), MATRIX, PARTICLE)
        .interface.jump
    )


def test_tractions_of_the_two_sides_meet_with_order_two():
    coarse, fine = crisp_jump(0.08), crisp_jump(0.04)
    assert fine < 5e-3
    assert 1.3 < np.log2(coarse / fine) < 2.7


def test_normal_traction_has_the_squares_symmetry(local):
    for row, angle in zip(local.interface.normal[:, :, 0], local.interface.angle, strict=True):
        turned = np.interp(angle, angle - np.pi / 2, row, period=2 * np.pi)
        assert abs(turned - row).max() < 0.15 * abs(row).max()


def test_shear_tractions_leave_no_moment_on_the_particle(local):
    shear, normal = local.interface.shear, local.interface.normal
    assert abs(shear.mean(axis=1)).max() < 0.01 * abs(normal).max()
    assert abs(shear).max() > 0.1 * abs(normal).max()  # not because there are none


def test_a_mesh_that_ignores_the_interface_has_no_tractions_to_show():
    local = PrismModel(mesh_size=0.3, layers=2, interface="sign").local_stress(
        PAPER, MATRIX, PARTICLE
    )
    assert local.interface is None
    assert local.whole.mean[0, 0] == pytest.approx(0.48e9, rel=0.1)
