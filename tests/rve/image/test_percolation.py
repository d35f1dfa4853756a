"""Bounds of cells whose pores percolate, against exact values and against ever finer grids."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from alphacut.base.errors import FailedError
from alphacut.fuzzy import Triangular
from alphacut.rve import GreyImage, fuzzy_image_conductivity, solve_conduction, solve_image
from alphacut.rve.image import memory
from alphacut.rve.image.fields import equilibrium
from alphacut.rve.image.fields import fluxes as of_fluxes
from alphacut.rve.image.fields.element import element_of
from alphacut.rve.image.fields.equilibrium import solve_stresses
from alphacut.rve.image.fields.fluxes import solve_fluxes
from alphacut.rve.image.fields.forest import Forest, Percolation, sweep_fluxes
from alphacut.rve.image.fields.nodes import NodeCopies
from alphacut.rve.image.fields.split import SplitGrid
from alphacut.rve.image.phases import ModuliImages
from tests.refused import refuses
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


@pytest.mark.parametrize(
    ("image", "axes", "isolated", "thickness"),
    [
        (LAYER, (False, True, True), 0, 4),
        (CHANNEL, (True, False, False), 0, 2 * 6 / 10),
        (BAND, (True, True), 0, 4 * 8 / 16),  # its path leads on along both axes at once
        (np.indices((4, 4)).sum(0) % 2 == 0, (False, False), 1, 1 / 2),
        (np.pad(np.ones((1, 2), bool), ((1, 2), (2, 3))), (False, False), 1, 4 / 6),
        (np.arange(8)[:, np.newaxis] % 4 < [1, 1], (False, True), 0, 1),
        (np.array([[1, 1, 1, 1], [0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 0]]) > 0, (False, True), 1 / 5, 10 / 12),
    ],
    ids=["layer", "channel", "band", "board", "island", "layers", "beside"],
)  # fmt: skip
def test_what_solids_connect(image, axes, isolated, thickness):
    found = Percolation.of_mask(image)
    assert found.axes == axes
    assert found.isolated == pytest.approx(isolated)
    assert found.thickness == pytest.approx(thickness)


def test_a_solid_without_pores_connects_all():
    assert Percolation.of_mask(np.ones((2, 3), bool)) == ((True, True), 0.0, np.inf)


def test_a_layer_has_no_tortuosity_along_it_and_infinite_across():
    volume = GreyImage(np.where(LAYER, 2.0, 1.0), (1e-6,) * 3)
    found = fuzzy_image_conductivity(
        volume, [0.0, Triangular(2, 3, 5)], labels=[1, 2], alpha=(0, 1)
    )
    assert found.tortuosity["tau_x"] == pytest.approx(np.ones((2, 2)), rel=1e-9)
    assert (found.tortuosity["tau_z"][:, 1] == np.inf).all()
    assert (found.tortuosity["tau_z"][:, 0] > 1e9).all()  # the solver leaves k below 1e-9
    several = fuzzy_image_conductivity(volume, [0.1, 3.0], labels=[1, 2], alpha=(1,))
    with refuses("conductivities"):
        _ = several.tortuosity


def test_an_open_threshold_leaves_tortuosity_and_fraction_open():
    """A channel whose wall is grey: as wide as 3 or 4 of 8 pixels, it is straight either way."""
    grey = np.tile([0.0, 0, 9, 9, 9, 5, 0, 0], (8, 1))
    image = GreyImage(grey, (1e-6, 1e-6))
    found = fuzzy_image_conductivity(
        image, [0.0, 7.0], thresholds=[Triangular(2, 6, 8)], alpha=(0, 1)
    )
    assert found.tortuosity["tau_y"][0] == pytest.approx([3 / 4, 4 / 3], rel=1e-9)
    assert found.tortuosity["tau_y"][1] == pytest.approx([1, 1], rel=1e-9)


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
        # Where nothing percolates, all are 0, the reference as far as it is solved.
        rounding = 1e-9 * max(conductors)
        assert coarse <= low * (1 + 1e-9) + rounding
        assert low <= limit * (1 + 1e-9) + rounding
        assert fine <= high * (1 + 1e-9) + rounding


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
        solve_fluxes(1.0 * porous(rng, 4, porosity=0.3), (1.0,) * 3, solver=TIGHT)


# stiffness


@pytest.mark.parametrize("soft", [0.0, 0.1])
def test_fields_of_a_large_grid_wait_in_files_and_prove_the_same(soft, monkeypatch, rng):
    stiffness = np.where(porous(rng, 5, porosity=0.3), 1.0, soft)
    bounds = [solve_image(stiffness / 1.2, stiffness / 2.6)]
    monkeypatch.setattr(memory, "IN_FILES", 1)
    bounds.append(solve_image(stiffness / 1.2, stiffness / 2.6))
    assert isinstance(bounds[1].upper.fields, np.memmap)
    for end in ("lower", "upper"):
        assert np.array_equal(*(getattr(x.bounds, end) for x in bounds))


def moduli(phase, young, nu=0.3):
    """Bulk and shear modulus of each voxel; phase 0 is a pore."""
    stiffness = np.array([0.0, *young])[phase]
    shear = stiffness / (2 * (1 + nu))
    bulk = stiffness / (3 * (1 - 2 * nu)) + (shear / 3 if phase.ndim == 2 else 0)
    return np.array([bulk, shear])


@pytest.mark.parametrize("shape", [(1, 6), (2, 5), (7, 6), (1, 4, 5), (2, 3, 4), (5, 3, 4)])
def test_any_whole_tractions_balance_once_they_are_swept(shape, rng):
    """Also of pieces that meet their own image, where forces around loops are needed."""
    solid = rng.random(shape) < 0.75
    solid.ravel()[0] = True
    grid = equilibrium._Grid.of_moduli(moduli(solid.astype(int), (1.0,)), (1.0,) * len(shape))
    d = len(shape)
    whole = rng.integers(-(1 << 30), 1 << 30, (len(grid.shear), d, d**2))
    for axis in range(d):
        whole[grid.above[axis] < 0, axis] = 0
    balanced = grid.balanced(whole, 1.0).tractions  # which raises if it is not
    assert not any(balanced[grid.above[axis] < 0, axis].any() for axis in range(d))
    forces = balanced[:, :, :d].sum(axis=0)
    assert np.array_equal(forces, forces.T)  # the mean stress is symmetric


def test_stresses_that_are_not_in_equilibrium_are_an_error(monkeypatch, rng):
    """One unit of 2⁻⁴⁰ of the largest traction is enough."""
    sweep = equilibrium._sweep

    def leaves_one(order, parents, above, below, tractions):
        sweep(order, parents, above, below, tractions)
        linked = np.flatnonzero(above[0] >= 0)
        tractions[linked[0], 0, 0] += 1

    monkeypatch.setattr(equilibrium, "_sweep", leaves_one)
    image = moduli(porous(rng, 5, porosity=0.3).astype(int), (1.0,))
    with pytest.raises(FailedError, match=r"not in equilibrium|no loop"):
        solve_stresses(image, (1.0,) * 3, solver=TIGHT)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_channel_and_layers_are_exact(dimension, rng):
    """Bars that pass through carry uniaxial stress, layers biaxial stress: nothing across them."""
    phase = np.zeros((4, 5, 6)[:dimension], int)
    phase[:, 1:4] = 1
    sides = (*rng.uniform(0.7, 1.4, dimension - 1), 1.0)
    young, nu = 2.0, rng.uniform(-0.5, 0.45)
    bounds = solve_image(*moduli(phase, (young,), nu), sides=sides, solver=TIGHT).bounds
    exact = np.zeros_like(bounds.lower)
    if dimension == 2:
        exact[1, 1] = young / (1 - nu**2)
    else:  # across y, with the stresses 11, 33 and 13
        plane = young / (1 - nu**2)
        exact[np.ix_([0, 2], [0, 2])] = [[plane, nu * plane], [nu * plane, plane]]
        exact[4, 4] = young / (2 * (1 + nu))
    exact *= 3 / 5
    assert bounds.lower == pytest.approx(exact, abs=1e-7 * young)


@pytest.mark.parametrize(("young", "porosity"), [((1.0,), 0.4), ((1.0, 10.0), 0.5)])
def test_lower_bounds_of_porous_volumes_rise_with_the_grid_below_the_upper_ones(
    young, porosity, rng, monkeypatch
):
    # A few steps come near the best stresses, which alone rise for every draw.
    monkeypatch.setattr(equilibrium, "MAX_STEPS", 300)
    monkeypatch.setattr(equilibrium, "LEAST_GAIN", 1e-8)
    solid = porous(rng, 4, porosity=porosity, length=1.2)
    phase = solid * (1 + (len(young) - 1) * porous(rng, 4, porosity=0.5, length=1.2))
    nu = rng.uniform(-0.5, 0.45)
    coarse, fine = (
        solve_image(*moduli(refined(phase, n).astype(int), young, nu), solver=TIGHT).bounds
        for n in (1, 2)
    )
    margin = 1e-5 * np.trace(fine.upper)
    # Stresses on the coarse grid are among those on the fine one.
    assert np.linalg.eigvalsh(fine.lower - coarse.lower)[0] > -margin
    assert np.linalg.eigvalsh(fine.upper - coarse.lower)[0] > -margin
    assert np.linalg.eigvalsh(coarse.upper - fine.upper)[0] > -margin
    gaps = [np.trace(x.upper - x.lower) / np.trace(x.upper) for x in (coarse, fine)]
    assert gaps[1] < gaps[0] / 1.3


SLENDER = """
..##.#####.###..
..############..
..#.###.##..##..
.##..##.....##..
#######......###
#######......###
#######.....####
#####.#....#####
#.###.#..#######
..#..##.########
###......#######
###..#...#######
#######..#######
######...#######
.####....#####..
.###..###..###..
"""


def test_slender_ligaments_carry_no_less_on_a_finer_grid():
    """They are soft beside their material: the coarse system is solved for that."""
    solid = np.array([[x == "#" for x in row] for row in SLENDER.split()]).astype(int)
    lower = [
        solve_image(*moduli(refined(solid, n).astype(int), (1.0,), -0.4011076)).bounds.lower
        for n in (2, 4)
    ]
    assert (np.diag(lower[1]) > 0.99 * np.diag(lower[0])).all()


@pytest.mark.parametrize("soft", [0.0, 1e-4])
def test_squares_that_touch_at_corners_are_apart_beside_void_alone(soft):
    """A checkerboard of 1 and k conducts √k (Keller 1964), and nothing where k is 0."""
    board = np.kron([[1.0, soft], [soft, 1.0]], np.ones((8, 8)))
    low, high = solve_conduction(board, solver=TIGHT).bounds.mean
    assert low <= np.sqrt(soft) <= high
    if not soft:
        assert high < 1e-9
    cubes = np.where(np.indices((4, 4, 4)).sum(0) % 2, 1.0, soft)
    low, high = solve_conduction(refined(cubes, 2), solver=TIGHT).bounds.mean
    assert low <= high
    assert high < 1e-9 or soft


def test_nodes_are_split_beside_void_and_not_beside_a_soft_phase(rng):
    """A phase of any modulus above 0 conducts through the node: what splits it would be below."""
    solid = np.indices((4, 4)).sum(0) % 2 == 1
    split = NodeCopies.of_mask(solid)
    whole = NodeCopies.of_mask(np.ones_like(solid))
    assert len(split.places) == 2 * solid.size
    assert np.array_equal(whole.places, np.arange(solid.size))
    element = element_of((1.0, 1.0), dual=False, conduction=True)
    for soft, copies in ((0.0, solid.size), (1e-9, 0)):
        board = np.where(solid, 1.0, soft)
        assert len(SplitGrid.of_coefficients(element, [board]).places) == copies
    images = ModuliImages(np.where(solid, 1.0, 0.0)[None], np.where(solid, 1.0, 1e-9)[None])
    assert not images.moduli_of_fields(dual=True)[0][~solid].any()
    assert images.moduli_of_fields(dual=False)[0][~solid].all()


@pytest.mark.parametrize("dimension", [2, 3])
def test_islands_thin_cells_and_single_pores_have_ordered_bounds(dimension, rng):
    shape = (6, 5, 4)[:dimension]
    island = np.zeros(shape, int)
    island[tuple(slice(1, 3) for _ in shape)] = 1
    one_pore = np.ones(shape, int)
    one_pore[(2,) * dimension] = 0
    thin = (rng.random((1, *shape[1:])) < 0.7).astype(int)
    thin.ravel()[0] = 1
    touching = np.zeros(shape, int)
    touching[(slice(0, 2),) * dimension] = touching[(slice(2, 4),) * dimension] = 1
    for phase in (island, one_pore, thin, touching):
        bounds = solve_image(*moduli(phase, (1.0,))).bounds
        assert np.linalg.eigvalsh(bounds.lower)[0] > -1e-12
        assert np.linalg.eigvalsh(bounds.upper - bounds.lower)[0] > -1e-12
        if phase is island or phase is touching:
            assert not bounds.lower.any()
            assert abs(bounds.upper).max() < 1e-5
        if phase is one_pore:
            assert bounds.has_lower
