"""What a start excites of a structure: the same motion, and a proof that double modes forbid."""

from __future__ import annotations

import numpy as np

from alphacut.frame import Accelerogram, Exact, LinearFlow, MatrixStructure, envelope
from alphacut.frame.boxes import boxes
from alphacut.frame.certificate.model_error import proved_error
from alphacut.frame.modal.analyses import needed_modes
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.structures.excited import _reached, excited
from alphacut.fuzzy import Interval

CHAIN = np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
RECORD = Accelerogram(0.02, np.random.default_rng(3).normal(size=100) * np.hanning(100))


def twins(turn: float = 0.4) -> MatrixStructure:
    """Two alike chains, coupled and pushed alike, in coordinates that are turned."""
    rng = np.random.default_rng(7)
    Q = np.linalg.qr(np.eye(6) + turn * rng.normal(size=(6, 6)))[0]
    stories = (np.diag([1.0, 0.0, 0.0]), CHAIN - np.diag([1.0, 0.0, 0.0]))
    K = [Q @ np.kron(np.eye(2), 400.0 * part) @ Q.T for part in stories]
    K.append(Q @ np.kron([[30.0, -30.0], [-30.0, 30.0]], np.eye(3)) @ Q.T)  # beside each other
    K = [(x + x.T) / 2 for x in K]
    row = Q @ np.kron([0.5, 0.5], [0.0, 0.0, 1.0])
    return MatrixStructure(
        parameters={"first": 1.0, "others": 1.0},
        mass=[(1.0, np.eye(6))],
        stiffness=[("first", K[0]), ("others", K[1]), (1.0, K[2])],
        damping=[(0.4, np.eye(6))],
        observed={"top": row, "speed": np.concatenate([np.zeros(6), row])},
        ground=RECORD,
        pattern=Q @ np.ones(6),
    )


def test_half_of_twins_that_are_pushed_alike_moves_as_the_whole() -> None:
    whole, part = twins(), excited(twins())
    assert (whole.size, part.size) == (6, 3)
    points = np.array([[0.9, 1.1], [1.1, 0.9], [1.0, 1.0]])
    one, other = (
        LinearFlow(x, ("first", "others"), 3.0, 0.05, Exact()).values(points) for x in (whole, part)
    )
    assert np.abs(one - other).max() < 1e-11 * np.abs(one).max()


def test_what_a_start_beside_the_ground_moves_is_kept() -> None:
    given = twins(0.0)
    start = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])  # of one of the twins alone
    moved = MatrixStructure(
        parameters=given.parameters,
        mass=given.mass,
        stiffness=given.stiffness,
        observed=given.observed,
        q0=start,
    )
    assert excited(moved).size == 6
    flows = [LinearFlow(x, (), 2.0, 0.1, Exact()) for x in (moved, excited(moved))]
    one, other = (flow.values(np.zeros((1, 0))) for flow in flows)
    assert np.abs(one - other).max() < 1e-11 * np.abs(one).max()


def test_what_is_coupled_over_others_to_what_moves_is_kept() -> None:
    coupled = np.array([[1, 1, 0, 0], [1, 1, 1, 0], [0, 1, 1, 0], [0, 0, 0, 1]], bool)
    first, last = np.array([True, False, False, False]), np.array([False, False, False, True])
    assert _reached(coupled, first).tolist() == [True, True, True, False]
    assert _reached(coupled, last).tolist() == [False, False, False, True]


def test_bounds_of_the_part_that_moves_are_guaranteed_and_hold_motions_of_the_whole() -> None:
    inputs = {"first": Interval(0.95, 1.05), "others": Interval(0.95, 1.05)}
    motion = {"duration": 2.0, "step": 0.1, "alpha": (0.0,), "relative": True, "tolerance": 1e-3}
    found = envelope(excited(twins()), inputs, **motion)  # type: ignore[arg-type]
    assert found.nature == "guaranteed"
    rng = np.random.default_rng(int(np.random.SeedSequence().entropy) % 2**32)
    points = 0.95 + 0.1 * rng.random((500, 2)).round(0 if rng.random() < 0.2 else 3)
    values = LinearFlow(twins(), ("first", "others"), 2.0, 0.1, Exact()).values(points)
    assert (values <= found.upper[0] + 1e-9).all()
    assert (values >= found.lower[0] - 1e-9).all()


def test_a_proof_keeps_fast_modes_that_hold_energy_though_they_move_no_output() -> None:
    fast = MatrixStructure(
        parameters={"k": 1.0},
        mass=[(1.0, np.eye(2))],
        stiffness=[("k", np.diag([100.0, 1e5]))],
        damping=[(0.5, np.eye(2))],
        observed={"slow": np.array([1.0, 1e-7])},
        ground=RECORD,
    )
    cuts = boxes({"k": Interval(0.98, 1.02)}, (0,))
    flow = LinearFlow(fast, cuts.names, 2.0, 0.1, Exact())
    allowed = np.full(1, 1e-6)
    assert needed_modes(flow, cuts, allowed).tolist() == [0]
    assert needed_modes(flow, cuts, allowed, energy=True).tolist() == [0, 1]
    bounds = [
        float(proved_error(fit_modes(flow, cuts, tolerance=4e-6, energy=energy)).max())
        for energy in (False, True)
    ]
    assert bounds[1] < 1e-4 < bounds[0]
