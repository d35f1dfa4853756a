"""A guaranteed envelope that is wrong is refused by the result, whatever made it wrong."""

from copy import copy
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, Proof, StoreyFrame, envelope
from alphacut.frame.verification.self_test import (
    ContradictionError,
    Trial,
    fractions_of_steps,
    structures_at,
    with_motions_tested,
)
from alphacut.fuzzy import Crisp, FailedError, Triangular
from tests.frame.motions import judged_motions, off_chords

INPUTS = {"k1": Triangular(3.9e6, 4e6, 4.1e6), "m2": Triangular(990.0, 1e3, 1020.0)}
METHODS = [Proof(gap=1e-5), DualProof(gap=1e-3)]


def frame():
    record = 3 * np.random.default_rng(5).normal(size=40) * np.linspace(1, 0.2, 40)
    return StoreyFrame(
        masses=(1e3, 1e3),
        stiffness=(4e6, 3e6),
        damping_ratio=0.03,
        ground=Accelerogram(0.03, record),
        outputs=("q2", "drift2"),
    )


motion = partial(envelope, duration=1.0, step=0.02, alpha=(0.0, 0.5, 1.0), progress=False)


@pytest.fixture(scope="module")
def found():
    """The right envelope of each method, with its tests passed."""
    return {method.name: motion(frame(), INPUTS, method=method) for method in METHODS}


def narrower(found):
    return replace(found, lower=0.98 * found.lower, upper=0.98 * found.upper)


def straight(found):
    return replace(found, between=np.zeros_like(found.between))


def attained_off(found, share):
    """One attained value, that of the first output's peak, differs by a share."""
    upper, node = found.inner.upper.copy(), found.upper[0, :, 0].argmax()
    upper[0, node, 0] *= 1 + share
    return replace(found, inner=found.inner._replace(upper=upper))


def no_number(found):
    values = found.between.copy()
    values[7] = np.nan
    return replace(found, between=values)


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (narrower, "the proved|lie outside the proved"),
        (straight, r"the proof is wrong: .* at t = .*, by .*k1 = .*, m2 = "),
        (partial(attained_off, share=-0.01), "the attained upper bound of α = 0"),
        (partial(attained_off, share=0.01), "outside the proved|the attained upper"),
        (no_number, "nan|inf"),
    ],
)
def test_a_fault_in_the_result_raises(monkeypatch, found, method, change, words):
    monkeypatch.setattr(type(method), "run", lambda *_: change(found[method.name]))
    with pytest.raises(FailedError, match=words):
        motion(frame(), INPUTS, method=method)


def test_a_deviation_between_nodes_a_quarter_too_small_is_refused(rng):
    """Whatever the record: three quarters of what an exact motion strays is less than it strays.

    The proved bounds are far too wide here, so that they hide nothing.
    """
    inputs = {"k1": Crisp(4e6)}
    system = replace(frame(), ground=Accelerogram(0.03, rng.normal(size=40)))
    found = motion(system, inputs, method=DualProof(), alpha=(1.0,))
    wide = np.abs(found.upper).max(1, keepdims=True) * np.ones_like(found.upper)
    fine = np.linspace(0, found.time[-1], 40 * len(found.time) - 39)
    (exact,) = judged_motions(system, np.array([[4e6]]), found.inputs, fine)
    deviation = np.append(found.between[:1], off_chords(exact, 40), axis=0)
    faulty = replace(
        found, lower=-3 * wide, upper=3 * wide, inner=None, outer=None, between=0.75 * deviation
    )
    with pytest.raises(ContradictionError, match="from the straight line"):
        with_motions_tested(faulty, system)


def between_too_small(found, exact):
    """Bounds at nodes that are the exact motion's, and 3/4 of what it exceeds both ends by."""
    fine = exact.outputs(np.linspace(0, found.time[-1], 40 * len(found.time) - 39)).values
    nodes, over = fine[::40], 0.0 * found.between
    inside = fine[:-1].reshape(len(nodes) - 1, 40, -1).max(1)
    over[1:] = np.maximum(inside - np.maximum(nodes[1:], nodes[:-1]), 0.0)
    lower = np.full_like(found.lower, -3 * np.abs(nodes).max())
    return replace(
        found, lower=lower, upper=nodes[None], inner=None, outer=None, between=0.75 * over
    )


def smaller_by_rounding(found, _):
    faulty = copy(found)
    vars(faulty)["proved"] = found.proved._replace(upper=(1 - 1e-8) * found.proved.upper)
    return faulty


@pytest.mark.parametrize(
    ("change", "check", "words"),
    [
        (between_too_small, "require_inside", "above the proved upper"),
        (smaller_by_rounding, "require_inside", "above the proved upper"),
        (lambda found, _: attained_off(found, -1e-8), "require_attained", "the attained upper"),
    ],
)
def test_a_fault_far_below_all_tolerances_is_seen_by_its_check(change, check, words, rng):
    """A hundred millionth of a value, or a part of what motions do within steps."""
    system = replace(frame(), ground=Accelerogram(0.03, rng.normal(size=40)))
    found = motion(system, {"k1": Crisp(4e6)}, method=DualProof(), alpha=(1.0,))
    point = np.array([[4e6]])
    (exact,) = structures_at(system, tuple(found.inputs), point)
    faulty, others = change(found, exact), {"require_inside", "require_attained"}
    with pytest.MonkeyPatch.context() as patch:
        for other in (others | {"require_interpolation_error"}) - {check}:
            patch.setattr(Trial, other, lambda *_: None)
        with pytest.raises(ContradictionError, match=words):
            Trial(faulty, point, point).require_agreement(point, [exact])


def test_inputs_without_width_are_tested_at_their_one_point():
    found = motion(frame(), {"k1": Crisp(4e6)}, method=DualProof())
    assert found.facts["motions_tested"] == 1


def test_times_within_steps_are_the_same_in_each_test_and_others_in_other_cases():
    time, ends = np.linspace(0, 1, 11), np.array([[1.0, 2.0]])
    first = fractions_of_steps(time, ends, ends + 1)
    assert np.array_equal(first, fractions_of_steps(time, ends, ends + 1))
    other = fractions_of_steps(time, ends, ends + 1.0000001)
    assert not np.isclose(first[:, 1:], other[:, 1:]).any()
    assert (first[:, 0] == 0).all()
    assert (np.diff(first, axis=1) > 0).all()
    assert first.max() < 1
