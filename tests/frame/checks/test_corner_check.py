"""The estimated error of the Graph Follower in rounds against trajectories that it did not compute."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.checks.corners import signs
from alphacut.fuzzy import FuzzyNumber, Interval, Triangular
from tests.frame.nesting import nesting_violation

OUTPUTS = ("q3", "v1", "drift2", "base_shear", "shear3")
FRAME = StoreyFrame(
    (2e4, 1.5e4, 1e4),
    (3.5, 3.0, 3.0),
    25e9,
    4e-6,
    (300, 200, 100),
    "storey",
    (0.0, 0.01, 0.02),
    (0.1, 0.0, -0.1),
    OUTPUTS,
    (0.02, 0.0005),
    None,
    0.02,
)

INPUTS: dict[str, FuzzyNumber] = {
    "E": Triangular(22e9, 25e9, 27e9),
    "m3": Triangular(8e3, 1e4, 1.3e4),
    "l1": Interval(3.4, 3.6),
    "zeta": Triangular(0.01, 0.02, 0.04),
    "d1": Triangular(100, 300, 900),
}


@pytest.mark.parametrize(("duration", "step"), [(1.6, 0.05), (2.0, 0.02)])
def test_the_error_of_five_inputs_and_mixed_outputs_is_not_too_small(
    duration: float, step: float
) -> None:
    found = envelope(
        FRAME,
        INPUTS,
        duration=duration,
        step=step,
        alpha=(0, 0.5),
        method="improved-graph-follower",
        integrator="exact",
    )
    low, high = np.array([number.cut(0) for number in INPUTS.values()]).T
    share = np.vstack([list(product([0, 1], repeat=5)), np.random.default_rng(1).random((1500, 5))])
    values = LinearFlow(FRAME, tuple(INPUTS), duration, step, Exact()).values(
        low + (high - low) * share
    )
    missed = np.maximum(values.max(0) - found.upper[0], found.lower[0] - values.min(0))
    assert found.error is not None
    assert (missed <= found.error[0]).all()
    assert (values[:32].max(0) <= found.upper[0] + 1e-9 * np.abs(values).max((0, 1))).all()
    assert nesting_violation(found) < 1e-3 * np.abs(values).max()
    peak = np.abs(values).max((0, 1))
    assert (found.error.max((0, 1)) < 0.03 * peak).all()  # and not idle


def test_many_inputs_have_some_of_their_corners() -> None:
    assert signs(3, 8).shape == (8, 3)
    some = signs(10, 64)
    assert some.shape == (64, 10)
    assert (np.abs(some) == 1).all()


@pytest.mark.parametrize("seed", [31, 59])
def test_the_estimate_holds_where_rounds_end_short_of_the_bounds(seed: int) -> None:
    """Frames at which half the estimate is exceeded by trajectories that were not computed."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 4))
    masses, lengths = rng.uniform(8e3, 2e4, n), rng.uniform(2.5, 3.2, n)
    dampers, q0, v0 = rng.uniform(50, 300, n), rng.uniform(-0.1, 0.1, n), rng.uniform(-0.5, 0.5, n)
    frame = StoreyFrame(masses, lengths, 25e9, 1e-6, dampers, "ground", q0, v0)
    inputs = {
        name: Triangular(0.92 * x, x, 1.08 * x)
        for name in ("E", "m1", "l1")
        for x in [frame.parameters[name]]
    }
    options = {"method": "improved-graph-follower", "integrator": "exact", "tolerance": 1e-3}
    found = envelope(frame, inputs, duration=8, step=0.1, alpha=(0,), **options)
    low, high = np.array([number.cut(0) for number in inputs.values()]).T
    values = LinearFlow(frame, tuple(inputs), 8, 0.1, Exact()).values(
        low + (high - low) * rng.random((1500, 3))
    )
    missed = np.maximum(values.max(0) - found.upper[0], found.lower[0] - values.min(0))
    assert found.error is not None
    assert (missed <= found.error[0]).all()
    assert (missed > found.error[0] / 2).any()
