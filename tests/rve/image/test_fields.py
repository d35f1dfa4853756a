"""What the fields of images are made of: elements, energies, preconditioner, solver and pores.

Margins for rounding are tight within a factor of two somewhere, so that halving one, or leaving it
out, turns its test red. Rounded sums are judged by the order of summation that does worst: the
first term is 1, each other one is lost.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System, inner
from alphacut.rve.image.fields.element import element_of
from alphacut.rve.image.fields.energy import (
    COEFFICIENT,
    UNIT,
    Energies,
    coefficients_of,
    energies,
    minimum_energy,
    modes_by_matrices,
    modes_of,
    solve_side,
    solved_loads,
)
from alphacut.rve.image.fields.grid import Operator
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference
from tests.rve.image.test_bounds import LOST, TIGHT, discs, image_of, in_order, random_moduli, tight

KINDS = {
    "displacement": {"dual": False},
    "stress": {"dual": True},
    "temperature": {"dual": False, "conduction": True},
    "flux": {"dual": True, "conduction": True},
}
SIDES = pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)


ELEMENTS = [element_of((1.0, 1.0), **kind) for kind in KINDS.values()]


def moduli_of(kind, moduli):
    """Two moduli, or the second one alone as a conductivity."""
    return list(moduli[1:] if "conduction" in kind else moduli)


@SIDES
@pytest.mark.parametrize("size", [1e-12, 1e-6, 1e-2, 10.0])
def test_a_perturbed_field_still_bounds(kind, size):
    rng, element = np.random.default_rng(3), element_of((1.0, 1.0), **kind)
    moduli = moduli_of(kind, image_of(discs(24, rng), ((40.0, 25.0), (7.0, 3.0))))
    best = solve_side(element, moduli, solver=TIGHT)
    noise = size * rng.normal(size=best.fields.shape)
    trial = energies_of(element, moduli, best.fields + noise)
    least = best.energy.value.sum(axis=0)
    gap = np.linalg.eigvalsh(trial.upper - least + 1e-11 * np.eye(len(least)))
    assert gap[0] >= 0
    assert size < 1e-3 or gap[0] > 1e-4 * np.abs(least).max()


def energies_of(element, moduli, fields):
    """Energies of fields under the unit loads."""
    weights = coefficients_of(element, moduli)
    return energies(element, fields, element.mean_modes(np.eye(len(fields))), weights)


@SIDES
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("load", range(2))
def test_no_system_lacks_more_energy_than_its_accuracy(kind, seed, load):
    """With bulk moduli nearly equal the first steps gain nearly nothing: a pause, not the end."""
    rng = np.random.default_rng([seed, 517])
    mask = np.kron(rng.random((5, 5)) < 0.2, np.ones((4, 4))) > 0
    mask[:4, :4] = True
    element = element_of((0.7, 1.0), **kind)
    weights = np.where(mask, 1.4785, 1.4780), np.where(mask, 92.2, 1.78)
    system = system_of(element, moduli_of(kind, weights), load)
    solved = ConjugateGradient(1e-14).solve(system)
    shares = []
    for accuracy in 10.0 ** np.arange(-8, 0):
        wrong = ConjugateGradient(accuracy).solve(system) - solved
        lacking = inner(wrong, system.operator(wrong))
        shares.append(lacking / system.scale / accuracy)
    assert max(shares) <= 1 + 1e-5
    assert max(shares) > 0.02  # so no work is wasted


def system_of(element, coefficients, load=0):
    """The system of one of the loads on periodic fields."""
    constant = Reference.of_grid(element, coefficients)
    inverse = FourierPreconditioner.of_material(element, constant, coefficients[0].shape)
    operator, modes = Operator(element, coefficients), element.mean_modes(solved_loads(element))
    scale = minimum_energy(element, coefficients, modes)[load]
    ratio = constant.min_energy_ratio(coefficients)
    right_hand_side = operator.load(modes[:, load : load + 1])
    return System(operator.apply, inverse.apply, right_hand_side, scale, ratio)


@SIDES
@pytest.mark.parametrize("seed", range(3))
def test_no_field_has_less_energy_than_the_constant_material_says(kind, seed):
    """All ratios of a small image, as eigenvalues; uniform fields have none."""
    element = element_of((0.7, 1.0), **kind)
    coefficients = random_moduli(np.random.default_rng(seed), (5, 6), span=100)
    system = system_of(element, moduli_of(kind, coefficients))
    size = element.unknowns * 30
    units = np.eye(size).reshape(size, -1, 5, 6)
    maps = (m(units).reshape(size, size) for m in (system.preconditioner, system.operator))
    ratios = np.linalg.eigvals(np.linalg.multi_dot([x.T for x in maps])).real
    ratios = ratios[np.abs(ratios) > 1e-6 * system.min_energy_ratio]
    assert system.min_energy_ratio <= ratios.min() < 3 * system.min_energy_ratio


@SIDES
def test_the_preconditioner_inverts_waves_of_any_length(kind, rng):
    """The longest ones of a slope have 1e-8 of the energy of the shortest."""
    element, shape = element_of((0.7, 1.0), **kind), (300, 2)
    weights = moduli_of(kind, [np.full(shape, 2.0), np.full(shape, 0.7)])
    constant = Reference.of_grid(element, weights)
    inverse = FourierPreconditioner.of_material(element, constant, shape)
    operator = Operator(element, [np.full(shape, x) for x in constant.coefficients])
    fields = inverse.apply(rng.normal(size=(1, element.unknowns, *shape)))
    again = inverse.apply(operator.apply(fields))
    assert np.abs(again - fields).max() < 1e-5 * np.abs(fields).max()


@SIDES
def test_the_preconditioner_inverts_one_material_to_single_precision(kind, rng):
    element, shape = element_of((0.7, 2.0, 1.0), **kind), (16, 3, 40)
    weights = moduli_of(kind, [3e-12, 2e-12])
    constant = Reference(tuple(weights), element.trace_in_deviator)
    inverse = FourierPreconditioner.of_material(element, constant, shape)
    operator = Operator(element, [x * np.ones(shape) for x in weights])
    noise = rng.normal(size=(1, element.unknowns, *shape))
    fields = inverse.apply(operator.apply(noise))  # without gauge
    wrong = inverse.apply(operator.apply(fields)) - fields
    energy, off = (np.sum(x * operator.apply(x)) for x in (fields, wrong))
    assert 0 < off < (1e-6 if element.dual else 1e-12) * energy


@SIDES
def test_kernels_do_what_the_elements_matrices_do(kind, rng):
    element = element_of((0.7, 2.0, 1.0), **kind)
    for shape in ((2, 3, 4), (5, 2, 7), (3, 4, 1)):
        weights = moduli_of(kind, rng.uniform(0.1, 2, (2, *shape)))
        operator = Operator(element, weights)
        fields = rng.normal(size=(2, element.unknowns, *shape))
        by_matrices = operator.apply_by_matrices(fields)
        largest = np.abs(by_matrices).max()
        assert operator.apply(fields) == pytest.approx(by_matrices, abs=1e-14 * largest)
        means = element.mean_modes(rng.normal(size=(2, len(element.part_matrix))))
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
        assert (total + alone) * weights[0].size == pytest.approx(work + work.T)


def test_energies_are_those_of_three_gauss_points_an_axis(rng):
    """Stresses at the points by splines and Beltrami's derivatives written out."""
    sides, shape = np.array([0.7, 2.0, 1.0]), (3, 4, 5)
    element = element_of(tuple(sides), dual=True)
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


@pytest.mark.parametrize("conduction", [False, True], ids=["stress", "flux"])
def test_fields_of_potentials_are_in_equilibrium(conduction, rng):
    """They do no work on any compatible field, nor on a uniform one."""
    sides = 0.7, 2.0, 1.0
    stress, strain = (element_of(sides, dual=x, conduction=conduction) for x in (True, False))
    shape = 4, 5, 6
    potentials = rng.normal(size=(1, stress.unknowns, *shape))
    stresses = _components(stress, potentials)
    displacements = rng.normal(size=(1, strain.unknowns, *shape))
    for unknowns in (displacements, 0 * displacements):
        strains = _components(strain, unknowns)
        if not unknowns.any():
            strains[:, 0, 0, 0] += rng.normal(size=(len(strains), 1, 1, 1))
        work = np.sum(stresses * strains)
        assert abs(work) < 1e-13 * np.sqrt(np.sum(stresses**2) * np.sum(strains**2))


def _components(element, fields):
    """Voigt components of a field in orthonormal modes, (6, modes along z, y, x, *grid)."""
    ((_, modes, _, _),) = modes_by_matrices(element, fields, np.zeros((len(element.modes), 1)))
    n = len(element.part_matrix)
    modes = modes.reshape(n, *[round((len(modes) / n) ** (1 / 3))] * 3, *fields.shape[2:])
    widths = [(0, 3 - n if axis in (1, 2, 3) else 0) for axis, n in enumerate(modes.shape)]
    return np.tensordot(np.linalg.inv(element.part_matrix), np.pad(modes, widths), axes=1)


def test_the_sum_of_products():
    element = ELEMENTS[0]
    fields, means = np.zeros((1, 8, 3, 3)), np.ones((len(element.modes), 1))
    result = energies(element, fields, means, (np.ones((3, 3)), np.zeros((3, 3))))
    terms = 9 + len(element.modes) + 1  # cells, modes and one slab
    lost = in_order([1.0] + [LOST] * (terms - 1)) + COEFFICIENT * Fraction(UNIT)
    assert tight(Fraction(result.summed), lost)


@pytest.mark.parametrize("element", ELEMENTS, ids=KINDS)
def test_the_product_of_modes_and_unknowns(element):
    count = len(element.local)
    row = int(np.argmax((element.modes != 0).sum(axis=1)))
    used = [k for k in range(count) if element.modes[row, k] != 0]
    fields = np.zeros((1, element.unknowns, 4, 4))
    for k in used:
        kind, (up, right) = element.local[k]
        fields[0, kind, 1 + up, 1 + right] = (1.0 if k == used[0] else LOST) / element.modes[row, k]
    ((_, _, amplification, local),) = modes_of(element, fields, np.zeros((len(element.modes), 1)))
    rounding = (amplification @ local[:, 0]).reshape(-1, 4, 4)
    # a sum in order, the entries of the matrix off by ten units and their products by one
    error = in_order([1.0] + [LOST] * (len(used) - 1)) + 11 * Fraction(UNIT)
    assert tight(Fraction(rounding[row, 1, 1]), error)


def test_errors_of_modes_that_all_point_one_way():
    element = ELEMENTS[0]
    fields, means = np.zeros((2, 8, 3, 3)), np.ones((len(element.modes), 2)) * [3.0, 5.0]
    result = energies(element, fields, means, (np.ones((3, 3)), np.zeros((3, 3))))
    by_modes = replace(result, summed=0.0).rounding
    count, unit = element.bulk_rows, Fraction(UNIT)  # of modes, each off by a unit
    for a, b in ((0, 0), (0, 1), (1, 1)):
        product = Fraction(float(means[0, a] * means[0, b]))
        error = count * product * ((1 + unit) ** 2 - 1)
        assert tight(Fraction(float(by_modes[0, a, b])), error)


def test_errors_of_entries_that_all_lift_one_load():
    scale = np.array([1.0, 1e3, 1e-3])  # loads of any size count alike
    value, wrong = np.ones((1, 3, 3)) * np.outer(scale, scale), 1e-3
    one = Energies(value, np.zeros((1, 3)), wrong)
    lifted = one.value[0] + one.rounding[0]
    inverse = np.diag(1 / scale)
    assert np.linalg.eigvalsh(inverse @ (one.upper - lifted) @ inverse)[0] >= -1e-15
    half = one.value[0] + np.diag(np.diagonal(one.upper - one.value[0])) / 2
    assert np.linalg.eigvalsh(inverse @ (half - lifted) @ inverse)[0] < 0
