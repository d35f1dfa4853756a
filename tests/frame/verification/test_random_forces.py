"""Accelerations of random frames under forces that vanish at all nodes, at random times."""

import numpy as np
import pytest

from alphacut.frame import (
    DualProof,
    Force,
    GraphFollower,
    History,
    Proof,
    StoreyFrame,
    envelope,
)
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.fuzzy import Interval
from tests.frame.motions import judged_motions, random_points

MOTIONS = 12
RANDOM, EQUAL = 20, 47
"""Times within each step: random ones, and equally spaced ones that show what motions stray."""


def vanishing_history(rng, step, steps):
    """A zigzag, a table, a sine or a pulse that is zero at all multiples of the step."""
    kind = rng.choice(["zigzag", "table", "sine", "pulse"])
    if kind == "sine":
        half_waves = int(rng.integers(1, 9))
        return History.harmonic(half_waves / (2 * step))
    if kind == "pulse":
        first, last = np.sort(rng.uniform(0.05, 0.95, 2))
        start = (int(rng.integers(steps)) + first) * step
        return History((last - first) * step / 2, rng.uniform(0.5, 1.0, 3), start)
    parts = 2 * int(rng.choice([1, 2, 4, 5, 8]))
    samples = rng.normal(size=parts * steps + 1)
    samples[:: 2 if kind == "zigzag" else parts] = 0.0
    return History(step / parts, samples)


def random_frame(rng, *, has_dashpots):
    """A frame of one to four floors that observes all accelerations; its step and their number."""
    n, steps = int(rng.integers(1, 5)), int(rng.integers(6, 12))
    masses = 10 ** rng.uniform(0, 0.6, n)
    stiffness = masses * 10 ** rng.uniform(0.5, 2.5)
    dampers = rng.uniform(0.02, 0.1, n) * np.sqrt(masses * stiffness)
    # the highest frequency is at most twice that of a floor on one of its springs
    step = rng.uniform(0.05, 1.5) / (2 * np.sqrt((stiffness / masses).max()))
    damping = {"damping_ratio": rng.uniform(0.005, 0.05)}
    if has_dashpots:
        damping = {"dampers": dampers, "damper_placement": "storey"}
    frame = StoreyFrame(
        masses,
        stiffness=stiffness,
        **damping,
        outputs=tuple(f"a{floor + 1}" for floor in range(n)),
        loads=[
            Force(int(rng.integers(1, n + 1)), amplitude, vanishing_history(rng, step, steps))
            for amplitude in rng.uniform(0.5, 2.0, int(rng.integers(1, 4)))
        ],
    )
    return frame, step, steps


def ratios_of_a_random_frame(method, rng):
    """Require bounds that hold; return what is stated between nodes over what motions stray."""
    has_dashpots = method.name != "dual" and rng.random() < 0.5
    frame, step, steps = random_frame(rng, has_dashpots=has_dashpots)
    uncertain = [x for x, value in frame.parameters.items() if value and x[0] in "mkFz"]
    width = 10 ** rng.uniform(-3, -1.3)
    inputs = {
        name: Interval((1 - width) * frame.parameters[name], (1 + width) * frame.parameters[name])
        for name in rng.choice(uncertain, int(rng.integers(1, 4)), replace=False)
    }
    given = {"duration": steps * step, "step": step, "alpha": [0.0], "progress": False}
    try:
        bounds = envelope(frame, inputs, method, **given)
    except UnprovedError:  # of wide boxes nothing may be enclosed
        return ratios_of_a_random_frame(method, rng)
    fractions = np.tile(np.arange(1, EQUAL + 1) / (EQUAL + 1), (steps, 1))
    fractions = np.sort(np.hstack([fractions, rng.random((steps, RANDOM))]), axis=1)
    fractions = np.hstack([np.zeros((steps, 1)), fractions])
    times = np.append((np.arange(steps)[:, None] + fractions).ravel(), steps) * step
    off_chords = np.zeros((steps, frame.floors))
    is_guaranteed = bounds.nature == "guaranteed"
    assert is_guaranteed or method.name == "graph-follower"
    error = 0.0 if is_guaranteed else bounds.error[0]
    for values in judged_motions(frame, random_points(inputs, MOTIONS, rng), inputs, times):
        nodes = values[:: fractions.shape[1]]
        inner = values[:-1].reshape(steps, -1, frame.floors)
        rounding = 1e-9 * np.abs(values).max(0)
        for sign, at_nodes in ((1.0, bounds.upper[0]), (-1.0, -bounds.lower[0])):
            bound = at_nodes + error + rounding
            assert (sign * nodes <= bound).all()
            within = np.maximum(bound[1:], bound[:-1]) + bounds.between[1:]
            assert (sign * inner <= within[:, None]).all()
        chords = nodes[:-1, None] + fractions[..., None] * np.diff(nodes, axis=0)[:, None]
        off_chords = np.maximum(off_chords, np.abs(inner - chords).max(1))
    return bounds.between.max(0) / off_chords.max(0)


BY_METHOD = pytest.mark.parametrize(
    "method",
    [Proof(workers=1), DualProof(workers=1, slabs=4), GraphFollower()],
    ids=lambda method: method.name,
)


@BY_METHOD
def test_bounds_hold_at_all_times(method, rng):
    for _ in range(2):
        ratios_of_a_random_frame(method, rng)


@pytest.mark.slow
@BY_METHOD
def test_bounds_are_close_between_nodes(method):
    rng = np.random.default_rng(20)  # how close they are differs from frame to frame
    ratios = np.concatenate([ratios_of_a_random_frame(method, rng) for _ in range(20)])
    assert np.median(ratios) <= 3.5
