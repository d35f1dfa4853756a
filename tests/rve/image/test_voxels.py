"""Proved bounds of voxels: exact cases, symmetries, an independent solver, the kernels, losses."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from alphacut.fuzzy import RefusedError
from alphacut.rve import Phase
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import element_of, isotropic_parts
from alphacut.rve.image.fields.energy import energies, modes_by_matrices, modes_of
from alphacut.rve.image.fields.grid import Operator
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference
from alphacut.rve.image.losses import energy_fractions, mean_loss
from alphacut.rve.image.model import ImageModel, solve_image
from alphacut.rve.image.phases import ModuliImages
from alphacut.rve.spheres.model import cubic_stiffness
from alphacut.rve.spheres.result import cubic_voigt

TIGHT = ConjugateGradient(accuracy=1e-12)


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


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("contrast", [1e-3, 10.0, 1e6])
def test_bounds_of_laminates_meet_at_their_exact_stiffness(axis, contrast, rng):
    shape = np.full(3, 2)
    shape[2 - axis] = 6
    layers = np.array([0, 1, *rng.integers(0, 2, 4)])
    phase = np.moveaxis(np.broadcast_to(layers, (2, 2, 6)), 2, 2 - axis)
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
    exact = cubic_voigt(*cubic_stiffness(radius, matrix, [sphere]).moduli[0, 0])
    widths = []
    for size in (8, 16):
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
    assert not percolating.lower.any()
    for bounds, side, end in ((percolating, 0, 0.0), (rigid, 1, np.inf)):
        constants = bounds.constants()
        ends = np.array([bounds.bulk, bounds.shear(), *constants[:dimension], constants[-1]])
        assert np.isfinite(ends[:, 1 - side]).all()
        assert (ends[:, side] == end).all()
        assert np.array_equal(constants[dimension], [-np.inf, np.inf])  # ν
    assert percolating.young()[0] <= 0


@pytest.mark.parametrize("stress", [False, True], ids=["displacement", "stress"])
def test_kernels_do_what_the_elements_matrices_do(stress, rng):
    element = element_of((0.7, 2.0, 1.0), stress=stress)
    for shape in ((2, 3, 4), (5, 2, 7)):
        trace, deviator = rng.uniform(0.1, 2, (2, *shape))
        operator = Operator(element, trace, deviator)
        fields = rng.normal(size=(2, element.unknowns, *shape))
        by_matrices = operator.apply_by_matrices(fields)
        largest = np.abs(by_matrices).max()
        assert operator.apply(fields) == pytest.approx(by_matrices, abs=1e-14 * largest)
        means = element.mean_modes(rng.normal(size=(2, 6)))
        weights = trace, deviator
        found = energies(element, fields, means, weights)
        ((_, expected, *bound),) = modes_by_matrices(element, fields, means)
        for (z, rows), modes, *error in modes_of(element, fields, means):
            there = expected.reshape(*modes.shape[:2], *shape)[:, :, z, rows].reshape(modes.shape)
            rounding = np.tensordot(*error, axes=1) + 2e-16 * np.abs(modes)
            off = np.tensordot(*bound, axes=1).reshape(*modes.shape[:2], *shape)[:, :, z, rows]
            assert (np.abs(modes - there) <= rounding + off.reshape(modes.shape)).all()
            assert 0.1 * off.max() < rounding.max() < 100 * off.max()
        # ⟨ε̄ + ε, A ε⟩ of the fields and the energy that they have without the uniform ones
        alone = energies(element, fields, 0 * means, weights).value.sum(axis=0)
        work = np.tensordot(
            fields, operator.apply(fields) - operator.load(means), ((1, 2, 3, 4),) * 2
        )
        uniform = energies(element, 0 * fields, means, weights).value.sum(axis=0)
        total = found.value.sum(axis=0) - uniform
        assert (total + alone) * trace.size == pytest.approx(work + work.T)


@pytest.mark.parametrize("stress", [False, True], ids=["displacement", "stress"])
def test_the_preconditioner_inverts_one_material_to_single_precision(stress, rng):
    element, shape = element_of((0.7, 2.0, 1.0), stress=stress), (16, 3, 40)
    constant = Reference(3e-12, 2e-12, element.trace_in_deviator)
    inverse = FourierPreconditioner.of_material(element, constant, shape)
    operator = Operator(element, *(x * np.ones(shape) for x in (constant.trace, constant.deviator)))
    noise = rng.normal(size=(1, element.unknowns, *shape))
    fields = inverse.apply(operator.apply(noise))  # without gauge
    wrong = inverse.apply(operator.apply(fields)) - fields
    energy, off = (np.sum(x * operator.apply(x)) for x in (fields, wrong))
    assert 0 < off < (1e-6 if stress else 1e-12) * energy


def test_energies_are_those_of_three_gauss_points_an_axis(rng):
    """Stresses at the points by splines and Beltrami's derivatives written out."""
    sides, shape = np.array([0.7, 2.0, 1.0]), (3, 4, 5)
    element = element_of(tuple(sides), stress=True)
    trace, deviator = rng.uniform(0.1, 2, (2, *shape))
    potentials = rng.normal(size=(1, 6, *shape))  # 11, 12, 13, 22, 23, 33
    points, weights = np.polynomial.legendre.leggauss(3)
    t = (1 + points) / 2
    splines = np.array(
        [
            [(1 - t) ** 2, 1 + 2 * t - 2 * t**2, t**2],
            [2 * t - 2, 2 - 4 * t, 2 * t],
            [2 + 0 * t, -4 + 0 * t, 2 + 0 * t],
        ]
    )  # (order, function, point)
    steps = np.stack(np.meshgrid(*[range(3)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    local = np.stack([np.roll(potentials[0], -step, (1, 2, 3)) for step in steps], axis=1)
    local = local.reshape(6, 3, 3, 3, *shape)

    def derivative(pair, *axes):
        """Second derivative of Φ_pair along two axes of 1, 2, 3 at the points, (27, *shape)."""
        orders = [axes.count(axis) for axis in (3, 2, 1)]
        along = [splines[order] / side**order for order, side in zip(orders, sides, strict=True)]
        unknown = [11, 12, 13, 22, 23, 33].index(pair)
        return np.einsum("ia,jb,kc,ijkzyx->abczyx", *along, local[unknown]).reshape(27, *shape)

    normal = [
        derivative(22, 3, 3) + derivative(33, 2, 2) - 2 * derivative(23, 2, 3),
        derivative(33, 1, 1) + derivative(11, 3, 3) - 2 * derivative(13, 1, 3),
        derivative(11, 2, 2) + derivative(22, 1, 1) - 2 * derivative(12, 1, 2),
    ]
    shear = [
        derivative(12, 1, 3) + derivative(13, 1, 2) - derivative(11, 2, 3) - derivative(23, 1, 1),
        derivative(12, 2, 3) + derivative(23, 1, 2) - derivative(22, 1, 3) - derivative(13, 2, 2),
        derivative(13, 2, 3) + derivative(23, 1, 3) - derivative(33, 1, 2) - derivative(12, 3, 3),
    ]
    mean = sum(normal) / 3
    density = trace * (3 * mean) ** 2 + 2 * deviator * (
        sum((x - mean) ** 2 for x in normal) + 2 * sum(x**2 for x in shear)
    )
    weight = np.einsum("i,j,k->ijk", weights, weights, weights).ravel() / 8
    exact = np.mean(weight @ density.reshape(27, -1))
    uniform = element.mean_modes(np.zeros((1, 6)))
    found = energies(element, potentials, uniform, (trace, deviator))
    assert found.value.sum() == pytest.approx(exact, rel=1e-13)
    assert exact <= found.upper[0, 0] < exact * (1 + 1e-11)


def test_stresses_of_potentials_are_in_equilibrium(rng):
    """They do no work on any compatible strain, nor on a uniform one."""
    stress, strain = (element_of((0.7, 2.0, 1.0), stress=x) for x in (True, False))
    shape = 4, 5, 6
    potentials = rng.normal(size=(1, 6, *shape))
    stresses = _components(stress, potentials)
    for displacements in (rng.normal(size=(1, 3, *shape)), np.zeros((1, 3, *shape))):
        strains = _components(strain, displacements)
        if not displacements.any():
            strains[:, 0, 0, 0] += rng.normal(size=(6, 1, 1, 1))
        work = np.sum(stresses * strains)
        assert abs(work) < 1e-13 * np.sqrt(np.sum(stresses**2) * np.sum(strains**2))


def _components(element, fields):
    """Voigt components of a field in orthonormal modes, (6, modes along z, y, x, *grid)."""
    ((_, modes, _, _),) = modes_by_matrices(element, fields, np.zeros((len(element.modes), 1)))
    modes = modes.reshape(6, *[round((len(modes) / 6) ** (1 / 3))] * 3, *fields.shape[2:])
    widths = [(0, 3 - n if axis in (1, 2, 3) else 0) for axis, n in enumerate(modes.shape)]
    parts = isotropic_parts(3, stress=element.stress)
    return np.tensordot(np.linalg.inv(parts), np.pad(modes, widths), axes=1)


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
    ("bulk", "shear", "settings", "what"),
    [
        (np.ones((2, 2, 2)), np.ones((2, 2, 3)), {}, "shapes"),
        (np.ones(3), np.ones(3), {}, "shape"),
        (np.zeros((2, 2, 2)), np.ones((2, 2, 2)), {}, "throughout"),
        (np.full((2, 2), np.nan), np.ones((2, 2)), {}, "negative or nan"),
        (np.ones((2, 2, 2)), np.ones((2, 2, 2)), {"sides": (1.0, 1.0)}, "sides"),
        (np.ones((2, 2)), np.ones((2, 2)), {"division": 0}, "division"),
    ],
)
def test_arrays_that_are_no_moduli_of_a_grid_are_refused(bulk, shear, settings, what):
    with pytest.raises(RefusedError, match=what):
        solve_image(bulk, shear, **settings)


def test_moduli_in_single_precision_are_proved_as_doubles(rng):
    phase, moduli = voxels(rng, (3, 4, 5), contrast=20.0)
    single = moduli[:, phase].astype(np.float32)
    bounds, exact = solve_image(*single).bounds, solve_image(*single.astype(float)).bounds
    assert np.array_equal(bounds.lower, exact.lower)
    assert np.array_equal(bounds.upper, exact.upper)
