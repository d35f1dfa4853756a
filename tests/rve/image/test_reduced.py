"""Bounds from a few solves: for any moduli proved, near their own full solve, fast."""

import numpy as np
import pytest

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.reduced import reduced_bounds, widths
from alphacut.rve.image.solve import solve_image

FACTOR = 16.0


def draw(rng, number):
    """K + G/3 and G of two phases within a factor 16, each of shape (number, 2)."""
    bulk, shear = np.exp(rng.uniform(0, np.log(FACTOR), (2, number, 2)))
    return bulk + shear / 3, shear


@pytest.fixture(scope="module")
def labels():
    rng = np.random.default_rng(0)
    places = (np.arange(32) + 0.5) / 32
    grid = sum(
        np.exp(
            -20 * ((places - x + 0.5) % 1 - 0.5) ** 2
            - 20 * ((places[:, None] - y + 0.5) % 1 - 0.5) ** 2
        )
        for x, y in rng.random((5, 2))
    )
    return (grid > 0.6).astype(int)


@pytest.fixture(scope="module")
def reduced(labels):
    return reduced_bounds(labels, *draw(np.random.default_rng(1), 400), solves=10)


def test_bounds_contain_the_full_solve_and_are_nearly_as_narrow(labels, reduced):
    bulk, shear = draw(np.random.default_rng(2), 10)
    lower, upper = reduced.bounds(bulk, shear)
    found = widths(lower, upper)
    for k in range(10):
        full = solve_image(bulk[k][labels], shear[k][labels], solver=ConjugateGradient(1e-9)).bounds
        assert np.linalg.eigvalsh(upper[k] - full.upper)[0] > -1e-6
        assert np.linalg.eigvalsh(full.lower - lower[k])[0] > -1e-6
        assert found[k] < 1.2 * full.width


def test_far_outside_the_range_the_bounds_still_hold(labels, reduced):
    bulk, shear = np.array([[1.0, 900.0]]), np.array([[0.01, 700.0]])
    lower, upper = reduced.bounds(bulk, shear)
    full = solve_image(bulk[0][labels], shear[0][labels]).bounds
    assert np.linalg.eigvalsh(upper[0] - full.upper)[0] >= 0
    assert np.linalg.eigvalsh(full.lower - lower[0])[0] >= 0


def test_at_the_moduli_of_a_solve_the_bounds_are_those_of_the_solve(labels, reduced):
    for bulk, shear in reduced.points[:3]:
        lower, upper = reduced.bounds(bulk[None], shear[None])
        full = solve_image(bulk[labels], shear[labels]).bounds
        assert np.allclose(upper[0], full.upper, rtol=1e-4, atol=1e-5)
        assert np.allclose(lower[0], full.lower, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("side", ["upper", "lower"])
def test_any_combination_of_the_fields_stays_above(reduced, side, monkeypatch):
    part = getattr(reduced, side)
    bulk, shear = draw(np.random.default_rng(3), 50)
    coefficients = part.coefficients(bulk, shear)
    best = part.energy_above(coefficients)
    rng = np.random.default_rng(4)
    shares = part.combination(coefficients)
    shares[:, 3:] += 0.05 * rng.normal(size=shares[:, 3:].shape)
    monkeypatch.setattr(type(part), "combination", lambda self, _: shares)
    assert np.linalg.eigvalsh(part.energy_above(coefficients) - best)[:, 0].min() > 0
