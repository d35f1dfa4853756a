"""Tilings and windows."""

import numpy as np
import pytest
from scipy.stats import t as student

from alphacut.rve.image.fields.clamped import ClampedPreconditioner
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.fields.element import airy_element, displacement_element
from alphacut.rve.image.fields.operator import Operator
from alphacut.rve.image.fields.side import DISPLACEMENT, STRESS, solve_side
from alphacut.rve.image.moduli import PlaneModuli
from alphacut.rve.image.solve import solve_image
from alphacut.rve.image.windows import Tiling, tiles_of
from benchmarks.rve.image.cases import solve_tiles


def random_image(rng, size):
    mask = np.kron(rng.random((size // 4, size // 4)) < rng.uniform(0.2, 0.8), np.ones((4, 4))) > 0
    first, second = np.exp(rng.uniform(0, np.log(20), (2, 2)))
    return np.where(mask, first[0], second[0]), np.where(mask, first[1], second[1])


@pytest.mark.parametrize("seed", range(10))
def test_the_tiles_bracket_the_periodic_cell(seed):
    rng = np.random.default_rng(seed)
    bulk, shear = random_image(rng, 24)
    cell = solve_image(bulk, shear, solver=ConjugateGradient(1e-9)).bounds
    along = int(rng.integers(1, 5))
    found = solve_tiles(tiles_of(bulk, along), tiles_of(shear, along)).bracket
    assert np.linalg.eigvalsh(found.upper - cell.upper)[0] >= 0
    assert np.linalg.eigvalsh(cell.lower - found.lower)[0] >= 0


@pytest.mark.parametrize("element", [displacement_element(0.7), airy_element(0.7)])
def test_the_preconditioner_inverts_a_clamped_tile_of_one_material(element):
    rng = np.random.default_rng(0)
    inverse = ClampedPreconditioner.of(element, 2.0, 0.7, (7, 6))
    fields = rng.normal(size=(2, 1, element.types, 7, 6)) * inverse.free
    ones = np.ones((2, 7, 6))
    forces = Operator(element, 2.0 * ones, 0.7 * ones).apply(fields) * inverse.free
    assert np.allclose(inverse.apply(forces), fields, atol=1e-4)


def test_fields_of_a_clamped_tile_vanish_on_its_edge_and_need_no_more_iterations():
    bulk, shear = (a[None] for a in random_image(np.random.default_rng(1), 32))
    for side, edge in ((DISPLACEMENT, [0, 1, 4, 5]), (STRESS, [0, 1, 2, 3])):
        held = solve_side(side, bulk, shear, solver=ConjugateGradient(), clamped=True)
        free = solve_side(side, bulk, shear, solver=ConjugateGradient())
        assert not held.fields[:, :, edge, 0].any()
        assert held.fields.any()
        assert held.iterations <= 2 * free.iterations + 2


def test_the_interval_of_the_material_holds_the_bracket_and_shrinks_with_more_tiles():
    rng = np.random.default_rng(2)
    bulk, shear = random_image(rng, 64)
    tilings = [solve_tiles(tiles_of(bulk, n), tiles_of(shear, n)) for n in (2, 4)]
    for tiling in tilings:
        low, high = tiling.material_modulus()
        inner = tiling.bracket.modulus
        assert low < inner[0]
        assert inner[1] < high


def test_the_interval_is_that_of_student_for_tiles_of_known_scatter():
    scales = np.random.default_rng(3).uniform(0.8, 1.3, 9)
    stiffness = PlaneModuli.of_young(20.0, 0.3).stiffness
    tiling = Tiling(
        scales[:, None, None] * stiffness, np.linalg.inv(stiffness) / scales[:, None, None]
    )
    quantile = student.ppf(0.975, 8) / 3
    softness = 1 / scales
    low = 20 / softness.mean() - quantile * 20 * softness.std(ddof=1) / softness.mean() ** 2
    high = 20 * scales.mean() + quantile * 20 * scales.std(ddof=1)
    assert np.allclose(tiling.material_modulus(), (low, high), rtol=1e-9)


def test_tiles_whose_modulus_may_fall_with_a_give_no_interval():
    for count, cure in ((4, "a larger picture"), (9, "fewer tiles .cell.tiles., so that each is")):
        slack = np.stack(count * [PlaneModuli(0.4, 1.0).stiffness])  # A/B = 2.5
        with pytest.raises(ValueError, match=rf"2\.5 times the bulk .* from 1\.5 .*: take {cure}"):
            Tiling(slack, np.linalg.inv(slack)).material_modulus()


def test_fewer_tiles_cure_what_many_leave_undecided():
    bulk = np.where(np.random.default_rng(1).random((48, 48)) < 0.02, 1e-3, 1.0)
    with pytest.raises(ValueError, match="take fewer tiles"):
        solve_tiles(*[tiles_of(m, 12) for m in (bulk, bulk / 2)]).material_modulus()
    low, high = solve_tiles(*[tiles_of(m, 2) for m in (bulk, bulk / 2)]).material_modulus()
    assert low < high


def test_one_tile_gives_no_interval():
    ones = np.ones((1, 4, 4))
    with pytest.raises(ValueError, match="one tile has no scatter"):
        solve_tiles(ones, ones).material_modulus()


@pytest.mark.parametrize("along", [0, 5, 40])
def test_images_without_equal_tiles_are_refused(along):
    with pytest.raises(ValueError, match=f"64 × 64 pixels has no {along} × {along} equal tiles"):
        tiles_of(np.ones((64, 64)), along)
