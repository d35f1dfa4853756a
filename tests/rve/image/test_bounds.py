"""Bounds of crisp images: exact cases, fields that are not solved for, convergence."""

from itertools import pairwise

import numpy as np
import pytest

from alphacut.rve.image.bounds import StiffnessBounds, inverse_below
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.energy import energy
from alphacut.rve.image.fields.side import DISPLACEMENT, STRESS, UNIT_LOADS, solve_side
from alphacut.rve.image.fields.solver import ConvergenceError
from alphacut.rve.image.moduli import PlaneModuli
from alphacut.rve.image.solve import solve_image

TIGHT = ConjugateGradient(accuracy=1e-11)


def stiffness(bulk, shear):
    """Plane-strain stiffness of an isotropic material from K + G/3 and G, shape (3, 3)."""
    return np.array(
        [[bulk + shear, bulk - shear, 0], [bulk - shear, bulk + shear, 0], [0, 0, shear]]
    )


def laminate(fraction, phases):
    """Exact stiffness of layers normal to x: σ11, σ12 and ε22 are uniform."""
    layers = [stiffness(*phase) for phase in phases]
    shares = (fraction, 1 - fraction)
    across = 1 / sum(s / c[0, 0] for s, c in zip(shares, layers, strict=True))
    ratio = sum(s * c[0, 1] / c[0, 0] for s, c in zip(shares, layers, strict=True))
    free = sum(s * (c[1, 1] - c[0, 1] ** 2 / c[0, 0]) for s, c in zip(shares, layers, strict=True))
    shear = 1 / sum(s / c[2, 2] for s, c in zip(shares, layers, strict=True))
    along = free + across * ratio**2
    return np.array([[across, across * ratio, 0], [across * ratio, along, 0], [0, 0, shear]])


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


@pytest.mark.parametrize("seed", range(20))
def test_laminates_are_inside_and_the_bounds_meet_on_them(seed):
    rng = np.random.default_rng(seed)
    columns, rows = rng.integers(2, 40, 2)
    layers = rng.random(columns) < rng.uniform(0.2, 0.8)
    layers[:2] = True, False
    mask, phases = np.tile(layers, (rows, 1)), random_phases(rng)
    exact = laminate(layers.mean(), phases)
    result = solve_image(*image_of(mask, phases), aspect=rng.uniform(0.5, 2), solver=TIGHT).bounds
    assert result.contains(exact)
    assert result.width < 1e-8
    turned = solve_image(*image_of(mask.T, phases), solver=TIGHT).bounds
    assert turned.contains(exact[np.ix_([1, 0, 2], [1, 0, 2])])


@pytest.mark.parametrize("seed", range(20))
def test_mixtures_of_equal_shear_moduli_are_inside(seed):
    rng = np.random.default_rng(seed)
    (first, shear), (second, _) = random_phases(rng)
    mask = discs(24, rng, number=int(rng.integers(2, 9)))
    share = mask.mean()
    bulk = 1 / (share / (first + shear) + (1 - share) / (second + shear)) - shear  # Hill 1964
    result = solve_image(*image_of(mask, ((first, shear), (second, shear)))).bounds
    assert result.contains(stiffness(bulk, shear))


@pytest.mark.parametrize("seed", range(10))
def test_chequerboards_of_one_bulk_modulus_keep_their_product_of_shear_moduli(seed):
    """Adding a constant to 1/(K + G/3) and taking it from 1/G makes the phases incompressible.

    Turning deviators by 45° then exchanges stress and strain (Berdichevskii 1979; Cherkaev, Lurie and Milton 1992).
    """
    rng = np.random.default_rng(seed)
    (bulk, first), (_, second) = random_phases(rng)
    mask = np.kron([[1, 0], [0, 1]], np.ones((12, 12))) > 0
    result = solve_image(*image_of(mask, ((bulk, first), (bulk, second)))).bounds
    products = [
        (1 / c[2, 2] + 1 / bulk) * (1 / ((c[0, 0] - c[0, 1]) / 2) + 1 / bulk)
        for c in (result.upper, result.lower)
    ]
    exact = (1 / first + 1 / bulk) * (1 / second + 1 / bulk)
    assert products[0] <= exact <= products[1]
    assert all(form[0] <= 2 * bulk <= form[1] for form in [result.bulk])


@pytest.mark.parametrize("side", [DISPLACEMENT, STRESS], ids=lambda side: side.name)
@pytest.mark.parametrize("size", [1e-12, 1e-6, 1e-2, 10.0])
def test_a_perturbed_field_still_bounds(side, size):
    rng = np.random.default_rng(3)
    bulk, shear = (a[None] for a in image_of(discs(24, rng), ((40.0, 25.0), (7.0, 3.0))))
    best = solve_side(side, bulk, shear, solver=TIGHT)
    noise = size * rng.normal(size=best.fields.shape)
    element = side.element(1.0)
    trial = energy(
        element,
        *side.coefficients(bulk, shear),
        best.fields + noise,
        element.mean_modes(UNIT_LOADS),
    )
    gap = np.linalg.eigvalsh(trial.upper[0] - best.energy.value[0] + 1e-11 * np.eye(3))
    assert gap[0] >= 0
    assert size < 1e-3 or gap[0] > 1e-4 * np.abs(best.energy.value).max()


def test_two_iterations_bound_more_widely_and_enclose():
    bulk, shear = image_of(discs(32, np.random.default_rng(5)), ((40.0, 25.0), (4.0, 2.5)))
    whole, early = (
        solve_image(bulk, shear, solver=rule).bounds
        for rule in (TIGHT, ConjugateGradient(iterations=2))
    )
    assert np.linalg.eigvalsh(early.upper - whole.upper)[0] > 0
    assert np.linalg.eigvalsh(whole.lower - early.lower)[0] > 0
    assert whole.width < early.width < 0.5


@pytest.mark.parametrize("contrast", [4.0, 100.0])
def test_the_stopping_rule_leaves_the_energy_asked_for(contrast):
    bulk, shear = image_of(
        discs(48, np.random.default_rng(6)), ((2 * contrast, contrast), (2.0, 1.0))
    )
    exact = solve_image(bulk, shear, solver=ConjugateGradient(1e-13)).bounds
    for accuracy in (1e-3, 1e-5):
        found = solve_image(bulk, shear, solver=ConjugateGradient(accuracy)).bounds
        for near, true in ((found.upper, exact.upper), (exact.lower, found.lower)):
            excess = np.linalg.eigvals(np.linalg.solve(true, near - true)).real
            assert excess.min() > -1e-12
            assert excess.max() < 2 * accuracy


def test_the_width_is_first_order_in_the_pixel():
    mask = discs(256, np.random.default_rng(1), number=5)
    phases = ((4 * 1.6, 4.0), (1.6, 1.0))
    sizes = (32, 64, 128)
    widths = [
        solve_image(*image_of(mask[:: 256 // n, :: 256 // n], phases)).bounds.width for n in sizes
    ]
    assert all(1.5 < a / b < 2.7 for a, b in pairwise(widths))


def test_divided_pixels_narrow_the_bounds_of_the_same_image():
    bulk, shear = image_of(discs(24, np.random.default_rng(2)), ((40.0, 25.0), (7.0, 3.0)))
    whole = solve_image(bulk, shear, aspect=0.8, solver=ConjugateGradient(1e-7)).bounds
    parts = solve_image(bulk, shear, aspect=0.8, division=2, solver=ConjugateGradient(1e-7)).bounds
    assert np.linalg.eigvalsh(whole.upper - parts.upper)[0] > 0
    assert np.linalg.eigvalsh(parts.lower - whole.lower)[0] > 0
    assert parts.width < whole.width / 2


def test_a_turned_image_has_the_turned_stiffness():
    rng = np.random.default_rng(8)
    bulk, shear = image_of(discs(20, rng), ((40.0, 25.0), (7.0, 3.0)))
    first = solve_image(bulk, shear, aspect=0.5, solver=TIGHT).bounds
    turned = solve_image(bulk.T[:, ::-1], shear.T[:, ::-1], aspect=2.0, solver=TIGHT).bounds
    swap = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1.0]])
    assert np.allclose(turned.upper, swap @ first.upper @ swap, rtol=1e-9, atol=1e-9)
    assert np.allclose(turned.lower, swap @ first.lower @ swap, rtol=1e-9, atol=1e-9)


def test_a_homogeneous_image_is_exact():
    bulk, shear = np.full((6, 9), 3.0), np.full((6, 9), 2.0)
    result = solve_image(bulk, shear)
    assert result.upper.iterations == 0
    assert result.bounds.contains(stiffness(3.0, 2.0))
    assert result.bounds.width < 1e-13


def test_the_rounding_bound_covers_the_difference_to_a_sum_in_long_double():
    rng = np.random.default_rng(9)
    bulk, shear = (a[None] for a in image_of(discs(16, rng), ((40.0, 25.0), (7.0, 3.0))))
    for side in (DISPLACEMENT, STRESS):
        element = side.element(1.0)
        fields = 1e3 * rng.normal(size=(1, 3, element.types, 16, 16))
        found = energy(element, bulk, shear, fields, element.mean_modes(UNIT_LOADS))
        exact = long_energy(element, bulk[0], shear[0], fields[0])
        error = np.abs(found.value[0] - exact)
        assert (error <= found.rounding[0]).all()
        assert found.rounding[0].max() < 1e-12 * np.abs(exact).max()


def long_energy(element, bulk, shear, fields):
    """The mean energies in extended precision, with rolled arrays and no anchors."""
    modes = element.modes.astype(np.longdouble)
    local = [
        np.roll(fields[:, kind], (-y, -x), axis=(1, 2))
        for kind, (y, x) in zip(element.local_types, element.shifts, strict=True)
    ]
    values = np.einsum("rn,nlyx->rlyx", modes, np.array(local, dtype=np.longdouble))
    values += element.mean_modes(UNIT_LOADS)[:, :, None, None]
    rows = element.bulk_rows
    sums = [
        np.einsum("yx,rjyx,rkyx->jk", c.astype(np.longdouble), v, v)
        for c, v in ((bulk, values[:rows]), (shear, values[rows:]))
    ]
    return sum(sums) / bulk.size


def test_the_modulus_of_eq_16_of_an_isotropic_material():
    young, poisson = 20.0, 0.3
    moduli = PlaneModuli.of_young(young, poisson)
    exact = stiffness(moduli.bulk, moduli.shear)
    low, high = StiffnessBounds(exact, exact).modulus
    assert low <= young * (1 + 1e-14)
    assert high >= young * (1 - 1e-14)
    assert high - low < 1e-12


@pytest.mark.parametrize("seed", range(5))
def test_the_modulus_is_inside_its_bounds_where_it_falls_with_a(seed):
    rng = np.random.default_rng(seed)
    bulk, shear = np.sort(10 ** rng.uniform(-1, 1, (2, 2)))  # A/B from 0.01 to 100
    bounds = StiffnessBounds(stiffness(bulk[0], shear[0]), stiffness(bulk[1], shear[1]))
    (a0, a1), (b0, b1) = bounds.shear, bounds.bulk
    a, b = (x[..., None] for x in np.meshgrid(np.linspace(a0, a1, 400), np.linspace(b0, b1, 40)))
    inside = 1.5 * a - a * a / (2 * b)
    low, high = bounds.modulus
    assert low <= inside.min() <= low + 1e-9 * abs(low) + 1e-12
    assert inside.max() <= high <= inside.max() + 1e-4 * (a1 + a1**2 / b0)


def test_the_inverse_is_below_in_every_direction():
    rng = np.random.default_rng(0)
    for _ in range(200):
        root = rng.normal(size=(3, 3)) @ np.diag([1, 10.0 ** rng.uniform(-4, 0), 1])
        matrix = root @ root.T
        matrix = (matrix + matrix.T) / 2
        product = matrix.astype(np.longdouble) @ inverse_below(matrix).astype(np.longdouble)
        assert np.linalg.eigvals(product.astype(float)).real.max() <= 1 + 1e-15


def test_too_few_iterations_raise(monkeypatch):
    monkeypatch.setattr("alphacut.rve.image.fields.conjugate_gradient.LIMIT", 3)
    bulk, shear = image_of(discs(16, np.random.default_rng(0)), ((40.0, 25.0), (7.0, 3.0)))
    with pytest.raises(ConvergenceError, match="have not converged in 3 iterations"):
        solve_image(bulk, shear, solver=TIGHT)


@pytest.mark.parametrize(
    ("options", "told"),
    [({"accuracy": 0}, "accuracy of the energy is 0"), ({"iterations": -1}, "-1 iterations")],
)
def test_bad_stopping_rules_are_refused(options, told):
    with pytest.raises(ValueError, match=told):
        ConjugateGradient(**options)
