"""Bounds of crisp images: exact cases, fields that are not solved for, convergence."""

import numpy as np
import pytest

from alphacut.fuzzy import FailedError
from alphacut.rve.image.bounds import StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient, System, inner
from alphacut.rve.image.fields.element import element_of
from alphacut.rve.image.fields.energy import (
    coefficients_of,
    energies,
    minimum_energy,
    solve_side,
    solved_loads,
)
from alphacut.rve.image.fields.grid import Operator
from alphacut.rve.image.fields.preconditioner import FourierPreconditioner, Reference
from alphacut.rve.image.model import solve_image
from alphacut.rve.result.engineering_constants import EngineeringConstants
from tests.rve.image.test_voxels import isotropic, laminate

TIGHT = ConjugateGradient(accuracy=1e-11)
SIDES = pytest.mark.parametrize("stress", [False, True], ids=["displacement", "stress"])


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


@pytest.mark.parametrize("seed", range(8))
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


@pytest.mark.parametrize("seed", range(8))
def test_mixtures_of_equal_shear_moduli_are_inside(seed):
    rng = np.random.default_rng(seed)
    (first, shear), (second, _) = random_phases(rng)
    mask = discs(24, rng, number=int(rng.integers(2, 9)))
    share = mask.mean()
    bulk = 1 / (share / (first + shear) + (1 - share) / (second + shear)) - shear  # Hill 1964
    result = solve_image(*image_of(mask, ((first, shear), (second, shear)))).bounds
    assert result.contains(stiffness(bulk, shear))


@SIDES
@pytest.mark.parametrize("size", [1e-12, 1e-6, 1e-2, 10.0])
def test_a_perturbed_field_still_bounds(stress, size):
    rng, element = np.random.default_rng(3), element_of((1.0, 1.0), stress=stress)
    bulk, shear = image_of(discs(24, rng), ((40.0, 25.0), (7.0, 3.0)))
    best = solve_side(element, bulk, shear, solver=TIGHT)
    noise = size * rng.normal(size=best.fields.shape)
    trial = energies_of(element, bulk, shear, best.fields + noise)
    least = best.energy.value.sum(axis=0)
    gap = np.linalg.eigvalsh(trial.upper - least + 1e-11 * np.eye(3))
    assert gap[0] >= 0
    assert size < 1e-3 or gap[0] > 1e-4 * np.abs(least).max()


def energies_of(element, bulk, shear, fields):
    """Energies of fields under the unit loads."""
    weights = coefficients_of(element, bulk, shear)
    return energies(element, fields, element.mean_modes(np.eye(3)), weights)


@pytest.mark.parametrize("shape", [(24, 20), (4, 5, 6)])
def test_divided_elements_narrow_the_bounds_of_the_same_image(shape, rng):
    moduli, sides = random_moduli(rng, shape, span=10.0), (0.8, *(1.0,) * (len(shape) - 1))
    whole, parts = (
        solve_image(*moduli, sides=sides, division=n, solver=ConjugateGradient(1e-9)).bounds
        for n in (1, 2)
    )
    for inner_bound, outer_bound in ((parts.upper, whole.upper), (whole.lower, parts.lower)):
        narrowed = np.linalg.eigvalsh(outer_bound - inner_bound)
        # phases that nearly agree in one modulus leave bounds that differ by less than rounding
        assert narrowed[0] > -1e-12 * abs(outer_bound).max()
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


@pytest.mark.parametrize("seed", range(5))
def test_intervals_of_constants_hold_all_stiffnesses_between_the_bounds_and_meet(seed):
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(2, 3, 3))
    lower, change = (root @ root.T + 0.1 * np.eye(3) for root in roots)
    ends = StiffnessBounds(lower, lower + change).constants()
    for turn in np.linalg.qr(rng.normal(size=(300, 3, 3)))[0]:
        part = turn @ np.diag(rng.uniform(0, 1, 3) ** 0.2) @ turn.T  # 0 ≤ part ≤ 1
        root = np.linalg.cholesky(change)
        between = EngineeringConstants.of_stiffness(lower + root @ part @ root.T, np.zeros((3, 3)))
        assert (ends[:, 0] <= between.values).all()
        assert (between.values <= ends[:, 1]).all()
    for exact, place in ((lower, 1), (lower + change, 0)):
        values = EngineeringConstants.of_stiffness(exact, np.zeros((3, 3))).values
        assert ends[[0, 1, 3], 1 - place] == pytest.approx(values[[0, 1, 3]], rel=1e-9)


# when the solver stops: the energy that is left, and the bound of it


def random_moduli(rng, shape, span=1e3):
    """Two phases whose moduli differ by up to `span`, each on a random share of the pixels."""
    phases = np.exp(rng.uniform(0, np.log(span), (2, 2)))
    mask = rng.random(shape) < rng.uniform(0.1, 0.9)
    mask.flat[:2] = True, False
    return tuple(np.where(mask, *pair) for pair in phases)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("accuracy", [1e-2, 1e-5])
def test_bounds_are_as_close_to_those_of_solved_fields_as_the_accuracy(seed, accuracy):
    rng = np.random.default_rng([seed, 1])
    moduli = random_moduli(rng, rng.integers(2, 24, 2))
    solved = solve_image(*moduli, solver=ConjugateGradient(1e-12)).bounds
    near = solve_image(*moduli, solver=ConjugateGradient(accuracy)).bounds
    pairs = ((near.upper, solved.upper), (solved.lower, near.lower))
    ratios = np.array([np.linalg.eigvals(np.linalg.solve(b, a)).real for a, b in pairs])
    assert ratios.min() > 1 - 1e-9
    assert ratios.max() < 1 + 3 * accuracy + 1e-9


@SIDES
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("load", range(3))
def test_no_system_lacks_more_energy_than_its_accuracy(stress, seed, load):
    """With bulk moduli nearly equal the first steps gain nearly nothing: a pause, not the end."""
    rng = np.random.default_rng([seed, 517])
    mask = np.kron(rng.random((5, 5)) < 0.2, np.ones((4, 4))) > 0
    mask[:4, :4] = True
    element = element_of((0.7, 1.0), stress=stress)
    system = system_of(element, np.where(mask, 1.4785, 1.4780), np.where(mask, 92.2, 1.78), load)
    solved = ConjugateGradient(1e-14).solve(system)
    shares = []
    for accuracy in 10.0 ** np.arange(-8, 0):
        wrong = ConjugateGradient(accuracy).solve(system) - solved
        lacking = inner(wrong, system.operator(wrong))
        shares.append(lacking / system.scale / accuracy)
    assert max(shares) <= 1 + 1e-5
    assert max(shares) > 0.02  # so no work is wasted


def system_of(element, trace, deviator, load=0):
    """The system of one of three loads on periodic fields."""
    constant = Reference.of_grid(element, trace, deviator)
    inverse = FourierPreconditioner.of_material(element, constant, trace.shape)
    operator, modes = Operator(element, trace, deviator), element.mean_modes(solved_loads(2))
    scale = minimum_energy(element, trace, deviator, modes)[load]
    ratio = constant.min_energy_ratio(trace, deviator)
    right_hand_side = operator.load(modes[:, load : load + 1])
    return System(operator.apply, inverse.apply, right_hand_side, scale, ratio)


@SIDES
@pytest.mark.parametrize("seed", range(3))
def test_no_field_has_less_energy_than_the_constant_material_says(stress, seed):
    """All ratios of a small image, as eigenvalues; uniform fields have none."""
    element = element_of((0.7, 1.0), stress=stress)
    trace, deviator = random_moduli(np.random.default_rng(seed), (5, 6), span=100)
    system = system_of(element, trace, deviator)
    size = element.unknowns * trace.size
    units = np.eye(size).reshape(size, -1, 5, 6)
    maps = (m(units).reshape(size, size) for m in (system.preconditioner, system.operator))
    ratios = np.linalg.eigvals(np.linalg.multi_dot([x.T for x in maps])).real
    ratios = ratios[np.abs(ratios) > 1e-6 * system.min_energy_ratio]
    assert system.min_energy_ratio <= ratios.min() < 3 * system.min_energy_ratio


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


@SIDES
def test_the_preconditioner_inverts_waves_of_any_length(stress, rng):
    """The longest ones of a slope have 1e-8 of the energy of the shortest."""
    element, shape = element_of((0.7, 1.0), stress=stress), (300, 2)
    constant = Reference.of_grid(element, np.full(shape, 2.0), np.full(shape, 0.7))
    inverse = FourierPreconditioner.of_material(element, constant, shape)
    operator = Operator(element, np.full(shape, constant.trace), np.full(shape, constant.deviator))
    fields = inverse.apply(rng.normal(size=(1, element.unknowns, *shape)))
    again = inverse.apply(operator.apply(fields))
    assert np.abs(again - fields).max() < 1e-5 * np.abs(fields).max()


@pytest.mark.parametrize("matrix", [np.ones((3, 3)), np.diag([1.0, 0.0, 1.0])])
def test_a_singular_matrix_has_no_bounds_of_its_inverse(matrix):
    singular = pytest.raises(FailedError, match="singular to rounding")
    with np.errstate(divide="ignore", invalid="ignore"), singular:
        inverse_below(matrix)
