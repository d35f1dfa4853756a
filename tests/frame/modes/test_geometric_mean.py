"""The geometric mean of mass and stiffness, and the proof of frames that are damped by it."""

import numpy as np
import pytest
from scipy.linalg import sqrtm

from alphacut.frame import Proof, StoreyFrame, UnprovedError, envelope
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.damped import geometric_mean, right_side_bound
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, require_inside


def varying(rng, middle, width, order):
    """A symmetric matrix of two inputs about a diagonal one (n,), that varies by about a width."""
    scale = np.sqrt(np.outer(middle, middle))
    slopes = rng.uniform(-width, width, (2, len(middle), len(middle))) * scale
    parts = np.diag(middle)[None], (slopes + slopes.swapaxes(1, 2)) / 2
    return TaylorModel(parts, np.zeros(scale.shape), inputs=2, order=order)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_geometric_mean_is_enclosed_over_the_box(order, rng):
    """M √(M⁻¹K) by SciPy at the corners, where polynomials miss most, and inside."""
    omega = np.sort(rng.uniform(1, 30, 3))
    mass = varying(rng, np.ones(3), width=0.03, order=order)
    stiffness = varying(rng, omega**2, width=0.03, order=order)
    found = geometric_mean(mass, stiffness, omega)
    corners = np.array([[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]])
    off = np.zeros((3, 3))
    for u in np.vstack([corners, rng.uniform(-1, 1, (10, 2))]):
        M, K = mass.at(u[None])[0], stiffness.at(u[None])[0]
        exact = M @ sqrtm(np.linalg.solve(M, K)).real
        off = np.maximum(off, np.abs(found.at(u[None])[0] - exact))
    assert (off <= found.remainder + 1e-12 * omega[-1]).all()


@pytest.mark.parametrize("kind", ["values", "changes"])
def test_the_right_side_is_bounded_and_so_is_how_fast_it_changes(kind, rng):
    """Of random matrices whose magnitudes attain their bounds."""
    change = 1e-3
    unknown, constant = (0.05, 1.0) if kind == "values" else (1.0, 0.0)
    signs = rng.choice([-1.0, 1.0], (4, 20_000, 2, 2))
    defect, P, W, E = signs * rng.uniform(0.5, 1.5, (4, 1, 2, 2))
    defect, E = constant * defect, unknown * E
    E[:, 1, 0] = E[:, 0, 1]

    def right_side(E):
        return defect - E @ P.swapaxes(1, 2) - P @ E - E @ W @ E

    found = right_side(E)
    if kind == "changes":
        found = (found - right_side((1 - change) * E)) / change
    sizes = [np.abs(x[0]) for x in (defect, P, W, E)]
    bound = right_side_bound(*sizes[:2], inverse_mass=sizes[2], bound=sizes[3])
    largest = np.abs(found).max(0)
    assert (largest <= bound * (1 + 1e-9)).all()
    assert (largest >= 0.8 * bound).all()


def test_the_remainder_of_one_unknown_is_that_of_its_square_root(rng):
    """√(1 + κ u) is missed most at u = −1, where all terms of its series beyond κ u add up."""
    variation, omega = rng.uniform(0.05, 0.4), rng.uniform(1, 30)
    parts = np.full((1, 1, 1), omega**2), np.full((1, 1, 1), omega**2 * variation)
    stiffness = TaylorModel(parts, np.zeros((1, 1)), inputs=1, order=1)
    found = geometric_mean(stiffness.like(np.eye(1)), stiffness, np.array([omega]))
    missed = omega * (1 - variation / 2 - np.sqrt(1 - variation))
    assert missed <= found.remainder[0, 0] <= 1.5 * missed


def test_a_crisp_mean_is_enclosed_where_one_entry_follows_the_others(rng):
    """An entry without a defect of its own has one by products of the others' bounds alone."""
    omega = np.sort(rng.uniform(1, 30, 3))
    missed = np.full((3, 3), 1e-14)
    missed[2, 2] = 0.0
    mass, stiffness = (
        TaylorModel((np.diag(x)[None], np.zeros((1, 3, 3))), missed * x.max(), inputs=1, order=1)
        for x in (np.ones(3), omega**2)
    )
    found = geometric_mean(mass, stiffness, omega)
    assert found.remainder.max() < 1e-10 * omega[-1]


def test_a_box_of_which_no_mean_is_enclosed_is_refused(rng):
    stiffness = varying(rng, np.array([1.0, 1.1]), width=1.0, order=2)
    stiffness = stiffness + stiffness.like(np.diag([0.0, 0.0])).widened(np.full((2, 2), 0.9))
    with pytest.raises(UnprovedError, match="damping by a ratio is not enclosed"):
        geometric_mean(stiffness.like(np.eye(2)), stiffness, np.sqrt([1.0, 1.1]))


@pytest.mark.parametrize("width", [1e-2, 1e-9])
def test_dashpots_beside_a_damping_ratio_are_proved(width, rng):
    ratio, dashpot = rng.uniform(0.01, 0.05), rng.uniform(1e4, 6e4)
    k1 = 6e7
    frame = StoreyFrame(
        masses=[2e4, 1e4],
        stiffness=[k1, 4e7],
        damping_ratio=ratio,
        dampers=[dashpot, 1e3],
        v0=(0.0, 0.5),
        outputs=("q1", "a2"),
    )
    inputs = {"k1": Interval(k1 * (1 - width), k1 * (1 + width))}
    found = envelope(frame, inputs, Proof(workers=1), duration=1.0, step=0.02, alpha=(0,))
    assert found.nature == "guaranteed"
    points = k1 * np.linspace(1 - width, 1 + width, 9)[:, np.newaxis]
    motions = exact_motions(frame, points, inputs, 1.0, 0.02)
    require_inside(motions, found, slack=1e-10)
    spread = np.ptp(motions, axis=0) + 4e-3 * np.abs(motions).max((0, 1))
    assert (found.upper[0] - found.lower[0] <= spread).all()
