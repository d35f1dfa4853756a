"""Every ingredient of the proof of an image's bounds, each tight within a factor of two somewhere.

Rounded sums are judged by the order of summation that does worst: the first term is 1, each other
one is lost. Halving a margin, or leaving it out, turns its test red.
"""

from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest

from alphacut.rve.image.bounds import StiffnessBounds, hill_mean, inverse_below, residual_above
from alphacut.rve.image.fields.element import element_of
from alphacut.rve.image.fields.energy import (
    COEFFICIENT,
    UNIT,
    Energies,
    energies,
    modes_of,
)
from alphacut.rve.image.losses import mean_loss
from alphacut.rve.result.moduli import AVERAGES, AXES

LOST = UNIT * (1 - 2.0**-20)  # just too little to change 1
ELEMENTS = [element_of((1.0, 1.0), stress=stress) for stress in (False, True)]


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


def test_the_sum_of_products():
    element = ELEMENTS[0]
    fields, means = np.zeros((1, 8, 3, 3)), np.ones((len(element.modes), 1))
    result = energies(element, fields, means, (np.ones((3, 3)), np.zeros((3, 3))))
    terms = 9 + len(element.modes) + 1  # cells, modes and one slab
    lost = in_order([1.0] + [LOST] * (terms - 1)) + COEFFICIENT * Fraction(UNIT)
    assert tight(Fraction(result.summed), lost)


@pytest.mark.parametrize("element", ELEMENTS, ids=["displacement", "stress"])
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
    if average != AXES:
        shear = ((shear + diagonal) / 2 + 2 / (1 / shear + 1 / diagonal)) / 2
    return bulk, shear, 3 * shear - shear**2 / bulk, (1 - shear / bulk) / 2


@pytest.mark.parametrize("average", AVERAGES)
def test_the_constants_of_one_stiffness(average):
    rng, used = np.random.default_rng(1), np.zeros(4)
    for _ in range(3000):
        bulk = np.exp(rng.uniform(0, 3))
        shear = bulk * 10.0 ** rng.choice([rng.uniform(-1, 0), rng.uniform(0.3, 4)])
        c11, c22 = bulk + shear * np.exp(0.1 * rng.normal(size=2))
        c12 = bulk - shear
        one = np.array([[c11, c12, 0], [c12, c22, 0], [0, 0, shear * np.exp(0.1 * rng.normal())]])
        bounds = StiffnessBounds(one, one)
        ends = bounds.bulk, bounds.shear(average), bounds.young(average), bounds.poisson(average)
        for k, ((low, high), exact) in enumerate(zip(ends, rational(one, average), strict=True)):
            assert low <= exact <= high
            if high > low:
                off = abs(exact - (Fraction(low) + Fraction(high)) / 2)
                used[k] = max(used[k], off / ((Fraction(high) - Fraction(low)) / 2))
    assert (used[:2] > 0.5).all() if average != AXES else used[0] > 0.5


@pytest.mark.parametrize("sides", [(0.8, 1.0), (0.8, 1.2, 1.0)])
def test_what_fields_are_off_by_is_in_the_rounding_of_their_energies(sides, rng):
    element = element_of(sides, stress=True)
    shape = (2, element.unknowns, *(3, 4, 5)[: len(sides)])
    fields, off = rng.normal(size=shape), 1e-6 * rng.normal(size=shape)
    means = element.mean_modes(rng.normal(size=(2, len(element.of_voigt.T))))
    weights = tuple(rng.uniform(0.5, 2.0, (2, *shape[2:])))
    found = energies(element, fields, means, weights, abs(off))
    exact, without = (energies(element, x, means, weights) for x in (fields + off, fields))
    error = abs(exact.value - without.value)
    assert (error <= found.rounding).all()
    assert (error > 1e3 * without.rounding).any()
    assert (found.rounding < 1e3 * error.max()).all()
