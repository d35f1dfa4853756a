"""Bounds of cells whose pores percolate, against exact values and against ever finer grids."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from alphacut.base.errors import FailedError
from alphacut.rve import solve_conduction
from alphacut.rve.image.fields import fluxes as of_fluxes
from alphacut.rve.image.fields.fluxes import solve_fluxes
from alphacut.rve.image.fields.forest import Forest, sweep_fluxes
from tests.rve.image.test_bounds import TIGHT
from tests.rve.image.test_conduction import finite_volumes


def porous(rng, size, *, porosity, length=1.5, dimension=3):
    """Whether each voxel is solid, by a periodic Gaussian noise of a correlation length."""
    noise = gaussian_filter(rng.standard_normal((size,) * dimension), length, mode="wrap")
    return noise > np.quantile(noise, porosity)


def refined(image, parts):
    """Each voxel cut into parts along each axis."""
    return np.kron(image, np.ones((parts,) * image.ndim))


LAYER = np.indices((6, 4, 4))[0] > 1
CHANNEL = np.zeros((4, 6, 8), bool)
CHANNEL[:, 2:5, 2:4] = True
BAND = np.indices((8, 8)).sum(0) % 8 < 4


@pytest.mark.parametrize(
    ("image", "exact"),
    [
        (LAYER, [2 / 3, 2 / 3, 0]),
        (LAYER * np.array([1.0, 3.0, 1.0, 3.0]), [1, 4 / 3, 0]),
        (CHANNEL, [0, 0, 6 / 48]),
        (np.zeros((3, 4, 5)) + np.eye(4)[1][:, None], [1 / 4, 0, 1 / 4]),
        (np.indices((4, 4)).sum(0) % 2, [0, 0]),  # squares that touch at corners alone
        (np.indices((4, 4, 4)).sum(0) % 2, [0, 0, 0]),
        (np.pad(np.ones((2, 2, 2)), (0, 2)), [0, 0, 0]),  # an island
    ],
    ids=["layer", "laminate", "channel", "plate", "board", "cubes", "island"],
)
def test_lower_bounds_beside_insulators_are_exact(image, exact, rng):
    sides = (*rng.uniform(0.7, 1.4, image.ndim - 1), 1.0)
    found = solve_conduction(np.asarray(image, float), sides=sides, solver=TIGHT).bounds
    assert found.lower == pytest.approx(np.diag(exact), rel=1e-9, abs=1e-12)
    assert (np.diag(found.lower) <= np.array(exact) * (1 + 1e-15)).all()
    assert (np.diag(found.lower)[np.array(exact) == 0] == 0).all()


def test_a_cross_of_insulators_is_bounded_from_both_sides():
    solid = np.zeros((16,) * 3, bool)
    bar = slice(6, 10)
    solid[bar, bar, :] = solid[bar, :, bar] = solid[:, bar, bar] = True
    low, high = solve_conduction(np.where(solid, 0.0, 1.0)).bounds.mean
    nearly, _ = solve_conduction(np.where(solid, 1e-3, 1.0)).bounds.mean
    assert 0.727 < low < high < 0.742
    assert low < nearly < low + 2e-3


@pytest.mark.parametrize("conductors", [(1.0,), (1.0, 30.0)])
def test_porous_volumes_hold_what_finite_volumes_tend_to(conductors, rng):
    """Two-point values rise with the grid to the limit, and are below the bound on their own."""
    for _ in range(3):
        solid = porous(rng, 8, porosity=rng.uniform(0.3, 0.6), length=1.2)
        image = rng.choice(conductors, solid.shape) * solid
        low, high = solve_conduction(image, solver=TIGHT).bounds.components()[0]
        coarse, middle, fine = (finite_volumes(refined(image, n)) for n in (1, 2, 4))
        limit = fine
        if middle > coarse + 1e-9:
            limit = fine + (fine - middle) ** 2 / max(2 * middle - coarse - fine, 1e-9)
        assert coarse <= low * (1 + 1e-9) + 1e-12
        assert low <= limit * (1 + 1e-9)
        assert fine <= high * (1 + 1e-9)


def test_bounds_beside_insulators_narrow_with_the_grid(rng):
    image = 1.0 * porous(rng, 16, porosity=0.5)
    traces = []
    for parts in (1, 2):
        bounds = solve_conduction(refined(image, parts)).bounds
        traces.append(bounds.mean.upper / bounds.mean.lower - 1)
    assert traces[0] < 0.2
    assert traces[1] < traces[0] / 1.8


@pytest.mark.parametrize("shape", [(1, 7), (2, 5), (9, 8), (1, 4, 5), (2, 3, 4), (6, 5, 7)])
def test_any_whole_fluxes_balance_once_they_are_swept(shape, rng):
    solid = rng.random(shape) < 0.6
    trees = Forest.of_mask(solid)
    whole = rng.integers(-(1 << 40), 1 << 40, (len(shape), *shape))
    for axis in range(len(shape)):
        whole[axis] *= solid & np.roll(solid, -1, axis)
    swept = whole.reshape(len(shape), -1).copy()
    sweep_fluxes(trees.shape, trees.order, trees.parents, swept)
    swept = swept.reshape(whole.shape)
    assert not sum(flux - np.roll(flux, 1, axis) for axis, flux in enumerate(swept)).any()


def test_fluxes_that_do_not_balance_are_an_error(monkeypatch, rng):
    def leaves_one(shape, order, parents, fluxes):
        sweep_fluxes(shape, order, parents, fluxes)
        fluxes[0, order[0]] += 1

    monkeypatch.setattr(of_fluxes, "sweep_fluxes", leaves_one)
    with pytest.raises(FailedError, match="do not balance"):
        solve_fluxes(1.0 * porous(rng, 6, porosity=0.3), (1.0,) * 3, solver=TIGHT)
