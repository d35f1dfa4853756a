"""Series of hexagonal and rectangular arrays, and of the conduction across their fibres."""

import numpy as np
import pytest

from alphacut.rve import Phase, SeriesModel, SpheresModel, constants, fibre_conductivity
from alphacut.rve.cell.lattice import HEXAGONAL, SQUARE, lattice_of
from alphacut.rve.result.checks import CertificateError, with_checks
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.circles import lattice_moduli, plane_moduli
from alphacut.rve.series.fibre_constants import fibre_constants
from alphacut.rve.series.lattice_sums import lattice_sums
from alphacut.stochastic import HermiteMap
from tests.refused import refuses
from tests.rve.image.test_conduction import multipoles, published
from tests.rve.series.test_series import random_cells
from tests.rve.test_result import crisp_cell

MATRIX = Phase(20e9)


@pytest.mark.parametrize("lattice", ["hexagonal", [1, 1.7], [2.6, 1]])
def test_lattice_sums_are_those_over_many_points(lattice):
    cell = lattice_of(lattice)
    first, second = (complex(*vector) for vector in cell.half_vectors[:2])
    steps = np.arange(-150.0, 151.0)
    p = (steps[:, None] * first + steps * second).ravel()
    p = p[abs(p) > 0]
    sums = lattice_sums(60, cell)
    for n in (6, 12, 38, 40, 44):
        assert sums.plain[n] == pytest.approx((p**-n).sum().real, abs=1e-8)
    for n in (7, 11, 39, 41, 43):
        assert sums.conjugate[n] == pytest.approx((p.conj() * p**-n).sum().real, abs=1e-8)


@pytest.mark.parametrize("lattice", ["square", "hexagonal", [1, 1.7], [2.6, 1]])
def test_conditional_sums_give_the_jumps_across_the_cell(lattice):
    """Those of ζ and of Natanzon's Q over half a period, whose series converges like 2^-n."""
    sums = lattice_sums(120, lattice_of(lattice))
    half = (0.5 + 0j) * min((complex(*v) for v in lattice_of(lattice).half_vectors), key=abs)
    n = np.arange(2, 120)
    zeta = 1 / half - np.sum(sums.plain[2:120] * half ** (n - 1))
    period = np.pi / abs(np.linalg.det(np.array(lattice_of(lattice).half_vectors[:2])))
    assert 2 * zeta == pytest.approx(period * np.conj(2 * half), rel=1e-13)
    natanzon = np.sum((n - 1) * sums.conjugate[2:120] * half ** (n - 2))
    weierstrass = 1 / half**2 + np.sum((n - 1) * sums.plain[2:120] * half ** (n - 2))
    assert 2 * natanzon == pytest.approx(np.conj(2 * half) * weierstrass, rel=1e-13)


def test_all_odd_harmonics_give_the_square_as_every_fourth_does(rng):
    for radius, *phases in random_cells(5, rng, highest=0.9):
        square = plane_moduli(np.array([radius]), phases, 40)[0, 0]
        odd = lattice_moduli(np.array([radius]), phases, 80, lattice=SQUARE)[0, 0]
        np.testing.assert_allclose(odd[:3], square, rtol=1e-12)
        np.testing.assert_allclose(odd[3:], (square[0] + square[1]) / 2, rtol=1e-12)


def test_equal_sides_are_the_square_to_the_bit():
    cell = 0.8, MATRIX, Phase(80e9)
    found = crisp_cell(*cell, lattice=[3, 3])
    assert np.array_equal(found.stiffness, crisp_cell(*cell).stiffness)
    assert found.cell.lattice == SQUARE


def test_a_hexagonal_array_is_isotropic_though_shear_is_a_load_of_its_own(rng):
    for cell in random_cells(20, rng, highest=0.98):
        found = crisp_cell(*cell, lattice="hexagonal")
        C = found.stiffness
        assert C[0, 0] == pytest.approx(C[1, 1], rel=1e-11)
        assert abs(C[0, 0] - C[0, 1] - 2 * C[2, 2]) <= 1e-9 * C[0, 0]
        assert found.checks["isotropy"] <= 1e-11


def test_a_hexagonal_result_that_is_not_isotropic_is_an_error():
    found = crisp_cell(0.7, MATRIX, Phase(80e9), lattice="hexagonal")
    curve = found.curve
    stiffness = curve.stiffness.copy()
    stiffness[:, 2, 2] *= 1 + 1e-6
    wrong = type(curve)(curve.theta, curve.weights, curve.s11, curve.s12, stiffness)
    with pytest.raises(CertificateError, match="is not isotropic across the fibres"):
        with_checks(HomogenisedStiffness(wrong, "x", errors=found.errors, cell=found.cell))


def test_turned_rectangles_change_their_axes(rng):
    for radius, *phases in random_cells(5, rng, highest=0.95):
        ratio = rng.uniform(1, 10)
        wide = crisp_cell(radius, *phases, lattice=[ratio, 1]).stiffness
        tall = crisp_cell(radius, *phases, lattice=[1, ratio]).stiffness
        order = [1, 0, 2]
        np.testing.assert_allclose(wide, tall[np.ix_(order, order)], rtol=1e-12, atol=1e-3)
    stretched = crisp_cell(0.8, MATRIX, Phase(150e9, 0.1), lattice=[2, 1]).stiffness
    assert stretched[0, 0] != pytest.approx(stretched[1, 1], rel=1e-2)


@pytest.mark.parametrize("lattice", ["hexagonal", [1, 1.6]])
def test_a_shift_of_compliances_shifts_the_effective_one(lattice):
    """Cherkaev, Lurie & Milton 1992, for any arrangement; see `test_series`."""
    rotation = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -2.0]])
    shift = 4e-12

    def shifted(phase):
        a, b, _ = np.linalg.inv(phase.stiffness)[0] + shift * rotation[0]
        nu = -b / a / (1 - b / a)
        return Phase((1 - nu**2) / a, nu)

    phases = MATRIX, Phase(150e9, 0.1)
    for radius in (0.3, 0.8, 0.95):
        plain = crisp_cell(radius, *phases, lattice=lattice).stiffness
        moved = crisp_cell(radius, *map(shifted, phases), lattice=lattice).stiffness
        right = np.linalg.inv(plain) + shift * rotation
        np.testing.assert_allclose(np.linalg.inv(moved), right, rtol=1e-12, atol=1e-25)


@pytest.mark.parametrize("lattice", ["hexagonal", [1, 1.4], [3, 1]])
def test_declared_errors_hold_on_other_lattices(lattice):
    for cell in random_cells(8, 5, highest=0.99):
        found, exact = (crisp_cell(*cell, accuracy=x, lattice=lattice) for x in (1e-4, 1e-12))
        true = abs(found.stiffness - exact.stiffness).diagonal()
        rounding = 1e-12 * exact.stiffness.diagonal()
        assert (true <= found.stiffness_errors.diagonal() + rounding).all()


def constant(radius):
    return HermiteMap(radius, 0.0, radius, 0.0)


@pytest.mark.parametrize("radius", [0.3, 0.8])
def test_hexagonal_fibres_conduct_as_published(radius):
    fraction = np.pi * radius**2 / (2 * np.sqrt(3))
    found = fibre_conductivity(constant(radius), 1.0, 30.0, lattice="hexagonal").values
    assert found["k_T"] == pytest.approx(published(fraction, 30.0, hexagonal=True), rel=1e-5)
    assert found["k_T"] == pytest.approx(multipoles(fraction, 30.0, hexagonal=True), rel=1e-9)
    assert found["k_L"] == pytest.approx(1 + 29 * fraction, rel=1e-12)


def test_fibres_on_a_rectangle_conduct_by_keller():
    """k_x and k_y of exchanged materials multiply to the product of both (Keller 1964)."""
    found = fibre_conductivity(constant(0.9), 1.0, 30.0, lattice=[1, 1.6]).values
    exchanged = fibre_conductivity(constant(0.9), 30.0, 1.0, lattice=[1, 1.6]).values
    assert found["k_x"] * exchanged["k_y"] == pytest.approx(30.0, rel=1e-11)
    assert found["k_x"] > 1.2 * found["k_y"]


def test_fibres_of_a_hexagonal_array_have_their_constants():
    found = constants(crisp_cell(0.7, MATRIX, Phase(80e9), lattice="hexagonal"))
    # E_T of the transversely isotropic body is that of its plane stiffness without axial stress.
    assert found.values["E_T"] == pytest.approx(found.values["E_y_free"], abs=found.errors["E_T"])
    assert found.values["G_T"] == pytest.approx(found.values["G_xy"], rel=1e-12)
    rectangle = crisp_cell(0.7, MATRIX, Phase(80e9), lattice=[1, 2])
    assert "E_T" not in constants(rectangle).values
    with refuses("cell"):
        fibre_constants(rectangle)


def test_a_hexagonal_cell_has_a_larger_fraction():
    found = crisp_cell(0.999, MATRIX, MATRIX, lattice="hexagonal")
    assert found.fractions[1] == pytest.approx(np.pi / np.sqrt(12) * 0.999**2, rel=1e-12)
    assert found.cell.lattice == HEXAGONAL
    np.testing.assert_allclose(found.stiffness, MATRIX.stiffness, rtol=1e-13, atol=1e-3)


@pytest.mark.parametrize(
    "lattice", ["cubic", [1], [1, 2, 3], [0, 1], [1, -2], [1, 10.5], [1, np.nan], 2, None, ["a", 1]]
)
def test_other_lattices_are_refused_in_one_line(lattice):
    with refuses("lattice") as found:
        SeriesModel(lattice=lattice)
    assert "\n" not in str(found.value)


def test_spheres_have_the_cubic_array_alone():
    with refuses("lattice"):
        SpheresModel(lattice="hexagonal")
