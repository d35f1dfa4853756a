"""Proved bounds of images and volumes: exact cases, symmetries, an independent solver, losses; and
their cuts, of a fuzzy threshold, of fuzzy phases and of phases without order.

The last part takes the bounds from the energies one by one: inverses, averages, losses. Their
margins for rounding are tight within a factor of two somewhere, so that halving one, or leaving it
out, turns its test red.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from alphacut.fuzzy import FailedError, Triangular
from alphacut.rve import GreyImage, Phase, SpheresModel, fuzzy_image_stiffness, solve_image
from alphacut.rve.image.bounds import (
    Enclosure,
    StiffnessBounds,
    _exact_inverse,
    hill_mean,
    inverse_above,
    inverse_below,
    residual_above,
)
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.losses import energy_fractions, mean_loss
from alphacut.rve.image.model import ImageModel, usual_division
from alphacut.rve.image.phases import (
    ModuliImages,
    ModuliInterval,
    PhaseModuli,
    moduli_images,
    require_phases,
    threshold_ranges,
)
from alphacut.stochastic import HermiteMap
from tests.refused import refuses

TIGHT = ConjugateGradient(accuracy=1e-12)
UNIT = 2.0**-53
LOST = UNIT * (1 - 2.0**-20)  # just too little to change 1


def voxels(rng, shape, *, contrast, count=2):
    """Phase of each voxel, smooth at random, and moduli (K, G) of the phases."""
    noise = rng.normal(size=shape)
    for axis in range(3):
        noise = noise + np.roll(noise, 1, axis)
    edges = np.quantile(noise, np.sort(rng.uniform(0.2, 0.8, count - 1)))
    young = contrast ** np.linspace(0, 1, count)
    nu = rng.uniform(0.0, 0.4, count)
    moduli = np.array([young / (3 * (1 - 2 * nu)), young / (2 * (1 + nu))])
    return np.searchsorted(edges, noise), rng.permuted(moduli, axis=1)


def isotropic(bulk, shear):
    stiffness = np.zeros((6, 6))
    stiffness[:3, :3] = bulk - 2 / 3 * shear
    return stiffness + shear * np.diag([2, 2, 2, 1, 1, 1])


def laminate(axis, fractions, moduli):
    """Exact stiffness of layers across an axis: stress across and strain along them are uniform."""
    across = [k for k in range(6) if k in (axis, *({3, 4, 5} - {3 + axis}))]
    along = [k for k in range(6) if k not in across]
    parts = [np.zeros(shape) for shape in ((3, 3), (3, 3), (3, 3))]
    for fraction, pair in zip(fractions, moduli.T, strict=True):
        c = isotropic(*pair)
        inverse = np.linalg.inv(c[np.ix_(across, across)])
        coupling = inverse @ c[np.ix_(across, along)]
        free = c[np.ix_(along, along)] - c[np.ix_(along, across)] @ coupling
        for part, value in zip(parts, (inverse, coupling, free), strict=True):
            part += fraction * value
    stiffness = np.zeros((6, 6))
    stiff = np.linalg.inv(parts[0])
    stiffness[np.ix_(across, across)] = stiff
    stiffness[np.ix_(across, along)] = stiff @ parts[1]
    stiffness[np.ix_(along, across)] = parts[1].T @ stiff
    stiffness[np.ix_(along, along)] = parts[2] + parts[1].T @ stiff @ parts[1]
    return stiffness


@pytest.mark.parametrize(
    ("axis", "contrast", "width"),
    [(0, 1e-3, 2), (1, 10.0, 2), (2, 1e6, 2), (0, 10.0, 1), (1, 10.0, 1), (2, 10.0, 1)],
)
def test_bounds_of_laminates_meet_at_their_exact_stiffness(axis, contrast, width, rng):
    layers = np.array([0, 1, *rng.integers(0, 2, 4)])
    phase = np.moveaxis(np.broadcast_to(layers, (width, width, 6)), 2, 2 - axis)
    moduli = np.array([[1.0, 1.7 * contrast], [0.6, 0.5 * contrast]])
    fractions = np.bincount(layers) / 6
    sides = (*rng.uniform(0.7, 1.4, 2), 1.0)
    bounds = solve_image(*moduli[:, phase], sides=sides, solver=TIGHT).bounds
    assert bounds.width < 1e-9
    assert bounds.contains(laminate(axis, fractions, moduli))


def test_mixtures_of_one_shear_modulus_have_hills_bulk_modulus(rng):
    for _ in range(4):
        phase, (bulk, shear) = voxels(rng, rng.integers(4, 9, 3), contrast=20.0, count=3)
        shear = np.full(3, shear[0])
        fractions = np.bincount(phase.ravel(), minlength=3) / phase.size
        exact = 1 / (fractions @ (1 / (bulk + 4 / 3 * shear))) - 4 / 3 * shear[0]
        bounds = solve_image(bulk[phase], shear[phase]).bounds
        assert bounds.contains(isotropic(exact, shear[0]))


def turned(axes, signs):
    """Matrix of Voigt strains when axes are exchanged and mirrored."""
    turn = np.eye(3)[list(axes)] * np.array(signs)[:, None]
    pairs = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)]
    matrix = np.zeros((6, 6))
    for column, (a, b) in enumerate(pairs):
        strain = np.zeros((3, 3))
        strain[a, b] = strain[b, a] = 1 if a == b else 0.5
        new = turn @ strain @ turn.T
        matrix[:, column] = [new[i, j] * (1 if i == j else 2) for i, j in pairs]
    return matrix


def test_exchanged_mirrored_and_shifted_axes_give_the_same_bounds(rng):
    phase, moduli = voxels(rng, (5, 6, 7), contrast=5.0)
    sides = {"x": 1.0, "y": 0.8, "z": 1.3}
    first = solve_image(*moduli[:, phase], sides=(1.3, 0.8, 1.0), solver=TIGHT).bounds
    moved = np.roll(phase, (2, -1, 3), (0, 1, 2)).transpose(1, 2, 0)[:, ::-1]  # axes y, −x, z
    new_sides = sides["y"], sides["x"], sides["z"]
    second = solve_image(*moduli[:, moved], sides=new_sides, solver=TIGHT).bounds
    turn = turned((2, 0, 1), (1, -1, 1))  # new x, y, z are z, −x, y
    for old, new in ((first.lower, second.lower), (first.upper, second.upper)):
        inverse = np.linalg.inv(turn)
        assert inverse.T @ old @ inverse == pytest.approx(new, abs=1e-10 * np.abs(new).max())


def finite_elements(bulk, shear, sides, parts):
    """Stiffness, (6, 6), by trilinear elements, assembled at Gauss points and factorised."""
    bulk, shear = (np.kron(x, np.ones((parts,) * 3)) for x in (bulk, shear))
    shape, h = bulk.shape, np.array(sides[::-1])
    corners = np.array([(a, b, c) for a in (0, 1) for b in (0, 1) for c in (0, 1)])  # z, y, x
    local, means = np.zeros((2, 24, 24)), np.zeros((2, 6, 24))
    trace = np.outer([1, 1, 1, 0, 0, 0], [1, 1, 1, 0, 0, 0])
    deviator = np.diag([2, 2, 2, 1, 1, 1]) - 2 / 3 * trace
    points = (1 + np.array([-1, 1]) / np.sqrt(3)) / 2
    for point in np.array(np.meshgrid(points, points, points)).reshape(3, -1).T:
        value = np.where(corners, point, 1 - point)
        slope = np.stack([np.prod(np.where(np.arange(3) == k, np.where(corners, 1, -1), value), axis=1)
                          for k in (2, 1, 0)]) / h[:, None]  # fmt: skip
        strain = np.zeros((6, 24))
        for k in range(3):
            strain[k, k::3] = slope[k]
        for row, (i, j) in zip((3, 4, 5), ((1, 2), (0, 2), (0, 1)), strict=True):
            strain[row, i::3], strain[row, j::3] = slope[j], slope[i]
        for k, law in enumerate((trace, deviator)):
            local[k] += strain.T @ law @ strain / 8
            means[k] += law @ strain / 8
    number = np.arange(bulk.size).reshape(shape)
    nodes = np.stack([np.roll(number, -corner, (0, 1, 2)).ravel() for corner in corners], axis=1)
    rows = (3 * nodes[:, :, None] + np.arange(3)).reshape(-1, 24)
    moduli = np.stack([bulk.ravel(), shear.ravel()])
    entries = np.einsum("ke,kab->eab", moduli, local)
    matrix = coo_array(
        (entries.ravel(), (np.repeat(rows, 24, 1).ravel(), np.tile(rows, 24).ravel()))
    )
    load = np.zeros((3 * bulk.size, 6))
    np.add.at(load, rows, np.einsum("ke,kca->eac", moduli, means))
    free = np.arange(3, 3 * bulk.size)
    fluctuation = splu(matrix.tocsc()[3:, 3:]).solve(load[free])
    mean = np.einsum("ke,kab->ab", moduli, [trace, deviator]) / bulk.size
    return mean - load[free].T @ fluctuation / bulk.size


@pytest.mark.parametrize("contrast", [0.02, 30.0])
def test_an_independent_solver_is_never_below_and_its_limit_never_above(contrast, rng):
    phase, moduli = voxels(rng, (4, 3, 5), contrast=contrast, count=int(rng.integers(2, 5)))
    sides = (*rng.uniform(0.6, 1.6, 2), 1.0)
    bounds = solve_image(*moduli[:, phase], sides=sides).bounds
    once, twice = (finite_elements(*moduli[:, phase], sides, parts) for parts in (1, 2))
    scale = np.abs(bounds.upper).max()
    # one element a voxel is the space of the upper bound; the next is between the bounds
    assert once == pytest.approx(bounds.upper, abs=1e-4 * scale)
    assert np.linalg.eigvalsh(bounds.upper - twice)[0] > 0
    assert np.linalg.eigvalsh(twice - bounds.lower)[0] > 0
    limit = twice - (once - twice) / 3  # for errors of order 2; edges make them fall more slowly
    assert np.linalg.eigvalsh(limit - bounds.lower)[0] > 0


@pytest.mark.parametrize("contrast", [0.1, 10.0])
def test_the_series_of_spheres_is_between_the_voxels_inside_and_those_touched(contrast):
    radius = np.cbrt(1.2 / np.pi)  # of fraction 0.2, over half the cell's side
    matrix, sphere = Phase(20e9, 0.2), Phase(contrast * 20e9, 0.3)
    radius_map = HermiteMap(radius, 0, radius, 0)
    exact = SpheresModel(points=2).solve(radius_map, matrix, [sphere])[0].stiffness
    widths = []
    for size in (6, 12):
        far = 2 * np.arange(1, size // 2 + 1) / size  # faces of voxels on one side of the middle
        masks = []
        for squares in (far**2, (far - far[0]) ** 2):
            along = np.concatenate([squares[::-1], squares])
            masks.append(along[:, None, None] + along[:, None] + along < radius**2)
        pairs = [
            np.sort([np.where(mask, inside, outside) for mask in masks], axis=0)
            for outside, inside in zip(matrix.bulk_and_shear, sphere.bulk_and_shear, strict=True)
        ]
        bounds = ImageModel((1.0, 1.0, 1.0)).solve(ModuliImages(*np.swapaxes(pairs, 0, 1))).bounds
        assert bounds.contains(exact)
        widths.append(bounds.width)
    assert widths[1] < 0.65 * widths[0]  # of order 1 in the voxel's side


@pytest.mark.parametrize("dimension", [2, 3])
def test_pores_are_bounded_from_above_and_rigid_phases_from_below(dimension, rng):
    (_, moduli), phase = voxels(rng, (3, 4, 4), contrast=3.0), np.ones((3, 4, 4), int)
    phase[1, 1:3, 1:3] = 0
    phase = phase if dimension == 3 else phase[1:2]
    soft, hard = (finite_elements(*(moduli * [r, 1])[:, phase], (1.0,) * 3, 2) for r in (1e-9, 1e9))
    plane = np.ix_([0, 1, 5], [0, 1, 5])
    if dimension == 2:
        phase, soft, hard = phase[0], soft[plane], hard[plane]
        moduli = np.array([moduli[0] + moduli[1] / 3, moduli[1]])
    pore, limit, rigid, near = (
        solve_image(*(moduli * [r, 1])[:, phase]).bounds for r in (0, 1e-4, np.inf, 1e3)
    )
    if dimension == 3:  # elements of the plane are not nested in finer ones of degree 1
        assert eigh(soft, pore.upper, eigvals_only=True)[-1] <= 1
    between = eigh(pore.upper, limit.upper, eigvals_only=True)
    assert 0.97 < between[0] <= between[-1] <= 1 + 1e-5
    assert eigh(rigid.lower, hard, eigvals_only=True)[-1] <= 1
    assert eigh(rigid.lower, near.lower, eigvals_only=True)[0] >= 1 - 1e-5
    assert eigh(pore.lower, soft, eigvals_only=True)[-1] <= 1
    phase[:, 1] = 0  # pores that meet their own image
    percolating = solve_image(*(moduli * [0, 1])[:, phase]).bounds
    assert np.diag(percolating.lower).max() > 0
    assert not percolating.has_lower
    for bounds, side in ((percolating, 0), (rigid, 1)):
        constants = bounds.constants()
        ends = np.array([bounds.bulk, bounds.shear(), *constants[:dimension], constants[-1]])
        assert np.isfinite(ends[:, 1 - side]).all()
        assert (ends[:, 0] >= 0).all()
        assert bounds is percolating or np.isinf(ends[:, 1]).all()
        assert np.array_equal(constants[dimension], [-np.inf, np.inf])  # ν
    assert percolating.young()[0] <= 0


def test_a_homogeneous_volume_is_exact_and_its_constants_are_its_own():
    bulk, shear = np.full((2, 3, 4), 3.0), np.full((2, 3, 4), 2.0)
    bounds = solve_image(bulk, shear).bounds
    assert bounds.contains(isotropic(3.0, 2.0))
    young, poisson = 9 * 3.0 * 2.0 / 11.0, 5 / 22
    expected = [young] * 3 + [poisson] * 3 + [2.0] * 3
    for (low, high), value in zip(bounds.constants(), expected, strict=True):
        assert low <= value <= high < low + 5e-12
    for (low, high), value in (
        (bounds.bulk, 3.0),
        (bounds.shear(), 2.0),
        (bounds.young(), young),
        (bounds.poisson(), poisson),
    ):
        assert low <= value <= high < low + 5e-12


def test_losses_of_laminates_and_equal_losses_are_exact(rng):
    phase = np.moveaxis(np.broadcast_to([0, 1, 1, 0, 1, 1], (2, 2, 6)), 2, 2)
    moduli = np.array([[1.0, 9.0], [0.6, 4.0]])
    images = ModuliImages.crisp(*moduli[:, phase])
    model = ImageModel((1.0, 1.0, 1.0), solver=TIGHT)
    shares = energy_fractions(model, model.solve(images), images, phase, 2)
    step = 1e-6
    for name, index in (("E_x", 0), ("E_y", 1), ("E_z", 2)):

        def young(change, index=index):
            changed = moduli * [1 + change, 1]
            return 1 / np.linalg.inv(laminate(0, (1 / 3, 2 / 3), changed))[index, index]

        exact = (young(step) - young(-step)) / (2 * step * young(0))
        low, high = shares[name][0]
        assert low <= exact + 1e-9
        assert exact - 1e-9 <= high < low + 2e-5
        loss = mean_loss(shares[name], [0.01, 0.03], [0.01, 0.03])
        assert loss[0] - 1e-9 <= 0.01 * exact + 0.03 * (1 - exact) <= loss[1] + 1e-9
        assert loss[1] - loss[0] < 1e-6
    low, high = mean_loss(np.array([[0.1, 0.5], [0.2, 0.9]]), [0.02, 0.02], [0.02, 0.02])
    assert low <= 0.02 <= high < low + 1e-15


def test_shares_of_energy_hold_where_bounds_are_wide():
    """Along layers of moduli 1 and 4 the soft third has (1/3)/(1/3 + 8/3) of the energy."""
    phase = np.repeat([[0], [1], [1], [0], [1], [1]], 2, axis=1)
    moduli = np.array([1.0, 4.0])[phase]
    images = ModuliImages.crisp(moduli, 0.5 * moduli)
    model = ImageModel(solver=TIGHT)
    solution = model.solve(images)
    sharp = solution.bounds
    for lower, upper in ((0.5, 1.0), (1.0, 2.0), (0.7, 1.4)):
        wide = StiffnessBounds(lower * sharp.lower, upper * sharp.upper)
        shares = energy_fractions(model, replace(solution, bounds=wide), images, phase, 2)
        for (low, high), share in zip(shares["E_x"], (1 / 9, 8 / 9), strict=True):
            assert low <= share + 1e-12
            assert share - 1e-12 <= high


def test_first_order_losses_of_an_independent_solver_are_inside(rng):
    phase, moduli = voxels(rng, (3, 4, 4), contrast=8.0)
    images = ModuliImages.crisp(*moduli[:, phase])
    model = ImageModel((1.0, 1.0, 1.0))
    shares = energy_fractions(model, model.solve(images), images, phase, 2)
    step, sides = 1e-4, (1.0, 1.0, 1.0)

    def moduli_at(change):
        changed = moduli * [1 + change, 1]
        stiffness = finite_elements(*changed[:, phase], sides, 2)
        return 1 / np.diagonal(np.linalg.inv(stiffness))[:3]

    slopes = (moduli_at(step) - moduli_at(-step)) / (2 * step * moduli_at(0))
    for name, slope in zip(("E_x", "E_y", "E_z"), slopes, strict=True):
        low, high = shares[name][0]
        assert low < slope < high
        assert 0 <= low < high <= 1


@pytest.mark.parametrize(
    ("bulk", "shear", "settings", "key"),
    [
        (np.ones((2, 2, 2)), np.ones((2, 2, 3)), {}, "moduli"),
        (np.ones(3), np.ones(3), {}, "moduli"),
        (np.zeros((2, 2, 2)), np.ones((2, 2, 2)), {}, "moduli"),
        (np.full((2, 2), np.nan), np.ones((2, 2)), {}, "moduli"),
        (np.ones((2, 2, 2)), np.ones((2, 2, 2)), {"sides": (1.0, 1.0)}, "sides"),
        (np.ones((2, 2)), np.ones((2, 2)), {"division": 0}, "division"),
    ],
)
def test_arrays_that_are_no_moduli_of_a_grid_are_refused(bulk, shear, settings, key):
    with refuses(key):
        solve_image(bulk, shear, **settings)


def test_moduli_in_single_precision_are_proved_as_doubles(rng):
    phase, moduli = voxels(rng, (3, 4, 5), contrast=20.0)
    single = moduli[:, phase].astype(np.float32)
    bounds, exact = solve_image(*single).bounds, solve_image(*single.astype(float)).bounds
    assert np.array_equal(bounds.lower, exact.lower)
    assert np.array_equal(bounds.upper, exact.upper)


# the plane


PLANE = np.ix_([0, 1, 5], [0, 1, 5])  # Voigt's 11, 22 and 12 of space


def stiffness(bulk, shear):
    """Plane-strain stiffness of an isotropic material from K + G/3 and G, shape (3, 3)."""
    return isotropic(bulk - shear / 3, shear)[PLANE]


def image_of(mask, phases):
    return tuple(np.where(mask, first, second) for first, second in zip(*phases, strict=True))


def discs(size, rng, *, number=6, radius=0.12):
    places = (np.arange(size) + 0.5) / size
    mask = np.zeros((size, size), bool)
    for x, y in rng.random((number, 2)):
        across, up = ((places - c + 0.5) % 1 - 0.5 for c in (x, y))
        mask |= across**2 + up[:, None] ** 2 < radius**2
    return mask


def random_phases(rng):
    return tuple(tuple(np.exp(rng.uniform(0, np.log(100), 2))) for _ in range(2))


@pytest.mark.parametrize("seed", range(4))
def test_laminates_are_inside_and_the_bounds_meet_on_them(seed):
    rng = np.random.default_rng(seed)
    columns, rows = rng.integers(2, 40, 2)
    layers = rng.random(columns) < rng.uniform(0.2, 0.8)
    layers[:2] = True, False
    mask, phases = np.tile(layers, (rows, 1)), random_phases(rng)
    moduli = np.transpose([(bulk - shear / 3, shear) for bulk, shear in phases])
    exact = laminate(0, (layers.mean(), 1 - layers.mean()), moduli)[PLANE]
    result = solve_image(
        *image_of(mask, phases), sides=(rng.uniform(0.5, 2), 1.0), solver=TIGHT
    ).bounds
    assert result.contains(exact)
    assert result.width < 1e-8
    turned = solve_image(*image_of(mask.T, phases), solver=TIGHT).bounds
    assert turned.contains(exact[np.ix_([1, 0, 2], [1, 0, 2])])


@pytest.mark.parametrize("seed", range(4))
def test_mixtures_of_equal_shear_moduli_are_inside(seed):
    rng = np.random.default_rng(seed)
    (first, shear), (second, _) = random_phases(rng)
    mask = discs(24, rng, number=int(rng.integers(2, 9)))
    share = mask.mean()
    bulk = 1 / (share / (first + shear) + (1 - share) / (second + shear)) - shear  # Hill 1964
    result = solve_image(*image_of(mask, ((first, shear), (second, shear)))).bounds
    assert result.contains(stiffness(bulk, shear))


@pytest.mark.parametrize("shape", [(24, 20), (3, 4, 5)])
def test_divided_elements_narrow_the_bounds_of_the_same_image(shape, rng):
    moduli, sides = random_moduli(rng, shape, span=10.0), (0.8, *(1.0,) * (len(shape) - 1))
    whole, parts = (
        solve_image(*moduli, sides=sides, division=n, solver=ConjugateGradient(1e-9)).bounds
        for n in (1, 2)
    )
    for inner_bound, outer_bound in ((parts.upper, whole.upper), (whole.lower, parts.lower)):
        narrowed = np.linalg.eigvalsh(outer_bound - inner_bound)
        # Phases that nearly agree in one modulus leave bounds that differ by less than rounding: some
        # units of 2⁻⁵³ for each cell that an energy is summed over, of all loads and modes.
        cells = 2 ** len(shape) * np.prod(shape)
        assert narrowed[0] > -32 * cells * 2.0**-53 * abs(outer_bound).max()
        assert narrowed[-1] > 0


@pytest.mark.parametrize("seed", range(5))
def test_the_modulus_is_inside_its_bounds_where_it_falls_with_the_shear_modulus(seed):
    rng = np.random.default_rng(seed)
    bulk, shear = np.sort(10 ** rng.uniform(-1, 1, (2, 2)))  # G/K from 0.01 to 100
    bounds = StiffnessBounds(stiffness(bulk[0], shear[0]), stiffness(bulk[1], shear[1]))
    g, k = np.meshgrid(np.linspace(*shear, 400), np.linspace(*bulk, 40))
    inside = 3 * g - g * g / k
    low, high = bounds.young()
    assert low <= inside.min() <= low + 1e-9 * abs(low) + 1e-12
    assert inside.max() <= high <= inside.max() + 1e-4 * (shear[1] + shear[1] ** 2 / bulk[0])


@pytest.mark.parametrize("seed", range(2))
def test_intervals_of_constants_hold_all_stiffnesses_between_the_bounds_and_meet(seed):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(2, 3, 3))
    lower, change = (root @ root.T + 0.1 * np.eye(3) for root in roots)
    ends = StiffnessBounds(lower, lower + change).constants()
    for turn in np.linalg.qr(rng.normal(size=(300, 3, 3)))[0]:
        part = turn @ np.diag(rng.uniform(0, 1, 3) ** 0.2) @ turn.T  # 0 ≤ part ≤ 1
        root = np.linalg.cholesky(change)
        between = constants_of(lower + root @ part @ root.T)
        assert (ends[:, 0] <= between).all()
        assert (between <= ends[:, 1]).all()
    for exact, place in ((lower, 1), (lower + change, 0)):
        moduli = constants_of(exact)[[0, 1, 3]]
        assert ends[[0, 1, 3], 1 - place] == pytest.approx(moduli, rel=1e-9)


def constants_of(stiffness):
    """E_x, E_y, ν_xy and G_xy of a plane stiffness."""
    compliance = np.linalg.inv(stiffness)
    young_x, young_y, shear = 1 / np.diag(compliance)
    return np.array([young_x, young_y, -compliance[0, 1] * young_x, shear])


def random_moduli(rng, shape, span=1e3):
    """Two phases whose moduli differ by up to `span`, each on a random share of the pixels."""
    phases = np.exp(rng.uniform(0, np.log(span), (2, 2)))
    mask = rng.random(shape) < rng.uniform(0.1, 0.9)
    mask.flat[:2] = True, False
    return tuple(np.where(mask, *pair) for pair in phases)


@pytest.mark.parametrize("seed", range(3))
def test_bounds_are_as_close_to_those_of_solved_fields_as_the_accuracy(seed):
    rng = np.random.default_rng([seed, 1])
    moduli = random_moduli(rng, rng.integers(2, 20, 2))
    solved = solve_image(*moduli, solver=ConjugateGradient(1e-12)).bounds
    for accuracy in (1e-2, 1e-5):
        near = solve_image(*moduli, solver=ConjugateGradient(accuracy)).bounds
        pairs = ((near.upper, solved.upper), (solved.lower, near.lower))
        ratios = np.array([np.linalg.eigvals(np.linalg.solve(b, a)).real for a, b in pairs])
        assert ratios.min() > 1 - 1e-9
        assert ratios.max() < 1 + 3 * accuracy + 1e-9


def test_what_a_watch_raises_ends_both_sides_at_once():
    calls = []

    def watch():
        calls.append(1)
        if len(calls) == 6:
            raise KeyboardInterrupt

    shear = np.random.default_rng(1).uniform(1, 100, (24, 24))
    with pytest.raises((KeyboardInterrupt, InterruptedError)):
        solve_image(3 * shear, shear, solver=ConjugateGradient(1e-12, watch=watch))
    assert 6 <= len(calls) < 20


@pytest.mark.parametrize("matrix", [np.ones((3, 3)), np.diag([1.0, 0.0, 1.0])])
def test_a_singular_matrix_has_no_bounds_of_its_inverse(matrix):
    singular = pytest.raises(FailedError, match="singular to rounding")
    with np.errstate(divide="ignore", invalid="ignore"), singular:
        inverse_below(matrix)


def diagonal_stripes(contrast, shape):
    """Bulk and shear moduli (ν .3) of stripes of 1 GPa and of `contrast` GPa at 45° in (y, x)."""
    index = np.indices(shape)
    young = np.where(index[-2:].sum(axis=0) % shape[-1] < shape[-1] // 2, 1e9, contrast * 1e9)
    bulk, shear = young / 1.2, young / 2.6
    return (bulk, shear) if len(shape) == 3 else (bulk + shear / 3, shear)


@pytest.mark.parametrize("contrast", [3e8, 1e9, 1e10, 1e12])
def test_stripes_at_an_angle_keep_both_bounds_at_any_contrast(contrast):
    bounds = solve_image(*diagonal_stripes(contrast, (8, 8))).bounds
    assert bounds.has_lower
    assert bounds.width < 0.2
    young, *_ = solve_image(*diagonal_stripes(1e6, (8, 8))).bounds.constants()
    constants = bounds.constants()
    # beyond 1e6 the stiff layers are rigid but for a millionth
    assert constants[0, 0] < young[1] * (1 + 1e-5)
    assert young[0] < constants[0, 1] * (1 + 1e-5) < 1.1 * young[1]
    assert np.isfinite(constants).all()


@pytest.mark.parametrize("contrast", [3e8, 9e8, 1e10])
def test_a_laminate_s_modulus_along_its_layers_is_inside_at_any_contrast(contrast):
    bounds = solve_image(*diagonal_stripes(contrast, (2, 4, 4))).bounds
    young = bounds.constants()[2]  # along z: the mean of both phases, of one Poisson's ratio
    assert young[0] <= (1 + contrast) / 2 * 1e9 <= young[1] < 1.001 * contrast / 2 * 1e9


def test_layers_of_pores_polymer_and_steel_are_bounded_along_them():
    """At 45° to the axes across z: along z the mean of the moduli, and pores below."""
    index = np.indices((3, 6, 6))
    image = GreyImage((index[1] + index[2]) % 6 // 2 + 1, (5e-6,) * 3)
    steel, polymer = Triangular(190e9, 200e9, 210e9), Triangular(1e7, 2e7, 3e7)
    phases = [{"modulus": young, "poisson": 0.3} for young in (0.0, polymer, steel)]
    found = fuzzy_image_stiffness(image, phases, labels=[1, 2, 3], alpha=[0, 1], progress=False)
    low, high = found.constants["E_z"].T
    assert (low <= 200.02e9 / 3).all()
    assert high[1] == pytest.approx(200.02e9 / 3, rel=1e-3)
    assert high[1] >= 200.02e9 / 3
    for bounds in found.constants.values():
        assert (bounds[:, 0] <= bounds[:, 1]).all()


@pytest.mark.parametrize("poisson", [-1 + 1.5e-8, -0.95, 0.49999999])
def test_a_homogeneous_volume_at_the_ends_of_poisson_s_ratio_is_inside(poisson):
    bulk, shear = 1 / (3 * (1 - 2 * poisson)), 1 / (2 * (1 + poisson))  # E = 1
    bounds = solve_image(np.full((2, 3, 2), bulk), np.full((2, 3, 2), shear)).bounds
    exact = [1.0] * 3 + [poisson] * 3 + [shear] * 3
    for (low, high), value in zip(bounds.constants(), exact, strict=True):
        assert low <= value <= high < value + 1e-5 * abs(value)
    averages = bounds.bulk, bounds.shear(), bounds.young(), bounds.poisson()
    for (low, high), value in zip(averages, (bulk, shear, 1.0, poisson), strict=True):
        assert low <= value <= high < value + 1e-5 * abs(value)
    assert bounds.width < 1e-4


@pytest.mark.parametrize("size", [3, 6])
def test_a_lower_bound_that_is_not_positive_definite_bounds_no_compliance(size, rng):
    root = rng.normal(size=(size, size))
    upper = root @ root.T + np.eye(size)
    values, vectors = np.linalg.eigh(upper)
    values[0] = -1e-9  # as rounding may leave it
    bounds = StiffnessBounds((0.5 * values * vectors) @ vectors.T, upper)
    assert not bounds.has_lower
    assert bounds.width == np.inf
    constants = bounds.constants()
    is_ratio = np.arange(len(constants)) // bounds.dimension == 1
    is_ratio[-1] = False
    assert (constants[~is_ratio, 0] == 0).all()
    assert (constants[~is_ratio, 1] > 0).all()
    assert np.isfinite(constants[~is_ratio, 1]).all()
    assert (constants[is_ratio] == [-np.inf, np.inf]).all()
    averages = bounds.bulk, bounds.shear(), bounds.shear("axes"), bounds.young(), bounds.poisson()
    for low, high in averages:
        assert low <= high


def test_bounds_in_the_wrong_order_are_refused_where_they_are_made():
    one = np.eye(3)
    turned = np.array([[1.0, 0.9, 0], [0.9, 1.0, 0], [0, 0, 1.0]])
    none = np.full((3, 3), np.nan)
    for lower, upper in ((2 * one, one), (one, turned), (none, one), (one, none)):
        with pytest.raises(FailedError, match="contradict each other"):
            StiffnessBounds(lower, upper)
    for lower, upper in ((2.0, 1.0), (np.nan, 1.0), (1.0, np.nan)):
        with pytest.raises(FailedError, match="contradict each other"):
            Enclosure(lower, upper)
    assert Enclosure(-np.inf, np.inf).lower == -np.inf


def test_an_inverse_of_any_condition_is_below_and_positive(rng):
    """Where the error of the floating-point inverse would hide its smallest eigenvalue."""
    for _ in range(20):
        turn = np.linalg.qr(rng.normal(size=(6, 6)))[0]
        matrix = (10.0 ** rng.uniform(-12, 0, 6) * turn) @ turn.T
        matrix = (matrix + matrix.T) / 2
        exact = _exact_inverse(matrix)
        if exact is None:
            continue
        below, above = inverse_below(matrix), inverse_above(matrix)
        assert _exact_inverse(above - below) is not None
        scale = np.sqrt(np.diagonal(exact))
        assert np.linalg.eigvalsh((exact - below) / np.outer(scale, scale))[0] > -1e-15
        assert np.linalg.eigvalsh((above - exact) / np.outer(scale, scale))[0] > -1e-15
        assert _exact_inverse(below) is not None or np.linalg.cond(matrix) > 1e13


# cuts


ALPHA = (0.0, 0.5, 1.0)


def smooth(size, seed):
    """Smooth periodic grey values in [0, 1], shape (size, size)."""
    rng = np.random.default_rng(seed)
    waves = np.fft.fftfreq(size) * size
    damping = np.exp(-((np.hypot(waves[:, None], waves[: size // 2 + 1]) / 5) ** 2))
    values = np.fft.irfft2(np.fft.rfft2(rng.normal(size=(size, size))) * damping, s=(size, size))
    return (values - values.min()) / np.ptp(values)


def phases(alpha, ordered=True):
    """Intervals of K and G of both phases at a level."""
    matrix, particle = ((10.0, 5.0), (40.0, 25.0)) if ordered else ((10.0, 25.0), (40.0, 5.0))
    ends = [1 + s * (1 - alpha) for s in (-0.1, 0.1)]
    pairs = (matrix, particle)
    return [ModuliInterval(*(PhaseModuli((k + g / 3) * e, g * e) for e in ends)) for k, g in pairs]


def images(grey, alpha, ordered=True):
    slack = 0.05 * (1 - alpha)
    ranges = threshold_ranges(grey, [(0.5 - slack, 0.5 + slack)])
    return moduli_images(*ranges, phases(alpha, ordered))


def sample(rng, grey, alpha, ordered):
    """Bounds of one image from inside a cut."""
    slack = 0.05 * (1 - alpha)
    mask = grey >= rng.uniform(0.5 - slack, 0.5 + slack)
    moduli = []
    for phase in phases(alpha, ordered):
        ends = [(p.bulk - p.shear / 3, p.shear) for p in (phase.lower, phase.upper)]
        bulk, shear = rng.uniform(*ends)
        moduli.append((bulk + shear / 3, shear))
    return solve_image(*(np.where(mask, b, a) for a, b in zip(*moduli, strict=True))).bounds


@pytest.mark.parametrize("ordered", [True, False])
def test_samples_never_leave_the_cut(ordered):
    grey, rng, model = smooth(24, 1), np.random.default_rng(2), ImageModel(division=1)
    pairs = [images(grey, alpha, ordered) for alpha in ALPHA]
    bounds = model.bounds_at_levels(pairs, (pairs[-1], model.solve(pairs[-1])))
    cuts = model.cuts(bounds)
    for cut, alpha in zip(cuts, ALPHA, strict=True):
        for _ in range(4):
            inside = sample(rng, grey, alpha, ordered)
            assert cut.bounds.contains((inside.lower + inside.upper) / 2)
            low, high = inside.young(model.average)
            assert cut.modulus[0] <= high
            assert low <= cut.modulus[1]
    moduli = np.array([cut.modulus for cut in cuts])  # rising levels lie inside one another
    assert (np.diff(moduli[:, 0]) >= 0).all()
    assert (np.diff(moduli[:, 1]) <= 0).all()
    if ordered:
        corner = model.solve(ModuliImages(pairs[0].lower, pairs[0].lower))
        assert (
            np.abs(corner.bounds.lower - cuts[0].bounds.lower).max()
            < 1e-3 * corner.bounds.lower[0, 0]
        )


@pytest.mark.parametrize("seed", range(5))
def test_an_interval_of_poisson_ratios_is_enclosed_and_no_wider_than_it_must(seed):
    rng = np.random.default_rng(seed)
    ratios = tuple(np.sort(rng.uniform(-0.5, 0.45, 2)))
    interval = ModuliInterval.of_young((2.0, 3.0), ratios)
    nu = np.linspace(*ratios, 2001)
    ends = [[PhaseModuli.of_young(e, float(n)) for n in nu] for e in (2.0, 3.0)]
    for name in ("bulk", "shear"):
        low, high = (np.array([getattr(m, name) for m in end]) for end in ends)
        assert getattr(interval.lower, name) == pytest.approx(low.min(), rel=1e-6)
        assert getattr(interval.upper, name) == pytest.approx(high.max(), rel=1e-6)
        assert getattr(interval.lower, name) <= low.min()
        assert getattr(interval.upper, name) >= high.max()


def test_cuts_that_leave_out_an_image_inside_them_are_refused():
    grey, model = smooth(24, 1), ImageModel(division=1)
    pairs = [images(grey, alpha) for alpha in ALPHA]
    bounds = model.bounds_at_levels(pairs, (pairs[-1], model.solve(pairs[-1])))
    model.require_consistent(pairs, bounds)
    for level in (0, 2):
        wrong = list(bounds)
        high = bounds[level].upper
        wrong[level] = StiffnessBounds(1.001 * high, 1.1 * high)
        with pytest.raises(
            FailedError, match="the proof is wrong: bounds of an image inside a cut"
        ):
            model.require_consistent(pairs, wrong)


@pytest.mark.parametrize(("contrast", "rows", "parts"), [(9, 4, 2), (11, 4, 1), (9, 1 << 19, 1)])
def test_pixels_are_divided_where_that_is_cheap(contrast, rows, parts):
    image = np.ones((rows, 4))
    image[0] = contrast
    assert usual_division(ModuliImages.crisp(image, image)) == parts


@pytest.mark.parametrize(
    "thresholds", [((9.0, 9.0),), ((0.0, 2.0),), ((3.0, 3.5), (3.6, 4.0)), ((6.0, 6.0), (3.0, 3.0))]
)
def test_thresholds_that_leave_a_phase_empty_are_refused(thresholds):
    with refuses("threshold") as error:
        require_phases(np.arange(8), thresholds)
    assert error.value.key == "threshold"


# from energies to bounds, averages and losses


def in_order(terms):
    """Their sum from the first to the last, and by what it is off."""
    total = 0.0
    for term in terms:
        total += term
    return abs(Fraction(total) - sum(map(Fraction, terms)))


def tight(bound, error):
    """Whether a bound holds and half of it does not."""
    return error <= bound < 2 * error


HILL_SUMS = {  # of a stiffness (Voigt) and of a compliance (Reuss): factors and a divisor
    0: ((1, 2, 0, 9), (1, 2, 0, 1)),
    1: ((1, -1, 3, 15), (4, -4, 3, 15)),
}


@pytest.mark.parametrize("modulus", [0, 1], ids=["K", "G"])
def test_the_sums_of_hill_s_average(modulus, rng):
    """Against exact sums: K and G of Voigt's average, and those of Reuss's by the compliance."""
    for _ in range(50):
        stiffness = random_stiffness(rng)
        compliance = np.linalg.inv(stiffness)
        sums = []
        for matrix, factors in zip((stiffness, compliance), HILL_SUMS[modulus], strict=True):
            normal, mixed, shear, divisor = factors
            entries = [[Fraction(float(x)) for x in row] for row in matrix]
            diagonal = sum(entries[k][k] for k in range(3))
            off_diagonal = sum(entries[i][j] for i, j in ((0, 1), (0, 2), (1, 2)))
            of_shears = sum(entries[k][k] for k in range(3, 6))
            total = normal * diagonal + mixed * off_diagonal + shear * of_shears
            sums.append(total / divisor)
        exact = (sums[0] + 1 / sums[1]) / 2
        low, high = (Fraction(hill_mean(stiffness, compliance, modulus, side=s)) for s in (-1, 1))
        assert low <= exact <= high
        assert high - low < 2000 * Fraction(UNIT) * exact


def random_stiffness(rng):
    """A positive definite stiffness of space, (6, 6)."""
    factor = rng.normal(size=(6, 6))
    return factor @ factor.T + 3 * np.eye(6)


def test_the_mean_of_losses_by_known_fractions_of_energy(rng):
    """Against exact sums: dyadic fractions have the sum 1 without rounding."""
    for _ in range(50):
        fractions = np.diff(np.sort([0, *rng.choice(1023, 4, replace=False) + 1, 1024])) / 1024
        losses = rng.uniform(0, 0.1, len(fractions))
        ends = np.stack([fractions, fractions], axis=1)
        low, high = (Fraction(x) for x in mean_loss(ends, losses, losses))
        exact = sum(Fraction(f) * Fraction(x) for f, x in zip(fractions, losses, strict=True))
        assert low <= exact <= high
        assert high - low < 200 * Fraction(UNIT) * Fraction(losses.max())


def test_the_residual_of_an_inverse():
    inverse, matrix = np.zeros((3, 3)), np.zeros((3, 3))
    inverse[0], matrix[:, 0] = 1.0, [1.0, LOST, LOST]
    assert residual_above(inverse, matrix)[0, 0] >= 2 * LOST
    bound = residual_above(inverse, matrix)[0, 0] - abs(1 - (inverse @ matrix)[0, 0])
    assert tight(Fraction(bound), in_order([1.0, LOST, LOST]))


def test_the_inverse_is_below_and_near():
    """Also where the computed one is off by a small matrix of the worst sign."""
    rng, above = np.random.default_rng(0), 0
    for _ in range(200):
        root = rng.normal(size=(3, 3)) @ np.diag([1, 10.0 ** rng.uniform(-3, 0), 1])
        matrix = root @ root.T
        matrix = (matrix + matrix.T) / 2
        product = matrix.astype(np.longdouble) @ inverse_below(matrix).astype(np.longdouble)
        assert np.linalg.eigvals(product.astype(float)).real.max() <= 1 + 1e-15
        plain = matrix.astype(np.longdouble) @ np.linalg.inv(matrix).astype(np.longdouble)
        above += np.linalg.eigvals(plain.astype(float)).real.max() > 1 + 1e-15
    assert above > 50  # so that an inverse without the margin would not pass


def test_an_inverse_that_is_off_all_over(monkeypatch):
    """The error of a wrong inverse of a multiple of the unit matrix is its bound."""
    exact, off = np.eye(3) / 2, 1e-3
    monkeypatch.setattr(np.linalg, "inv", lambda matrix: exact + off * np.eye(3))
    below = inverse_below(2 * np.eye(3))
    assert np.linalg.eigvalsh(exact - below)[0] >= 0
    assert np.linalg.eigvalsh(exact - (exact + off * np.eye(3) + below) / 2)[0] < 0


def rational(stiffness, average):
    """K, G, E and ν of an average, exactly."""
    c = [[Fraction(x) for x in row] for row in stiffness.tolist()]
    axial, shear = (c[0][0] + c[1][1]) / 2, c[2][2]
    bulk, diagonal = (axial + c[0][1]) / 2, (axial - c[0][1]) / 2
    if average != "axes":
        shear = ((shear + diagonal) / 2 + 2 / (1 / shear + 1 / diagonal)) / 2
    return bulk, shear, 3 * shear - shear**2 / bulk, (1 - shear / bulk) / 2


@pytest.mark.parametrize("average", ["axes", "isotropic"])
def test_the_constants_of_one_stiffness(average):
    rng, used = np.random.default_rng(1), np.zeros(4)
    for _ in range(800):
        bulk = np.exp(rng.uniform(0, 3))
        shear = bulk * 10.0 ** rng.choice([rng.uniform(-1, 0), rng.uniform(0.3, 4)])
        c11, c22 = bulk + shear * np.exp(0.1 * rng.normal(size=2))
        c12 = bulk - shear
        one = np.array([[c11, c12, 0], [c12, c22, 0], [0, 0, shear * np.exp(0.1 * rng.normal())]])
        bounds = StiffnessBounds(one, one)
        if not bounds.has_lower:  # no stiffness
            continue
        ends = bounds.bulk, bounds.shear(average), bounds.young(average), bounds.poisson(average)
        for k, ((low, high), exact) in enumerate(zip(ends, rational(one, average), strict=True)):
            assert low <= exact <= high
            if high > low:
                off = abs(exact - (Fraction(low) + Fraction(high)) / 2)
                used[k] = max(used[k], off / ((Fraction(high) - Fraction(low)) / 2))
    assert (used[:2] > 0.5).all() if average != "axes" else used[0] > 0.5
