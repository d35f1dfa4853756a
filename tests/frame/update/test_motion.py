"""Learning from a recorded motion: exact coverage of the possibility, and the sets found."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.update.motion import (
    RecordedMotion,
    _Box,
    _constrained,
    _require_alike,
    _require_independent,
    learn_from_motion,
)
from alphacut.frame.update.posterior import RefutedError
from alphacut.fuzzy import FuzzyNumber, Interval

FRAME = StoreyFrame(
    [20e3, 15e3],
    [3.0, 3.0],
    30e9,
    1e-4,
    q0=(0.01, 0.02),
    rayleigh=(0.2, 1e-3),
    outputs=("q1", "q2"),
)
NAMES = ("c1", "c2", "rayleigh_mass")
PRIOR: dict[str, FuzzyNumber] = {
    "c1": Interval(1.6, 2.4),
    "c2": Interval(1.6, 2.4),
    "rayleigh_mass": Interval(0.1, 0.3),
}
FLOW = LinearFlow(FRAME, NAMES, 2.0, 0.05, Exact())


def recorded(truth: np.ndarray, rng: np.random.Generator, noise: float = 1e-3) -> RecordedMotion:
    motion = FLOW.values(truth[None])[0]
    return RecordedMotion(FLOW, motion + noise * rng.standard_normal(motion.shape))


def test_the_possibility_of_the_truth_is_uniform_however_large_the_noise() -> None:
    rng = np.random.default_rng(11)
    for noise in (1e-4, 2e-2):  # of an amplitude of 2e-2
        degrees = []
        for _ in range(200):
            truth = rng.uniform((1.6, 1.6, 0.1), (2.4, 2.4, 0.3))
            degrees.append(float(recorded(truth, rng, noise).possibility(truth[None])[0]))
        for level in (0.1, 0.3, 0.5, 0.7, 0.9):
            error = np.sqrt(level * (1 - level) / 200)
            assert abs(np.mean(np.array(degrees) < level) - level) < 4 * error


def test_the_sets_found_hold_the_truth_and_are_nested() -> None:
    rng = np.random.default_rng(12)
    inside = []
    for _ in range(6):
        truth = rng.uniform((1.7, 1.7, 0.15), (2.3, 2.3, 0.25))
        found = learn_from_motion(recorded(truth, rng), PRIOR, alpha=(0.1, 0.5))
        inside.append(bool(((found.lower[0] <= truth) & (truth <= found.upper[0])).all()))
        assert (found.lower[1] >= found.lower[0]).all()
        assert (found.upper[1] <= found.upper[0]).all()
        assert (found.upper[0] - found.lower[0])[:2].max() < 0.5
    assert np.mean(inside) >= 0.9 - 4 * np.sqrt(0.09 / 6)


def test_points_of_the_set_lie_in_its_hull() -> None:
    rng = np.random.default_rng(13)
    record = recorded(np.array([1.9, 2.1, 0.2]), rng)
    found = learn_from_motion(record, PRIOR, alpha=(0.05,))
    low, high = found.lower[0], found.upper[0]
    points = rng.uniform(low - 0.3 * (high - low), high + 0.3 * (high - low), (3000, 3))
    held = points[record.possibility(points) >= 0.05]
    assert len(held) > 100
    slack = 0.05 * (high - low)
    assert (held >= low - slack).all()
    assert (held <= high + slack).all()


def test_sets_go_on_along_the_priors_faces_that_the_best_fit_lies_on() -> None:
    """The truth in a corner: of the sets that hold it by its possibility, all are found to."""
    rng, right, asked = np.random.default_rng(), 0, 0
    for _ in range(5):
        ends = np.array([prior.support for prior in PRIOR.values()])
        truth = np.where(rng.random(3) < 0.5, *ends.T)
        record = recorded(truth, rng, 10 ** rng.uniform(-4, -2))
        try:
            found = learn_from_motion(record, PRIOR, alpha=(0.05, 0.5))
        except RefutedError:
            assert record.possibility(truth[None])[0] < 0.2
            continue
        held = record.possibility(truth[None])[0] >= found.alpha
        inside = (found.lower <= truth).all(1) & (truth <= found.upper).all(1)  # faces exactly
        asked, right = asked + held.sum(), right + (held & inside).sum()
    assert asked
    assert right >= asked - 1


def test_a_path_to_the_end_of_a_parameter_holds_the_others_at_their_best() -> None:
    """No point of the box with that entry is nearer by a linear motion."""
    rng = np.random.default_rng()
    for d in (1, 2, 5):
        root, aim, fixed = rng.normal(size=(d, d)), 3 * rng.normal(size=d), int(rng.integers(d))
        value = rng.uniform(-1, 1)
        point = rng.uniform(-1, 1, d)
        found = point + _constrained(root, aim - root @ point, point, fixed, value)
        others = rng.uniform(-1, 1, (5000, d))
        others[:, fixed] = value
        assert found[fixed] == pytest.approx(value, abs=1e-12)
        assert np.abs(found).max() <= 1 + 1e-12
        least = np.linalg.norm(others @ root.T - aim, axis=1).min()
        assert np.linalg.norm(root @ found - aim) <= least + 1e-9


def test_sets_follow_curved_valleys_of_parameters_that_only_their_product_tells() -> None:
    """E and I of one frame: E may be anything from 0.83 of the truth, whatever the fit."""
    rng, frame = np.random.default_rng(), FRAME
    truth = np.array([30e9, 1e-4])
    flow = LinearFlow(frame, ("E", "I"), 2.0, 0.05, Exact())
    motion = flow.values(truth[None])[0]
    record = RecordedMotion(flow, motion + 1e-4 * rng.standard_normal(motion.shape))
    prior = {"E": Interval(24e9, 36e9), "I": Interval(0.8e-4, 1.2e-4)}
    level = 0.5 * record.possibility(truth[None])[0]
    found = learn_from_motion(record, prior, alpha=(level,))
    assert found.lower[0, 0] < 0.86 * 30e9
    assert found.upper[0, 0] > 1.17 * 30e9


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-12])
def test_a_record_without_errors_is_learned_from(noise: float) -> None:
    rng = np.random.default_rng()
    truth = rng.uniform((1.6, 1.6, 0.1), (2.4, 2.4, 0.3))
    found = learn_from_motion(recorded(truth, rng, noise), PRIOR)
    assert (np.abs(found.lower[0] / truth - 1) < 1e-5).all()
    assert (found.lower[0] <= truth).all()
    assert (truth <= found.upper[0]).all()


def test_the_fit_goes_on_until_nothing_is_left_along_the_derivatives() -> None:
    """However small the errors; one at 1e-11 was 0.01 possible, and refuted."""
    rng = np.random.default_rng()
    for noise in 10.0 ** rng.uniform(-15, -8, 6):
        truth = rng.uniform((1.6, 1.6, 0.1), (2.4, 2.4, 0.3))
        box = _Box(
            recorded(truth, rng, noise), np.array([prior.support for prior in PRIOR.values()])
        )
        assert box.possibility(box.fits()[:1])[0] > 0.9


def of_the_roof(
    seed: int, widest: float, duration: float
) -> tuple[RecordedMotion, dict[str, Any], np.ndarray]:
    """Record of the roof alone with a tenth of noise, wide priors of three parameters, the truth."""
    truth, names = np.array([2.0, 2.0, 20e3]), ("c1", "c2", "m1")
    flow = LinearFlow(replace(FRAME, outputs=("q2",)), names, duration, 0.02, Exact())
    motion = flow.values(truth[None])[0]
    noise = 2e-3 * np.random.default_rng(seed).standard_normal(motion.shape)
    ends = ((0.5, widest), (0.5, widest), ((5e3 if widest < 10 else 4e3), 1e4 * widest))
    prior = {name: Interval(*pair) for name, pair in zip(names, ends, strict=True)}
    return RecordedMotion(flow, motion + noise), prior, truth


def test_fits_apart_from_the_best_that_the_record_allows_too_are_in_the_sets() -> None:
    record, prior, truth = of_the_roof(5, 60.0, 1.0)
    assert record.possibility(truth[None])[0] > 0.6
    found = learn_from_motion(record, prior, alpha=(0.3,))
    assert not np.allclose(found.best, truth, rtol=0.1)
    assert (found.lower[0] <= truth).all()
    assert (truth <= found.upper[0]).all()


def test_sets_much_narrower_than_the_priors_are_followed_to_their_ends() -> None:
    """The search had ended at 4.59: growth by a fiftieth of the prior counted as none."""
    record, prior, truth = of_the_roof(4, 60.0, 1.0)
    level = 0.5 * float(record.possibility(truth[None])[0])
    found = learn_from_motion(record, prior, alpha=(level,))
    assert found.upper[0, 1] > 5.7


def test_fits_begin_also_where_few_points_drawn_come_near_the_truth() -> None:
    """Nine starts drawn at random all ended at 1/2 and less of the truth's mass."""
    record, prior, truth = of_the_roof(2, 60.0, 1.0)
    level = 0.5 * float(record.possibility(truth[None])[0])
    found = learn_from_motion(record, prior, alpha=(level,))
    assert (found.lower[0] <= truth).all()
    assert (truth <= found.upper[0]).all()


@pytest.mark.parametrize("wrong", [lambda y: -y, lambda y: 0.4 * y, np.zeros_like])
def test_a_record_that_no_parameters_explain_refutes_the_frame(wrong: Any) -> None:
    record = recorded(np.array([1.9, 2.1, 0.2]), np.random.default_rng())
    noise = 1e-5 * np.random.default_rng().standard_normal(record.values.shape)
    with pytest.raises(RefutedError, match=r"the record refutes the frame: .* agree with it to"):
        learn_from_motion(RecordedMotion(FLOW, wrong(record.values) + noise), PRIOR)


def test_errors_that_are_not_independent_are_refused_and_others_are_not() -> None:
    rng = np.random.default_rng()
    flow: Any = SimpleNamespace(outputs=("q1", "q2"))

    def require(errors: np.ndarray) -> None:
        record: Any = SimpleNamespace(values=errors, flow=flow, misfit=lambda _: (errors, None))
        _require_independent(record, np.zeros(2))

    for _ in range(50):
        require(rng.normal(size=(rng.integers(21, 400), 2)) * 10.0 ** rng.uniform(-6, 0))
    white = rng.normal(size=(300, 2))
    slow = np.column_stack([white[:, 0], np.convolve(white[:, 1], np.ones(8), "same")])
    for errors in (white + np.array([0.0, 0.8]), slow, np.cumsum(white, axis=0)):
        with pytest.raises(ValueError, match=r"errors of q. are not independent: .* third sample"):
            require(errors)


def test_the_numbers_feed_an_envelope_and_say_what_they_rest_on() -> None:
    rng = np.random.default_rng(14)
    found = learn_from_motion(recorded(np.array([1.9, 2.1, 0.2]), rng), PRIOR, alpha=(0.05, 1.0))
    after = envelope(FRAME, found.numbers, duration=1.0, step=0.05, alpha=(0.05,))
    before = envelope(FRAME, PRIOR, duration=1.0, step=0.05, alpha=(0.05,))
    assert (after.upper - after.lower).mean() < 0.3 * (before.upper - before.lower).mean()
    assert "independent normal errors" in str(found.claim)
    assert all(x.cut(0.0) == PRIOR[name].cut(0.0) for name, x in found.numbers.items())


def test_records_that_do_not_fit_are_refused() -> None:
    with pytest.raises(ValueError, match=r"the record has the shape"):
        RecordedMotion(FLOW, np.zeros((3, 2)))
    short = LinearFlow(FRAME, NAMES, 0.05, 0.05, Exact())
    with pytest.raises(ValueError, match=r"need more"):
        RecordedMotion(short, np.zeros((2, 2)))
    record = recorded(np.array([1.9, 2.1, 0.2]), np.random.default_rng(1))
    with pytest.raises(ValueError, match=r"the priors are of c2"):
        learn_from_motion(record, {"c2": Interval(1, 2)})
    with pytest.raises(ValueError, match=r"must rise within"):
        learn_from_motion(record, PRIOR, alpha=(0.0, 1.0))


@pytest.mark.parametrize(
    ("rows", "ratio", "told"),
    [(600, 1.5, False), (600, 3.0, True), (100, 3.0, True), (15, 50, False)],
)
def test_outputs_are_refused_whose_errors_differ_by_much_and_surely(
    rows: int, ratio: float, told: bool
) -> None:
    noise = np.random.default_rng().normal(size=(rows, 2)) * [1e-3, 1e-3 * ratio]
    flow = SimpleNamespace(outputs=("q1", "q2"))
    record: Any = SimpleNamespace(values=noise, flow=flow, misfit=lambda _: (noise[None], None))
    with pytest.raises(ValueError, match="errors are not alike") if told else nullcontext():
        _require_alike(record, np.zeros(2))
    silent: Any = SimpleNamespace(values=1e12 * noise, flow=flow, misfit=record.misfit)
    _require_alike(silent, np.zeros(2))
