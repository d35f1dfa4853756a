import numpy as np
import pytest

from alphacut.rve import Phase
from alphacut.rve.certificate import CertificateError
from alphacut.rve.spheres.bounds import hashin_shtrikman
from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.spheres.packing import SpherePacking
from benchmarks.rve.many_material import (
    between_sizes,
    isotropic_bulk,
    isotropic_shear,
    isotropic_young,
    random_material,
)
from benchmarks.rve.many_random_cells import CellSample, RandomCells, smooth_odd

MATRIX, STIFF = Phase(20e9), Phase(80e9)
LAW = LogNormalRadii(1e-3, 1e-2)


def cells(spheres, count=8, **options):
    return RandomCells(SpherePacking(spheres, 0.2, LAW), count, 4, **options)


def made_up(spheres, count, rng, *, bias=0.0, grid=0.0):
    """Cells whose moduli scatter by 1 % about 10 GPa, off by `bias`/N and by `grid`/n²."""
    wish = cells(spheres, count)
    own = 1e10 * (1 + 0.01 * rng.standard_normal((count, 1)) + bias / spheres) * np.ones(3)
    refined = own[:4, None, :] * (1 + grid / np.array(wish.grids)[:, None] ** 2)
    return CellSample(wish, own * (1 + grid / wish.grids[0] ** 2), refined)


def test_material_of_few_small_cells_obeys_the_bounds():
    sizes = [cells(n, resolution=4) for n in (8, 16)]
    found = random_material(*sizes, MATRIX, STIFF, seed=3)
    limits = hashin_shtrikman(np.array(0.2), MATRIX, STIFF)
    for modulus, (low, high) in zip((found.bulk, found.shear), limits, strict=True):
        assert low - modulus.error <= modulus.value <= high
        assert 0 < modulus.error < 0.03 * modulus.value


def test_a_cell_is_the_same_whatever_else_is_solved():
    first, again = (cells(10, count).cell(5, seed=2) for count in (8, 20))
    np.testing.assert_array_equal(first.centres, again.centres)
    assert (cells(10).cell(5, seed=3).centres != first.centres).any()


def test_grids_are_extrapolated_and_what_they_leave_is_declared():
    sample = made_up(30, 8, np.random.default_rng(1), grid=5.0)
    mean = sample.mean(isotropic_bulk)
    truth = sample.coarse[:, 0].mean() / (1 + 5 / sample.cells.grids[0] ** 2)
    assert mean.value == pytest.approx(truth, rel=1e-4)
    assert mean.discretisation >= 0.5 * 5 / sample.cells.grids[3] ** 2 * truth * 0.99


def test_the_coarsest_grid_takes_no_part_in_the_limit():
    """All cells stand on it: what it is off by is taken off, whatever its law."""
    wish = made_up(30, 8, np.random.default_rng(1), grid=5.0)
    off = np.full(3, 1e8)
    refined = wish.refined.copy()
    refined[:, 0] += off
    other = CellSample(wish.cells, wish.coarse + off, refined)
    first, second = (sample.mean(isotropic_bulk) for sample in (wish, other))
    assert second.value == pytest.approx(first.value, rel=1e-9)
    assert second.discretisation == pytest.approx(first.discretisation, rel=1e-9)


def test_the_interval_over_cells_covers():
    """Means of normal values, true 1e10, 300 times: 95 %, less three standard errors."""
    rng = np.random.default_rng(8)
    inside = [
        abs(mean.value - 1e10) <= mean.statistics
        for mean in (made_up(30, 10, rng).mean(isotropic_bulk) for _ in range(300))
    ]
    assert 0.95 - 3 * np.sqrt(0.95 * 0.05 / 300) <= np.mean(inside) <= 0.995


def test_a_bias_that_falls_with_size_is_declared():
    rng = np.random.default_rng(9)
    found = [
        between_sizes(*(made_up(n, 200, rng, bias=3.0) for n in (20, 60)), isotropic_bulk)
        for _ in range(100)
    ]
    assert np.mean([abs(own.value - 1e10) <= own.error for own in found]) >= 0.92
    assert min(own.finite_size for own in found) > 0.04 * 1e10


def test_isotropic_moduli_belong_together():
    moduli = np.array([20e9, 11e9, 9e9])
    shear = isotropic_shear(moduli)
    assert shear == pytest.approx(9.8e9)
    assert isotropic_young(moduli) == pytest.approx(9 * 20e9 * shear / (60e9 + shear))


def test_grids_are_odd_and_have_small_factors():
    assert [smooth_odd(x) for x in (2.0, 16.8, 31.0, 38.2, 79.8)] == [3, 15, 33, 39, 81]


def test_moduli_outside_the_bounds_have_no_certificate(monkeypatch):
    rng = np.random.default_rng(1)
    monkeypatch.setattr(
        RandomCells, "solve", lambda own, *_, **__: made_up(own.packing.spheres, 8, rng)
    )
    with pytest.raises(CertificateError, match=r"bulk modulus .* outside the Hashin.*do not use"):
        random_material(cells(20), cells(40), MATRIX, STIFF, seed=1)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: cells(10, 5), "take at least 8"),
        (lambda: RandomCells(SpherePacking(10, 0.2, LAW), 8, 3), "from 4 of them"),
        (lambda: cells(10, resolution=2), r"must lie in \[4, 100\]"),
        (lambda: random_material(cells(10), cells(15), MATRIX, STIFF, seed=1), "twice as many"),
        (
            lambda: random_material(
                cells(10), RandomCells(SpherePacking(30, 0.3, LAW)), MATRIX, STIFF, seed=1
            ),
            "same volume fraction",
        ),
    ],
)
def test_what_does_not_fit_is_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_a_cell_that_finds_no_packing_is_refused():
    wide = RandomCells(SpherePacking(2, 0.5, LogNormalRadii(1.0, 1.0)))
    with pytest.raises(RefusedError, match="too large for its periodic cube"):
        wide.cell(0, seed=1)
