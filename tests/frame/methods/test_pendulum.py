"""The pendulum's envelopes against a reference that shares nothing with the methods it judges."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.frame import LagrangianFlow, pendulum
from alphacut.frame.methods.auto import ToleranceError
from benchmarks.frame import pendulum as frame_pendulum
from benchmarks.frame.references.swing import PARAMETERS, Swing

LOW, HIGH = np.array([number.cut(0) for number in frame_pendulum.inputs("wide").values()]).T


def test_the_reference_has_the_trajectories_and_derivatives_of_the_general_integrator() -> None:
    unit, node = np.random.default_rng(0).uniform(-1, 1, (4, 6)), np.array([40, 0, 7, 200])
    flow = LagrangianFlow(pendulum(), PARAMETERS, 2.0, 0.01, observe=("force",))
    swing, each, half = Swing(LOW, HIGH, 0.01, 201), np.arange(4), (HIGH - LOW) / 2
    jet, found = flow.taylor((LOW + HIGH) / 2 + half * unit), swing.jets(unit, node)
    assert np.abs(swing.values(unit) - jet.value[..., 0]).max() < 1e-10
    assert np.abs(found.value - jet.value[each, node, 0]).max() < 1e-10
    assert np.abs(found.first - half[:, None] * jet.first[:, each, node, 0]).max() < 1e-9
    assert (
        np.abs(
            found.second - np.outer(half, half)[..., None] * jet.second[:, :, each, node, 0]
        ).max()
        < 1e-8
    )


def test_the_kept_reference_is_what_the_program_makes() -> None:
    for support, truth in frame_pendulum.kept().items():
        assert truth.shape == (2001, 2)
        made = frame_pendulum.reference(support, count=121, samples=2**9, candidates=2)
        assert np.abs(made - truth[:121]).max() < 1e-6


def test_no_trajectory_leaves_the_kept_reference() -> None:
    rng = np.random.default_rng(99)
    for support, truth in frame_pendulum.kept().items():
        low, high = np.array(
            [number.cut(0) for number in frame_pendulum.inputs(support).values()]
        ).T
        force = Swing(low, high, 0.01, 2001).values(
            np.clip(rng.uniform(-1.2, 1.2, (300, 6)), -1, 1)
        )
        assert (force <= truth[:, 1] + 1e-6).all()
        assert (force >= truth[:, 0] - 1e-6).all()


@pytest.mark.slow
@pytest.mark.parametrize("support", frame_pendulum.SUPPORTS)
def test_envelopes_are_within_two_hundredths_of_a_newton_at_every_node(support: str) -> None:
    _, auto, options = frame_pendulum.METHODS[0]
    found = frame_pendulum.computed(support, auto, **options)
    attained = frame_pendulum.exact(support, samples=2**10, seed=8)
    missed, declared = frame_pendulum.missed_and_declared(found, attained)
    assert np.abs(missed).max() < 0.02
    assert (missed <= declared + 1e-9).all()
    assert found.trajectories < 10_000  # two passes from different points
    _, follower, options = frame_pendulum.METHODS[1]
    found = frame_pendulum.computed(support, follower, **options)
    assert frame_pendulum.errors(found, frame_pendulum.kept()[support]).max() < 0.02
    assert found.trajectories < 3000


def test_auto_refuses_where_the_midpoint_rule_alone_passes_the_tolerance() -> None:
    with pytest.raises(
        ToleranceError, match=r"time stepping, 0\.\d+ N, is above the tolerance 0\.02 N"
    ):
        frame_pendulum.computed("narrow", "auto", tolerance=0.02)
