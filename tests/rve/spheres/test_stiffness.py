"""Spheres: the series of one cell against limits and bounds, lattice sums, and mean results."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from alphacut.fuzzy import FailedError
from alphacut.rve import Phase, SpheresModel, reference_bounds
from alphacut.rve.spheres.lattice_sums import harmonics, lattice_sums
from alphacut.rve.spheres.multipoles import t_matrices
from alphacut.rve.spheres.result import cubic_moduli, cubic_voigt, hill_average, spheres_with_checks
from alphacut.stochastic import HermiteMap
from tests.rve.series.test_series import random_cells

SPHERES = SpheresModel().series
MATRIX, STIFF = Phase(20e9), Phase(80e9)
MAP = HermiteMap(0.1337, 0.1, 0.8663, 0.1692)


def moduli(radius, matrix, inclusion, **options):
    """K, (C11 − C12)/2 and C44 of one cell, in Pa."""
    return SPHERES.converged_moduli([radius], matrix, [inclusion], **options).moduli[0, 0]


def sphere_fraction(radius):
    return np.pi / 6 * radius**3


def material(bulk, shear):
    return Phase(
        9 * bulk * shear / (3 * bulk + shear), (3 * bulk - 2 * shear) / (6 * bulk + 2 * shear)
    )


@pytest.mark.parametrize("inclusion", [Phase(90e9, 0.1), Phase(1e-3, 0.2), Phase(1e22, 0.4)])
def test_dilute_limit_of_eshelby(inclusion):
    """One sphere in an infinite matrix (Eshelby 1957): stiff, a pore, rigid."""
    radius = 5e-3
    (km, gm), (ki, gi) = MATRIX.bulk_and_shear, inclusion.bulk_and_shear
    zeta = gm / 6 * (9 * km + 8 * gm) / (km + 2 * gm)
    exact = sphere_fraction(radius) * np.array(
        [
            (ki - km) * (km + 4 / 3 * gm) / (ki + 4 / 3 * gm),
            *[(gi - gm) * (gm + zeta) / (gi + zeta)] * 2,
        ]
    )
    np.testing.assert_allclose(moduli(radius, MATRIX, inclusion) - [km, gm, gm], exact, rtol=2e-6)


@pytest.mark.parametrize("radius", [0.3, 0.8, 0.92])
def test_equal_shear_moduli_give_hills_bulk_modulus(radius):
    """Hill (1963): K = ⟨1/(K + 4μ/3)⟩⁻¹ − 4μ/3 for any arrangement; μ stays."""
    shear, bulks, share = 8e9, (12e9, 300e9), sphere_fraction(radius)
    exact = 1 / ((1 - share) / (bulks[0] + 4 / 3 * shear) + share / (bulks[1] + 4 / 3 * shear))
    found = moduli(radius, *(material(bulk, shear) for bulk in bulks), tolerance=1e-11)
    np.testing.assert_allclose(found, [exact - 4 / 3 * shear, shear, shear], rtol=1e-10)


@pytest.mark.parametrize(
    ("radius", "sphere", "above"),
    [
        (0.5, Phase(80e9), (17.8634967, 8.37797679, 8.31895222)),
        (0.8, Phase(80e9, 0.2), (20.9233572, 11.5159106, 10.5847089)),
        (0.6, Phase(20e5, 0.2), (12.4874792, 6.33933821, 6.0699863)),
    ],
)
def test_finite_elements_on_one_eighth_of_the_cell_lie_above_and_near(radius, sphere, above):
    """Curved tetrahedra of second order, edges of 0.25: energies are right to 8e-4, from above."""
    excess = np.array(above) * 1e9 / moduli(radius, MATRIX, sphere) - 1
    assert (excess > 0).all()
    assert (excess < 8e-4).all()


def viscosity(radius, **options):
    """Viscosities over that of the fluid, of rigid spheres in an incompressible one, less 1."""
    nu = 0.5 - 1e-9
    return moduli(radius, Phase(2 * (1 + nu), nu), Phase(1e13), **options)[1:] - 1


@pytest.mark.parametrize("share", [0.005, 0.02])
def test_rigid_spheres_in_a_fluid_of_zuzovsky(share):
    """Zuzovsky, Adler & Brenner, Phys. Fluids 26, 1714 (1983): a, b of the simple cubic lattice."""
    a, b = 0.2857, -0.04655
    expected = [
        2.5 * share / (1 - (1 - 60 * b) * share + 12 * a * share ** (5 / 3)),
        2.5 * share / (1 - (1 + 40 * b) * share - 8 * a * share ** (5 / 3)),
    ]
    found = viscosity((6 * share / np.pi) ** (1 / 3))
    np.testing.assert_allclose(found, expected, rtol=12 * share ** (7 / 3))


def test_rigid_spheres_near_contact_follow_lubrication():
    """The singular terms of Nunan & Keller, J. Fluid Mech. 142, 269 (1984), with gap 2(1 − r)."""

    def rest(radius):
        gap = 1 - radius
        log = np.log(1 / gap)
        singular = [3 / 16 * np.pi / gap + 27 / 80 * np.pi * log, np.pi / 4 * log]
        return viscosity(radius, tolerance=1e-4) - singular

    first, second = rest(0.9), rest(0.96)
    assert abs(second - first).max() < 0.02  # while they themselves grow by 9.6 and 0.75


def test_hashin_shtrikman_and_the_traces_enclose():
    for radius, matrix, inclusion in random_cells(25, 3, highest=0.95):
        bulk, deviator, shear = moduli(radius, matrix, inclusion, tolerance=1e-5)
        share = sphere_fraction(radius)
        limits = reference_bounds([matrix, inclusion], fractions=[1 - share, share], space=True)
        assert limits.bulk[0] * (1 - 1e-9) <= bulk <= limits.bulk[1] * (1 + 1e-9)
        reference = [min(p.bulk_and_shear[1] for p in (matrix, inclusion)), 0.0]
        mean = 5 / (2 / (deviator - reference[0]) + 3 / (shear - reference[0])) + reference[0]
        assert mean >= limits.shear[0] * (1 - 1e-4)


def test_declared_error_holds_and_is_no_fable():
    ratios = []
    rng = np.random.default_rng(11)
    for radius, matrix, inclusion in random_cells(25, 2, highest=0.93):
        tolerance = 10 ** rng.uniform(-8, -2)
        cell = SPHERES.converged_moduli([radius], matrix, [inclusion], tolerance=tolerance)
        exact = moduli(radius, matrix, inclusion, tolerance=min(1e-10, tolerance / 1e3))
        found = cell.moduli[0, 0]
        true = abs(found / exact - 1)
        assert (cell.errors[0, 0] + 1e-12 >= true).all(), (radius, matrix, inclusion, tolerance)
        assert cell.errors.max() <= tolerance
        if true.max() > 1e-12:
            ratios.append(cell.errors.max() / true.max())
    assert len(ratios) > 12
    assert np.median(ratios) < 30


def test_a_mild_contrast_stops_at_the_tolerance_asked():
    loose, tight = (
        SPHERES.converged_moduli([0.98], MATRIX, [STIFF], tolerance=tolerance)
        for tolerance in (1e-5, 1e-7)
    )
    assert loose.terms < 0.75 * tight.terms  # seven times the time
    assert 1e-7 < loose.errors.max() <= 1e-5


@pytest.mark.parametrize("steps", [7, pytest.param(15, marks=pytest.mark.slow)])
def test_nearly_touching_spheres_are_refused(steps):
    shorter = replace(SPHERES, steps=SPHERES.steps[:steps])
    with pytest.raises(
        FailedError, match=r"r = 0\.998 reaches a relative error of .* nearly touch"
    ):
        shorter.converged_moduli([0.998], MATRIX, [Phase(20e12)], tolerance=1e-8)


def test_twice_the_shear_modulus_of_the_matrix_divides_by_nothing():
    matrix, twice = Phase(20e9, 0.25), Phase(40e9 * 1.3 / 1.25, 0.3)
    with np.errstate(all="raise"):
        pair, torsion = t_matrices(np.arange(6), matrix, twice)
    near = t_matrices(np.arange(6), matrix, Phase(twice.modulus * (1 + 1e-9), 0.3))
    assert np.allclose(torsion, near[1], rtol=1e-7)
    assert np.allclose(pair, near[0], rtol=1e-6)


def test_ewald_sums_agree_with_direct_ones():
    points = np.array([p for p in product(range(-9, 10), repeat=3) if 0 < np.dot(p, p) <= 81.0])
    radius = np.linalg.norm(points, axis=1)
    harmonic, biharmonic = lattice_sums(44)
    for order in (0, 4, 8, 12):
        angular = harmonics(points.astype(float), 44, order)
        for n in (12, 16, 22, 40, 42):
            assert harmonic[n, order] == pytest.approx(angular[n] @ radius ** (-n - 1.0), abs=1e-10)
            assert biharmonic[n, order] == pytest.approx(angular[n] @ radius ** (1.0 - n), abs=1e-9)


def test_mean_over_theta_is_that_of_a_fine_rule():
    result = SpheresModel().solve(MAP, MATRIX, [STIFF])[0]
    fine = SpheresModel(points=24, accuracy=1e-11).solve(MAP, MATRIX, [STIFF])[0]
    np.testing.assert_allclose(result.moduli, fine.moduli, rtol=1e-9)
    true = abs(result.moduli / fine.moduli - 1)
    assert (true <= result.modulus_errors + 1e-12).all()
    assert abs(result.modulus / fine.modulus - 1) <= result.estimated_error


def test_bounds_meet_the_phases_and_mori_and_tanaka():
    def ends_of(share):
        bounds = reference_bounds([MATRIX, STIFF], fractions=[1 - share, share], space=True)
        return np.array([bounds.bulk, bounds.shear])

    for share, phase in ((0.0, MATRIX), (1.0, STIFF)):
        np.testing.assert_allclose(ends_of(share).T, np.broadcast_to(phase.bulk_and_shear, (2, 2)))
    ends = ends_of(0.2092)
    for k, (share, phases) in enumerate([(0.2092, [MATRIX, STIFF]), (0.7908, [STIFF, MATRIX])]):
        (km, gm), (ki, gi) = (phase.bulk_and_shear for phase in phases)
        zeta = gm / 6 * (9 * km + 8 * gm) / (km + 2 * gm)
        bulk = km + share * (ki - km) / (1 + (1 - share) * (ki - km) / (km + 4 / 3 * gm))
        shear = gm + share * (gi - gm) / (1 + (1 - share) * (gi - gm) / (gm + zeta))
        np.testing.assert_allclose([bulk, shear], ends[:, k])
    bulk, shear = ends[:, 0]
    assert hill_average(np.array([bulk, shear, shear]))[0] == pytest.approx(25.78e9, abs=5e6)


@pytest.mark.parametrize(
    ("factors", "words"),
    [((0.9, 1.0, 1.0), "Reuss|Hashin"), ((1.08, 1.0, 1.0), "Hashin"), ((1.0, 3.0, 1.0), "Voigt")],
)
def test_a_wrong_stiffness_has_no_certificate(factors, words):
    result = SpheresModel(accuracy=1e-6).solve(MAP, MATRIX, [STIFF])[0]
    moduli = cubic_moduli(result.curve.stiffness) * factors
    wrong = replace(result.curve, stiffness=cubic_voigt(*moduli.T))
    with pytest.raises(FailedError, match=words):
        spheres_with_checks(replace(result, curve=wrong))
