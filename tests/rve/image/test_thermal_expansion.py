"""Thermal stress and expansion by bounds of the stiffness, against thermal loads that are solved.

The finite elements here share nothing with the package. Their spaces contain the displacements of
the upper bound, so that their stiffness lies between the bounds, and so does what follows from it.
"""

from itertools import product

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss
from scipy.sparse import coo_array
from scipy.sparse.linalg import splu

from alphacut.fuzzy import FailedError, Triangular
from alphacut.rve import (
    GreyImage,
    Phase,
    SpheresModel,
    ThermalBounds,
    declared_bounds,
    fuzzy_image_stiffness,
    fuzzy_thermal_bounds,
    solve_image,
    thermal_bounds,
)
from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.stochastic import HermiteMap
from tests.refused import refuses

IDENTITY = {2: np.array([1.0, 1, 0]), 3: np.array([1.0, 1, 1, 0, 0, 0])}


def plane_or_space(young, poisson, alpha, n):
    """C, and the pressure of 1 K at zero strain, of a phase; in the plane at ε33 = 0."""
    shear = young / (2 * (1 + poisson))
    lame = young * poisson / ((1 + poisson) * (1 - 2 * poisson))
    identity = IDENTITY[n]
    stiffness = lame * np.outer(identity, identity) + shear * np.diag(1 + identity)
    return stiffness, young * alpha / (1 - 2 * poisson) * identity


def solved(phase, stiffness, pressure, *, division, order):
    """C̄ and β̄ of a periodic grid (x first) by elements of some order, and their sizes."""
    n = phase.ndim
    fine = np.kron(phase, np.ones((division,) * n, int))
    points, point_weights = leggauss(order + 1)
    points = (points + 1) / 2
    nodes = np.linspace(0, 1, order + 1)
    lagrange = [np.polynomial.Polynomial.fromroots(np.delete(nodes, k)) for k in range(order + 1)]
    lagrange = [p / p(nodes[k]) for k, p in enumerate(lagrange)]
    local = list(product(range(order + 1), repeat=n))
    pairs = [(0, 1)] if n == 2 else [(1, 2), (0, 2), (0, 1)]
    operators, weights = [], []
    for at in product(range(order + 1), repeat=n):
        operator = np.zeros((n + len(pairs), n * len(local)))
        for k, node in enumerate(local):
            slope = np.ones(n)
            for i, axis in product(range(n), repeat=2):
                function = lagrange[node[axis]]
                slope[i] *= (function.deriv() if i == axis else function)(points[at[axis]])
            for i in range(n):
                operator[i, n * k + i] = slope[i]
            for row, (i, j) in enumerate(pairs, n):
                operator[row, [n * k + i, n * k + j]] = slope[[j, i]]
        operators.append(operator)
        weights.append(np.prod(point_weights[list(at)] / 2))
    shape = np.array(fine.shape)
    count = order * shape
    rows, columns, entries = [], [], []
    loads = np.zeros((n * np.prod(count), n + len(pairs) + 1))
    of_phase = []
    for c, b in zip(stiffness, pressure, strict=True):
        matrix = sum(w * o.T @ c @ o for w, o in zip(weights, operators, strict=True))
        load = sum(w * o.T for w, o in zip(weights, operators, strict=True))
        of_phase.append((matrix, np.column_stack([load @ c, load @ b])))
    for cell in np.ndindex(*shape):
        places = (order * np.array(cell) + local) % count
        unknowns = np.ravel_multi_index(places.T, count)[:, None] * n + np.arange(n)
        unknowns = unknowns.ravel()
        matrix, load = of_phase[fine[cell]]
        rows.append(np.repeat(unknowns, len(unknowns)))
        columns.append(np.tile(unknowns, len(unknowns)))
        entries.append(matrix.ravel() * shape[0] ** 2)  # strains are in widths of an element
        loads[unknowns] += load * shape[0]
    triples = (np.concatenate(entries), (np.concatenate(rows), np.concatenate(columns)))
    matrix = coo_array(triples, shape=(len(loads),) * 2).tocsc()
    free = slice(n, None)  # the first node is held
    moves = splu(matrix[free, free]).solve(loads[free])
    fractions = np.bincount(phase.ravel()) / phase.size
    relaxed = loads[free].T @ moves / np.prod(shape)
    mean_stiffness = np.tensordot(fractions, stiffness, 1) - relaxed[:-1, :-1]
    return mean_stiffness, fractions @ pressure - relaxed[:-1, -1], fractions


def random_cell(rng, n, count):
    """Layers and grains of phases, turned to no axis, so that the cell is anisotropic."""
    shape = (6, 6) if n == 2 else (4, 4, 4)
    noise = rng.normal(size=shape)
    noise = noise + np.roll(noise, 1, 0) + np.roll(noise, (1, 1), (0, 1))
    edges = np.quantile(noise, np.arange(1, count) / count + rng.uniform(-0.1, 0.1, count - 1))
    young = 10 ** rng.uniform(9, 11, count)
    poisson = rng.uniform(-0.2, 0.45, count)
    return np.searchsorted(edges, noise), young, poisson, rng.uniform(-5e-6, 80e-6, count)


def image_bounds(phase, young, poisson, **settings):
    """Bounds of the stiffness; images have the last axis along x."""
    n = phase.ndim
    shear = young / (2 * (1 + poisson))
    bulk = young / (3 * (1 - 2 * poisson)) + (shear / 3 if n == 2 else 0)
    return solve_image(bulk[phase.T], shear[phase.T], **settings).bounds


def as_mappings(young, poisson):
    return [{"modulus": e, "poisson": nu} for e, nu in zip(young, poisson, strict=True)]


def with_mean(tensor, n):
    return np.append(tensor, tensor[:n].mean())


def require_inside(thermal, stiffness, stress, n, slack=1e-9):
    for found, value in (
        (thermal.stress, stress),
        (thermal.expansion, np.linalg.solve(stiffness, stress)),
    ):
        true = with_mean(value, n)
        margin = slack * abs(true).max()  # of the reference's own rounding
        assert (found[:, 0] <= true + margin).all()
        assert (true - margin <= found[:, 1]).all()


@pytest.mark.parametrize("n", [2, 3])
def test_two_phases_with_a_known_stiffness_follow_from_it(rng, n):
    for _ in range(3):
        phase, young, poisson, alpha = random_cell(rng, n, 2)
        parts = [plane_or_space(*values, n) for values in zip(young, poisson, alpha, strict=True)]
        order = 4 - n
        c, beta, fractions = solved(
            phase, *map(list, zip(*parts, strict=True)), division=1, order=order
        )
        known = StiffnessBounds(c, c)
        for given in (None, fractions):
            thermal = thermal_bounds(known, as_mappings(young, poisson), alpha, fractions=given)
            for found, true in (
                (thermal.stress, beta),
                (thermal.expansion, np.linalg.solve(c, beta)),
            ):
                scale = abs(true).max()
                assert abs(found - with_mean(true, n)[:, None]).max() < 1e-9 * scale


@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("n", [2, 3])
def test_bounds_hold_solved_thermal_loads(rng, n, count):
    phase, young, poisson, alpha = random_cell(rng, n, count)
    parts = [plane_or_space(*values, n) for values in zip(young, poisson, alpha, strict=True)]
    c, beta, fractions = solved(
        phase, *map(list, zip(*parts, strict=True)), division=2, order=4 - n
    )
    widths = []
    for division in (1, 2):
        bounds = image_bounds(phase, young, poisson, division=division)
        thermal = thermal_bounds(bounds, as_mappings(young, poisson), alpha, fractions=fractions)
        require_inside(thermal, c, beta, n)
        widths.append(np.ptp(thermal.stress, axis=1)[: n + 1])
    if count == 2:
        assert (widths[1] < widths[0]).all()


@pytest.mark.parametrize("n", [2, 3])
def test_equal_bulk_moduli_expand_by_the_mean(rng, n):
    phase, _, _, alpha = random_cell(rng, n, 2)
    bulk = 20e9
    shear = np.array([2e9, 15e9])
    # of the n-dimensional bulk modulus, which in the plane is K + G/3
    space_bulk = bulk - shear / 3 if n == 2 else np.full(2, bulk)
    pairs = [Phase.of_bulk_and_shear(*pair) for pair in zip(space_bulk, shear, strict=True)]
    young = np.array([p.modulus for p in pairs])
    poisson = np.array([p.poisson for p in pairs])
    parts = [plane_or_space(*values, n) for values in zip(young, poisson, alpha, strict=True)]
    c, beta, fractions = solved(
        phase, *map(list, zip(*parts, strict=True)), division=2, order=4 - n
    )
    bounds = image_bounds(phase, young, poisson)
    phases = as_mappings(young, poisson)
    thermal = thermal_bounds(bounds, phases, alpha, fractions=fractions)
    require_inside(thermal, c, beta, n)
    pressures = np.array([part[1][0] for part in parts])
    mean = fractions @ pressures
    scale = abs(pressures).max()  # pressures of both signs have a small mean
    assert abs(thermal.stress[-1] - mean).max() < 1e-9 * scale
    assert abs(thermal.expansion[-1] * n * bulk - mean).max() < 1e-9 * scale
    # Along the axes it is not the mean, which the reference shows.
    along_axes = np.zeros(len(beta))
    along_axes[:n] = mean
    assert abs(beta - along_axes).max() > 1e-8 * abs(mean)
    # Moduli that differ by a millionth are no worse.
    near = thermal_bounds(
        image_bounds(phase, young * [1, 1 + 1e-6], poisson),
        as_mappings(young * [1, 1 + 1e-6], poisson),
        alpha,
        fractions=fractions,
    )
    assert abs(near.stress[-1] - mean).max() < 1e-5 * scale


@pytest.mark.parametrize("n", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_high_contrast_and_a_pore(rng, n):
    phase = np.zeros((6,) * n, int)
    phase[(slice(2, 4),) * n] = 1
    alpha = np.array([10e-6, 40e-6])
    poisson = np.array([0.3, 0.2])
    for young in (np.array([1e7, 1e11]), np.array([1e11, 1e7])):
        parts = [plane_or_space(*values, n) for values in zip(young, poisson, alpha, strict=True)]
        c, beta, _ = solved(phase, *map(list, zip(*parts, strict=True)), division=2, order=4 - n)
        bounds = image_bounds(phase, young, poisson)
        require_inside(thermal_bounds(bounds, as_mappings(young, poisson), alpha), c, beta, n)
    young = np.array([70e9, 0.0])
    bounds = image_bounds(phase, young, poisson)
    assert bounds.has_lower
    lateral = 1.3 if n == 2 else 1
    for fractions in (None, [1 - phase.mean(), phase.mean()]):
        thermal = thermal_bounds(bounds, as_mappings(young, poisson), alpha, fractions=fractions)
        # The solid expands freely: the cell as it does, under C̄ of that strain when held.
        assert abs(thermal.expansion[[*range(n), -1]] / (lateral * 10e-6) - 1).max() < 1e-12
        strain = lateral * 10e-6 * IDENTITY[n]
        for side in (bounds.lower, bounds.upper):
            stress = side @ strain
            margin = 1e-12 * abs(stress).max()
            assert (thermal.stress[:-1, 0] <= stress + margin).all()
            assert (stress <= thermal.stress[:-1, 1] + margin).all()


@pytest.mark.parametrize("is_open", [True, False])
def test_fuzzy_values_hold_every_member(rng, is_open):
    n = 3 if is_open else 2  # the noise of a volume is not judged
    noise = rng.normal(size=(4,) * n)
    values = noise + np.roll(noise, 1, 0)
    threshold = Triangular(-0.1, 0.0, 0.1)
    parting = {"thresholds": [threshold]}
    if not is_open:
        values = (values > 0).astype(float)
        parting = {"labels": [0, 1]}
    soft, stiff = Triangular(2.8e9, 3e9, 3.3e9), Triangular(65e9, 70e9, 74e9)
    ratio = Triangular(0.33, 0.35, 0.36)
    phases = [{"modulus": soft, "poisson": ratio}, {"modulus": stiff, "poisson": 0.2}]
    alpha = [Triangular(55e-6, 60e-6, 66e-6), 5e-6]
    levels = (0, 0.5, 1)
    fuzzy = fuzzy_image_stiffness(GreyImage(values, (1.0,) * n), phases, alpha=levels, **parting)
    thermal = fuzzy_thermal_bounds(fuzzy, phases, alpha)
    assert (np.diff(thermal.stress[..., 0], axis=0) >= 0).all()
    assert (np.diff(thermal.expansion[..., 1], axis=0) <= 0).all()
    for row, level in enumerate(levels):
        e1, e2, nu, a1 = (rng.uniform(*x.cut(level)) for x in (soft, stiff, ratio, alpha[0]))
        grey = rng.uniform(*threshold.cut(level)) if is_open else 0.5
        phase = (values >= grey).astype(int).T
        parts = [plane_or_space(e1, nu, a1, n), plane_or_space(e2, 0.2, 5e-6, n)]
        c, beta, _ = solved(phase, *map(list, zip(*parts, strict=True)), division=2, order=4 - n)
        found = ThermalBounds(thermal.stress[row], thermal.expansion[row])
        require_inside(found, c, beta, n)


def test_a_cell_of_a_sphere_by_its_declared_errors():
    matrix, sphere = Phase(3e9, 0.35), Phase(70e9, 0.2)
    [result] = SpheresModel().solve(HermiteMap(0.3, 0.1, 0.7, 0.1), matrix, [sphere])
    phases = as_mappings([3e9, 70e9], [0.35, 0.2])
    thermal = thermal_bounds(declared_bounds(result), phases, [60e-6, 5e-6])
    bulks = np.array([matrix.bulk_and_shear[0], sphere.bulk_and_shear[0]])
    # Rosen and Hashin's formula of an isotropic composite of two phases.
    bulk = result.stiffness[0, :3].sum() / 3
    ratio = (60e-6 - 5e-6) / (1 / bulks[0] - 1 / bulks[1])
    expansion = 60e-6 + ratio * (1 / bulk - 1 / bulks[0])
    for row in (0, 1, 2, -1):
        low, high = thermal.expansion[row]
        assert low <= expansion <= high
        assert high - low < 1e-6 * expansion + 5 * result.largest_error * 60e-6


def test_wrong_phases_are_found_and_values_refused():
    stiffness, _ = plane_or_space(10e9, 0.3, 0, 2)
    known = StiffnessBounds(stiffness, stiffness)
    phases = as_mappings([3e9, 70e9], [0.35, 0.2])
    with refuses("fractions"):
        thermal_bounds(known, phases, [1e-6, 2e-6], fractions=[0.4, 0.5])
    with refuses("expansions"):
        thermal_bounds(known, phases, [1e-6])
    rigid = StiffnessBounds(stiffness, np.diag([np.inf] * 3))
    with refuses("bounds"):
        thermal_bounds(rigid, phases, [1e-6, 2e-6])
    wrong = as_mappings([30e9, 70e9], [0.3, 0.2])
    with pytest.raises(FailedError, match="no cell"):
        thermal_bounds(known, wrong, [1e-6, 50e-6], fractions=[0.5, 0.5])
