"""The series of circular particles, through `SeriesModel`; of `CIRCLES` how it judges its length."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.fuzzy import FailedError
from alphacut.rve import Phase, SeriesModel, SlicesModel
from alphacut.rve.series.circles import CIRCLES
from alphacut.stochastic import HermiteMap, TruncatedNormal
from tests.refused import refuses
from tests.rve.test_result import Bent, crisp_cell

MATRIX = Phase(20e9)
EXACT = {
    0.2: (0.396401666057, 0.158812312491),
    0.5: (0.467852842132, 0.186140947852),
    0.8: (0.667472541097, 0.255628130639),
}
"""σ11 and σ12 of crisp cells under eq. 15 by radius, in GPa."""


class Jumping:
    """r = 0.4 + 0.02 θ below θ = 0.3 and 0.7 + 0.02 θ from there on."""

    distribution = TruncatedNormal()

    def __call__(self, theta):
        theta = np.asarray(theta, float)
        return np.where(theta < 0.3, 0.4, 0.7) + 0.02 * theta


def random_cells(count, seed, *, highest):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        phases = [
            Phase(20e9 * 10 ** rng.uniform(-3, 3) ** k, rng.uniform(-0.5, 0.49)) for k in (0, 1)
        ]
        yield rng.uniform(0.05, highest), *phases


def largest_difference(a, b):
    return np.max(np.abs(a.moduli / b.moduli - 1))


@pytest.mark.parametrize("radius", EXACT)
def test_twelve_digits_of_an_independent_solution(radius):
    mean = np.array(crisp_cell(radius, MATRIX, Phase(80e9)).curve.mean) / 1e9
    assert mean == pytest.approx(EXACT[radius], abs=6e-13)


@pytest.mark.parametrize("radius", [1e-6, 0.5, 0.99])
def test_homogeneous_cell_is_the_matrix(radius):
    found = crisp_cell(radius, MATRIX, MATRIX).stiffness
    np.testing.assert_allclose(found, MATRIX.stiffness, rtol=1e-14, atol=1e-3)


def test_shift_of_compliances():
    """Cherkaev, Lurie & Milton 1992: S + c·[[0,1,0],[1,0,0],[0,0,−2]] in both phases shifts the
    effective S by just that.
    """
    rotation = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -2.0]])

    def shifted(phase, c):
        a, b, _ = np.linalg.inv(phase.stiffness)[0] + c * rotation[0]
        nu = -b / a / (1 - b / a)  # plane strain: S12 / S11 = −ν / (1 − ν)
        return Phase((1 - nu**2) / a, nu)

    phases, c = (MATRIX, Phase(150e9, 0.1)), 4e-12
    for radius in (0.3, 0.8, 0.95):
        plain = crisp_cell(radius, *phases).stiffness
        moved = crisp_cell(radius, *(shifted(phase, c) for phase in phases)).stiffness
        np.testing.assert_allclose(
            np.linalg.inv(moved), np.linalg.inv(plain) + c * rotation, rtol=1e-12, atol=1e-25
        )


def test_declared_error_holds_and_is_no_fable():
    ratios = []
    for cell in random_cells(80, 2, highest=0.998):
        found, exact = (crisp_cell(*cell, accuracy=accuracy) for accuracy in (1e-4, 1e-12))
        true = largest_difference(found, exact)
        if true > 1e-13:
            ratios.append(found.modulus_errors.max() / true)
    assert len(ratios) > 30
    assert min(ratios) > 1
    assert np.median(ratios) < 30


def test_estimates_of_the_series_and_of_rules_in_theta_are_tight():
    found, exact = (crisp_cell(0.9, MATRIX, Phase(80e9), accuracy=x) for x in (1e-4, 1e-12))
    ratio = found.modulus_errors / abs(found.moduli / exact.moduli - 1)
    assert 1.0 < ratio.min() <= ratio.max() < 1.8
    cell = HermiteMap(0.1337, 0.1, 0.8663, 0.1692), MATRIX, [Phase(80e9)]
    coarse, fine = (model.solve(*cell)[0] for model in (SeriesModel(points=6), SeriesModel()))
    true = abs(coarse.moduli / fine.moduli - 1)
    ratio = coarse.errors["theta"] / true
    assert 1.0 < ratio.min() <= ratio.max() < 1.8


@pytest.mark.parametrize("contrast", [1e-6, 1e6])
@pytest.mark.parametrize("radius", [0.5, 0.98])
def test_extreme_contrast_is_the_limit_of_a_hole_or_a_rigid_disc(radius, contrast):
    near, nearer = (
        crisp_cell(radius, MATRIX, Phase(20e9 * contrast ** (1 + k / 6))) for k in (0, 1)
    )
    assert 1e-9 < largest_difference(near, nearer) < 1e-3


def test_refuses_touching_particles_with_the_error():
    with pytest.raises(
        FailedError, match=r"r = 0.99999 reaches a relative error of .* nearly touch"
    ):
        crisp_cell(0.99999, MATRIX, Phase(20))


@pytest.mark.parametrize("model", [SeriesModel(), SeriesModel(points=40), SlicesModel()])
def test_a_map_that_jumps_is_refused(model):
    with refuses("r at θ = 0.2988"):
        model.solve(Jumping(), MATRIX, [Phase(80e9)])


def test_a_map_that_bends_has_its_error_declared():
    rough, finer = (
        SeriesModel(points=n).solve(Bent(0.3), MATRIX, [Phase(80e9)])[0] for n in (20, 100)
    )
    assert abs(rough.modulus / finer.modulus - 1) < rough.estimated_error < 0.1


@pytest.mark.slow  # rules of more than a thousand nodes
def test_a_map_that_bends_does_not_settle():
    with pytest.raises(FailedError, match="the radius map is not smooth"):
        SeriesModel().solve(Bent(0.3), MATRIX, [Phase(80e9)])


def test_errors_of_the_rules_that_judge_are_declared_too():
    """The truncated series is off by as much in the finer rules, which hides the rule's own."""
    matrix, inclusion = Phase(20e9, 0.1999066306116199), Phase(10699475127752.52, 0.495977377247303)
    radius_map = HermiteMap(
        0.7875875295007674, 0.7644365906291268, 0.44422990978156, 0.4115147381559643
    )
    model = SeriesModel(accuracy=3.067095793873665e-07)
    found, exact = (
        one.solve(radius_map, matrix, [inclusion])[0]
        for one in (model, SeriesModel(accuracy=1e-12))
    )
    assert (abs(found.moduli / exact.moduli - 1) <= sum(found.errors.values())).all()


def test_a_second_series_that_meets_the_first_by_chance_hides_no_error():
    """Of three lengths the second is off by as much as the first; the third, longer, tells."""
    lengths = []

    def by_length(radius, materials, length):
        lengths.append(length)
        return np.full((1, 1, 3), 1.001 if length in lengths[:2] else 1.0)

    series = replace(CIRCLES, moduli=by_length)
    cell = series.converged_moduli(np.array([0.5]), MATRIX, [MATRIX], tolerance=1e-2)
    assert len(set(lengths)) == 3
    assert 1e-3 <= cell.errors.max() <= 1.8e-3
