"""Lower bounds of cells with pores: stresses that vanish in them, against bounds by hand and limits."""

from itertools import product

import numpy as np
import pytest
from scipy.linalg import eigh

from alphacut.fuzzy import Interval, Triangular, from_data
from alphacut.rve import GreyImage, fuzzy_image_stiffness
from tests.refused import refuses

E, NU = 1e9, 0.25


def closed_pores(rng, shape):
    """Single cells and pairs of them, far enough apart to be pores of their own."""
    is_pore = np.zeros(shape, bool)
    for corner in product(*(range(0, n - 3, 5) for n in shape)):
        is_pore[corner] = True
        beside = list(corner)
        beside[rng.integers(len(shape))] += 1
        is_pore[tuple(beside)] = rng.random() < 0.5
    return np.roll(is_pore, rng.integers(0, 8, len(shape)), range(len(shape)))


def crisp_cut(is_pore, ratio=0.0, sides=None):
    """Proved cut of E = 1 GPa with pores of a fraction of its moduli."""
    image = GreyImage(is_pore.astype(float), sides or (1.0,) * is_pore.ndim)
    phases = [{"modulus": modulus, "poisson": NU} for modulus in (E, ratio * E)]
    found = fuzzy_image_stiffness(image, phases, labels=(0, 1), alpha=(1.0,), progress=False)
    return found.cuts[0]


def with_pores(*cell, **options):
    """Bounds of `crisp_cut`."""
    return crisp_cut(*cell, **options).bounds


def cube(n):
    """A cube of side 1/2 as a pore in a unit cell of n³ voxels."""
    inside = np.zeros((n,) * 3, bool)
    inside[(slice(n // 4, n - n // 4),) * 3] = True
    return inside


def test_columns_beside_a_cube_carry_three_quarters():
    """Uniaxial stress in the columns that meet no pore: E_x, E_y, E_z ≥ 3/4 E, whatever the sides."""
    low, high = with_pores(cube(8)).constants()[:3].T / E
    assert (high < 0.84).all()
    assert (low > 0.76887).all()  # what 1e-6 and 1e-8 in the pore tend to by splines
    moved = np.roll(cube(8), (3, 5, 0), (0, 1, 2))
    low, high = with_pores(moved, sides=(1.3, 0.7, 1.0)).constants()[:3].T / E
    assert (low >= 0.75).all()
    assert (high < 0.84).all()


def test_columns_beside_a_square_carry_half():
    square = np.zeros((8, 8), bool)
    square[2:6, 2:6] = True
    (low, high), *_ = with_pores(square).constants()
    assert 0.5 * E / (1 - NU**2) <= low < high


@pytest.mark.slow
def test_the_bulk_modulus_of_a_spherical_pore_is_bounded_closely():
    squares = (np.indices((14,) * 3) - 6.5) ** 2
    sphere = squares.sum(0) < (14 * (0.157 * 3 / 4 / np.pi) ** (1 / 3)) ** 2
    assert sphere.mean() == pytest.approx(0.157, abs=1e-3)
    low, high = np.array(with_pores(sphere).bulk) / E
    # 1e-8 of the modulus in the pore has .41731 … .46430 by splines, which are wider.
    assert 0.4174 < low < high < 0.46431


@pytest.mark.parametrize("shape", [(15, 20), (5, 5, 5)])
def test_pores_tend_to_phases_of_vanishing_moduli(shape, rng):
    is_pore = closed_pores(rng, shape)
    pores, soft = with_pores(is_pore), with_pores(is_pore, ratio=1e-6)
    assert eigh(pores.lower, pores.upper, eigvals_only=True)[-1] <= 1
    assert eigh(pores.lower, soft.upper, eigvals_only=True)[-1] <= 1
    ratio = eigh(pores.lower, soft.lower, eigvals_only=True)
    assert ratio[0] > 0.997  # of the potentials without stress, polynomials of second degree alone


def test_pores_carry_forces_from_one_to_the_next_in_the_plane():
    """Half a wall between two pores is as soft as the other one allows: not as if it were held."""
    is_pore = np.zeros((16, 16), bool)
    is_pore[2:7, 2:14] = is_pore[10:14, 4:9] = True
    pores, soft = with_pores(is_pore), with_pores(is_pore, ratio=1e-8)
    assert eigh(pores.lower, soft.lower, eigvals_only=True)[0] > 1 - 1e-4


def column(shape=(4, 7, 7)):
    """A hole along the first axis."""
    is_pore = np.zeros(shape, bool)
    is_pore[:, 3] = True
    return is_pore


@pytest.mark.parametrize(
    ("is_pore", "carried"),
    [
        (column(), [0, 0, 6 / 7]),
        (column((7, 9))[:, ::-1].T.copy(), [8 / 9, 0]),
        (np.roll(np.pad(np.ones((2, 2, 2), bool), (0, 1)), 2, 0), [4 / 9] * 3),
    ],
    ids=["column", "row", "thin walls"],
)
def test_walls_between_pores_that_meet_their_own_image_carry(is_pore, carried):
    """At least uniaxial stress in the walls that reach through: C_kk ≥ E times their fraction."""
    bounds = with_pores(is_pore)
    n = is_pore.ndim
    assert (np.diag(bounds.lower)[:n] >= np.array(carried) * E * (1 - 1e-6)).all()
    assert (np.diag(bounds.lower)[:n] > 0).any()
    assert bounds.has_lower == all(carried)


def test_a_band_along_a_diagonal_carries_along_it_alone():
    band = np.indices((8, 8)).sum(0) % 8 >= 2
    bounds = with_pores(~band)
    along = np.array([0.5, 0.5, -0.5])  # σ along (1, −1), in Voigt's order
    carried = np.linalg.eigvalsh(bounds.lower)
    assert carried[2] > 0.1 * E
    assert abs(carried[:2]).max() < 1e-6 * E
    vector = np.linalg.eigh(bounds.lower)[1][:, 2]
    assert abs(vector @ along) / np.linalg.norm(along) == pytest.approx(1, rel=1e-6)


def test_a_pore_that_is_connected_through_the_sides_alone_is_closed():
    """A ring about the corner of the cell is one pore, wherever the cell begins."""
    is_pore = np.zeros((12, 12), bool)
    is_pore[3:9, 3:9] = True
    is_pore[5:7, 5:7] = False
    whole, parted = with_pores(is_pore), with_pores(np.roll(is_pore, (6, 6), (0, 1)))
    assert parted.lower == pytest.approx(whole.lower, rel=1e-4, abs=1e-6 * E)
    assert whole.has_lower


def test_cuts_of_pores_of_a_fuzzy_extent_are_nested():
    """Of a threshold that leaves the rim of a pore open, and a fuzzy modulus."""
    extent = np.maximum.reduce(abs(np.indices((16, 16)) - 7.5))
    grey = np.select([extent < 3, extent < 4], [0.0, 100.0], 200.0)
    phases = [
        {"modulus": modulus, "poisson": NU} for modulus in (0.0, Triangular(0.9 * E, E, 1.1 * E))
    ]
    found = fuzzy_image_stiffness(
        GreyImage(grey, (1e-3, 1e-3)),
        phases,
        thresholds=[Triangular(50, 50, 150)],
        alpha=(0.0, 1.0),
        progress=False,
    )
    wide, narrow = (cut.modulus for cut in found.cuts)
    assert 0 < wide[0] < narrow[0] < narrow[1] < wide[1]


def test_an_image_that_may_be_void_throughout_is_refused():
    image = GreyImage(np.kron([[0, 1], [1, 0]], np.ones((4, 4))), (1e-3, 1e-3))
    phase = {"modulus": Triangular(0.0, 1e9, 2e9), "poisson": 0.3}
    with refuses("modulus of the phases"):
        fuzzy_image_stiffness(image, [phase, phase], labels=(0, 1), progress=False)
    found = fuzzy_image_stiffness(
        image, [phase, phase], labels=(0, 1), alpha=(0.5, 1.0), progress=False
    )
    assert found.young[0] == pytest.approx([0.5e9, 1.5e9], rel=1e-3)


def test_an_image_of_pores_and_what_may_be_rigid_is_refused():
    image = GreyImage(np.kron([[0, 1], [1, 0]], np.ones((4, 4))), (1e-3, 1e-3))
    pore = {"modulus": Triangular(0.0, 1e9, 2e9), "poisson": 0.3}
    rigid = {"modulus": Interval(1e9, 1e18), "poisson": 0.3}
    with refuses("modulus of the phases"):
        fuzzy_image_stiffness(image, [pore, rigid], labels=(0, 1), progress=False)


@pytest.mark.parametrize("alpha", [(), (1.0, 0.0), (0.0, 2.0)])
def test_levels_of_an_image_that_do_not_rise_are_refused(alpha):
    image = GreyImage(np.kron([[0, 1], [1, 0]], np.ones((4, 4))), (1e-3, 1e-3))
    phases = [{"modulus": modulus, "poisson": 0.3} for modulus in (1e9, 2e9)]
    with refuses("alpha"):
        fuzzy_image_stiffness(image, phases, labels=(0, 1), alpha=alpha, progress=False)


@pytest.mark.parametrize(
    ("lengths", "modulus", "key"),
    [
        ((1e-3, 0.0), 1e9, "lengths"),
        ((1e-3, 1e-3), "1 GPa", "modulus of a phase"),
        ((1e-3, 1e-3), None, "modulus of a phase"),
    ],
)
def test_lengths_and_moduli_that_are_no_numbers_are_refused(lengths, modulus, key):
    image = GreyImage(np.kron([[0, 1], [1, 0]], np.ones((4, 4))), lengths)
    phases = [{"modulus": x, "poisson": 0.3} for x in (modulus, 2e9)]
    with refuses(key):
        fuzzy_image_stiffness(image, phases, labels=(0, 1), progress=False)


def test_a_loss_factor_of_a_phase_that_may_be_negative_is_refused():
    image = GreyImage(np.kron([[0, 1], [1, 0]], np.ones((4, 4))), (1e-3, 1e-3))
    phase = {"modulus": 1e9, "poisson": 0.3, "loss": Triangular(-0.01, 0.0, 0.05)}
    with refuses("loss of a phase"):
        fuzzy_image_stiffness(image, [phase, phase], labels=(0, 1), progress=False)


@pytest.mark.parametrize(
    ("modulus", "loss", "key"),
    [
        (0.0, 0.01, "loss"),
        (1e18, 0.01, "loss"),
        (2e9, None, "loss"),
    ],
)
def test_loss_factors_without_both_bounds_of_the_stiffness_are_refused(modulus, loss, key):
    image = GreyImage(np.kron([[0, 1], [0, 1]], np.ones((4, 4))), (1e-3, 1e-3))
    phases = [{"modulus": x, "poisson": 0.3} for x in (1e9, modulus)]
    phases[0]["loss"] = 0.02
    if loss is not None:
        phases[1]["loss"] = loss
    with refuses(key):
        fuzzy_image_stiffness(image, phases, labels=(0, 1), progress=False)


def test_measured_moduli_and_losses_are_taken_on_levels_that_values_decide():
    image = GreyImage(np.kron([[0, 1], [1, 0]], np.ones((4, 4))), (1e-3, 1e-3))
    loss = from_data([0.01, 0.015, 0.02, 0.03], "median")
    modulus = from_data([0.9e9, 0.95e9, 1.05e9, 1.1e9], "median")
    phase = {"modulus": modulus, "poisson": 0.3, "loss": loss}
    found = fuzzy_image_stiffness(
        image, [phase, phase], labels=(0, 1), alpha=(0.5, 1.0), progress=False
    )
    assert found.proved_losses["E"][0] == pytest.approx(loss.cut(0.5), rel=1e-6)
