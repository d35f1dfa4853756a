"""Accelerations relative to the ground: the absolute ones less a record that is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from alphacut.frame import Accelerogram, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.checks.between_nodes import ground_stray
from alphacut.frame.questions.peaks import peaks
from alphacut.frame.questions.probability import probabilities
from alphacut.fuzzy import Interval

INPUTS = {"k1": Interval(0.9e6, 1.1e6), "m2": Interval(7e3, 9e3)}


def frame(end: float = 0.0) -> StoreyFrame:
    rng = np.random.default_rng(3)
    ground = Accelerogram(0.03, np.append(rng.normal(size=20), end))  # samples beside nodes
    return StoreyFrame(
        (1e4, 8e3),
        stiffness=(1e6, 6e5),
        damping_ratio=0.03,
        ground=ground,
        outputs=("ar1", "a1", "v1"),
    )


def test_it_is_the_derivative_of_the_relative_velocity() -> None:
    flow = LinearFlow(frame(), ("k1",), 0.9, 1e-3, Exact())
    relative, absolute, velocity = flow.values(np.array([[1.05e6]]))[0].T
    # away from the corners of the record, where a central difference errs by h
    smooth = (np.arange(len(flow.time)) % 30 > 1) & (np.arange(len(flow.time)) % 30 < 29)
    found = np.gradient(velocity, flow.time)
    assert np.abs(found - relative)[smooth].max() < 1e-3 * np.abs(absolute).max()
    assert np.abs(relative - absolute).max() > 0.5


def test_its_bounds_are_proved_and_hold_every_motion() -> None:
    rng, structure = np.random.default_rng(), frame(end=1.0)
    found = envelope(structure, INPUTS, duration=0.9, step=0.05, alpha=(0,), tolerance=1e-2)
    assert found.nature == "guaranteed"
    assert found.outputs == structure.outputs
    flow = LinearFlow(structure, tuple(INPUTS), 0.9, 0.05, Exact())
    low, high = np.array([x.support for x in INPUTS.values()]).T
    motions = flow.values(rng.uniform(low, high, (40, 2)))
    assert (motions >= found.lower[0] - 1e-9).all()
    assert (motions <= found.upper[0] + 1e-9).all()
    of = peaks(found)
    assert of.error is not None
    fine = np.abs(replace(flow, step=0.005).values(rng.uniform(low, high, (10, 2)))).max((0, 1))
    assert (fine <= of.upper[0] + of.error[0] + 1e-9).all()


def test_what_the_record_does_between_nodes_is_known() -> None:
    ground = Accelerogram(0.1, np.array([0.0, 1.0, 0.0, 2.0]))
    found = ground_stray(ground, np.array([0.0, 0.2, 0.4]))
    np.testing.assert_allclose(found, [0.0, 1.0, 2.0])


def test_probabilities_count_it() -> None:
    time = {"duration": 0.6, "step": 0.05, "alpha": (0,), "spread": 4}
    rng = np.random.default_rng(0)
    answers = probabilities(frame(), INPUTS, {}, {"ar1": 1e-3}, rng=rng, **time)
    assert answers["ar1"].lower[0] == 1
