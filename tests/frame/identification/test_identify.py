"""Learning a frame's parameters from measured modes: coverage, enclosures, identifiability."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import (
    Identified,
    MeasuredMode,
    RefutedError,
    StoreyFrame,
    envelope,
    identify,
    measured_mode,
)
from alphacut.fuzzy import FuzzyNumber, Interval, Triangular, from_data
from tests.refused import refuses

FRAME = StoreyFrame([20e3, 15e3, 10e3], [3.0, 2.8, 2.8], 30e9, 3e-4, q0=(0.01, 0.02, 0.03))
NAMES = ("c1", "c2", "c3")
PRIOR: dict[str, FuzzyNumber] = {name: Interval(1.6, 2.4) for name in NAMES}


@pytest.fixture
def fixed() -> np.random.Generator:
    return np.random.default_rng(20)


def modes_at(names, points):
    """Eigenvalues (S, n) and shapes (S, floor, mode) of FRAME with other parameters (S, d)."""
    given = FRAME.parameters | dict(zip(names, points.T, strict=True))
    p = {name: np.broadcast_to(x, len(points)) for name, x in given.items()}
    storeys, below = range(1, 4), np.eye(3) - np.eye(3, k=-1)
    springs = [12 * p[f"c{z}"] * p["E"] * p["I"] / p[f"l{z}"] ** 3 for z in storeys]
    root = np.stack([p[f"m{z}"] for z in storeys], -1)[:, :, None] ** -0.5
    stiffness = below.T * np.stack(springs, -1)[:, None] @ below
    squared, vectors = np.linalg.eigh(root * stiffness * root.swapaxes(1, 2))
    return squared, root * vectors


def measured(truth, fixed, *, names=NAMES, modes=(1, 2), floors=(1, 2, 3), records=20, noise=0.01):
    values, vectors = modes_at(names, truth[None])
    found = []
    for mode in modes:
        shape = vectors[0, :, mode - 1]
        largest = int(np.abs(shape).argmax())
        frequency = np.sqrt(values[0, mode - 1]) / (2 * np.pi)
        rows = {
            z: shape[z - 1] / shape[largest]
            + noise * (z - 1 != largest) * fixed.standard_normal(records)
            for z in floors
        }
        frequencies = frequency * (1 + noise * fixed.standard_normal(records))
        found.append(measured_mode(mode, frequencies, rows))
    return found


def agree(found: Identified, points: np.ndarray, level: float) -> np.ndarray:
    """Whether points (S, d) and their modes lie in all cuts at a joint level, shape (S,)."""
    of = found.evidence
    values, vectors = modes_at(tuple(of.prior), points)
    columns = list(zip(points.T, [of.cut(x, level) for x in of.prior.values()], strict=True))
    for mode, cut in zip(of.measured, of.modes(level), strict=True):
        shape = vectors[:, :, mode.mode - 1]
        columns.append((values[:, mode.mode - 1], (cut.low, cut.high)))
        columns += [
            (shape[:, floor - 1] / shape[:, mode.reference - 1], cut.shape[floor])
            for floor in mode.shape
        ]
    return np.all([(low <= x) & (x <= high) for x, (low, high) in columns], axis=0)


def test_parameters_of_every_kind_move_the_predicted_frequencies(fixed):
    """Each prior is hardly wider than a point that is not the frame's nominal one."""
    names, point = ("E", "l2", "m1", "c3", "I"), np.array([31e9, 2.7, 21e3, 2.2, 3.1e-4])
    prior = {name: Interval(x, x * (1 + 1e-9)) for name, x in zip(names, point, strict=True)}
    predicted = identify(FRAME, prior, measured(point, fixed, names=names)).predictions()
    hertz = np.sqrt(modes_at(names, point[None])[0][0]) / (2 * np.pi)
    assert predicted.lower[0] == pytest.approx(hertz, rel=1e-7)
    assert predicted.upper[0] == pytest.approx(hertz, rel=1e-7)


@pytest.mark.parametrize("shown", [{}, {"floors": (1, 3)}, {"floors": ()}, {"modes": (2,)}])
def test_a_box_holds_all_that_agrees_and_is_sharp(fixed, shown: dict[str, tuple[int, ...]]):
    """Frames drawn in a box wider by a tenth: those whose modes agree lie in it and its ranges."""
    prior = {**PRIOR, "c1": Triangular(1.6, 1.9, 2.4)}
    truth = np.array([1.9, 2.1, 2.2])
    found = identify(FRAME, prior, measured(truth, fixed, **shown), alpha=(0.05, 0.5))
    predicted, width = found.predictions(), found.upper - found.lower
    for row, level in enumerate(found.alpha):
        ends = found.lower[row] - 0.1 * width[row], found.upper[row] + 0.1 * width[row]
        points = fixed.uniform(*ends, (20000, 3))
        points = points[agree(found, points, float(level))]
        assert len(points) > 20
        assert ((found.lower[row] <= points) & (points <= found.upper[row])).all()
        hertz = np.sqrt(modes_at(NAMES, points)[0]) / (2 * np.pi)
        assert ((predicted.lower[row] <= hertz) & (hertz <= predicted.upper[row])).all()
        if shown != {"floors": ()}:
            assert np.mean(np.ptp(points, axis=0) / width[row]) > 0.6


def test_cuts_are_nested_inside_the_priors_and_feed_an_envelope(fixed):
    truth = np.array([1.9, 2.1, 2.2])
    prior = {**PRIOR, "c1": Triangular(1.6, 1.9, 2.4)}
    found = identify(FRAME, prior, measured(truth, fixed), alpha=(0.05, 0.25, 0.5, 1.0))
    assert (np.diff(found.lower, axis=0) >= 0).all()
    assert (np.diff(found.upper, axis=0) <= 0).all()
    for row, level in enumerate(found.alpha):
        cuts = np.array([prior[name].cut(min(float(level), found.empty)) for name in NAMES])
        assert (cuts[:, 0] - 1e-12 <= found.lower[row]).all()
        assert (found.upper[row] <= cuts[:, 1] + 1e-12).all()
    assert max(found.narrowed.values()) < 0.5
    after, before = (
        envelope(FRAME, inputs, duration=0.5, step=0.05, alpha=(0.05,))
        for inputs in (found.inputs, prior)
    )
    assert (after.upper - after.lower).mean() < 0.5 * (before.upper - before.lower).mean()
    assert "c1, c2, c3 in their cuts at α (opinions)" in str(found.claim)


def test_a_common_factor_of_stiffnesses_and_masses_is_not_learned(fixed):
    names = (*NAMES, "m1", "m2", "m3")
    nominal = np.array([FRAME.parameters[name] for name in names])
    prior = {name: Interval(0.8 * x, 1.2 * x) for name, x in zip(names, nominal, strict=True)}
    found = identify(FRAME, prior, measured(nominal, fixed, names=names), alpha=(0.05,))
    assert min(found.narrowed.values()) > 0.7
    points = nominal * np.linspace(0.8, 1.2, 101)[:, None]
    points = points[agree(found, points, 0.05)]
    assert (np.ptp(points, axis=0) > 0.7 * (found.upper - found.lower)[0]).all()
    known = identify(FRAME, PRIOR, measured(np.full(3, 2.0), fixed), alpha=(0.05,))
    assert max(known.narrowed.values()) < 0.5


def test_a_measurement_that_no_such_frame_has_is_refuted(fixed):
    refuted = identify(FRAME, PRIOR, measured(np.full(3, 4.0), fixed), held_out=[2])
    assert refuted.is_refuted
    assert "storey frame with such parameters is refuted" in str(refuted)
    assert "refuted" in str(refuted.predictions())
    with pytest.raises(RefutedError, match="refuted"):
        _ = refuted.inputs
    modes = measured(np.full(3, 2.0), fixed)
    first = MeasuredMode(1, modes[0].frequency, {**modes[0].shape, 1: Interval(0.8, 0.9)}, 3)
    assert identify(FRAME, PRIOR, [first, modes[1]]).is_refuted


def test_claimed_priors_are_joined_with_the_measured_claims(fixed):
    weighed = from_data(10e3 * (1 + 0.01 * fixed.standard_normal(8)), "mean", law="normal")
    prior: dict[str, FuzzyNumber] = {**PRIOR, "m3": weighed}
    modes = measured(np.array([2, 2, 2, 10e3]), fixed, names=(*NAMES, "m3"))
    found = identify(FRAME, prior, modes, alpha=(0.05,))
    names = found.evidence.joint.names
    assert "m3" in names
    assert len(names) == 1 + 2 * 3
    number = found.inputs["m3"]
    assert number.cut(0.05).width <= found.evidence.cut(weighed, 0.05).width + 1e-9
    with pytest.raises(ValueError, match="which the values decide"):
        number.cut(0.01)


def modes_like(frequencies, shapes=None, **deviations):
    return lambda: measured_mode(1, frequencies, shapes, **deviations)


def identified_from(*modes, prior=PRIOR, alpha=(0.05,)):
    return lambda: identify(FRAME, prior, modes, alpha=alpha)


def held_out_of(*modes, held_out):
    return lambda: identify(FRAME, PRIOR, modes, held_out=held_out)


def learned_from(frequencies, shapes=None):
    return lambda: identify(FRAME, PRIOR, [measured_mode(1, frequencies, shapes)])


FIRST = MeasuredMode(1, Interval(1, 2))
NOISE = np.random.default_rng(9).normal(size=(2, 400))
NOISY = 2 + 0.01 * NOISE[0], dict(enumerate(1 + 0.3 * NOISE, 1))
KNOWN, NONE = {"frequency_deviation": 0.01, "shape_deviation": 0.02}, {"shape_deviation": 0.0}


LEVELS = "identify.alpha"


@pytest.mark.parametrize(
    ("make", "key"),
    [
        (
            learned_from([2.0]),
            "mode 1",
        ),
        (
            learned_from([2.0, 2.1], {1: [0.6, 0.3], 3: [2, 1]}),
            "mode 1",
        ),
        (
            modes_like([2, 2.1], frequency_deviation=0.001),
            "mode 1: frequencies: frequency_deviation times the mean",
        ),
        (
            modes_like([2.0], {1: [0.5], 2: [1]}, **KNOWN | NONE),
            "mode 1: amplitudes q1/q2 of floor 1: shape_deviation",
        ),
        (
            modes_like(*NOISY, shape_deviation=0.3),
            "mode 1: amplitudes q1/q2 of floor 1: scatter of floor 2",
        ),
        (modes_like([2.0, 2.1], {1: [1.0]}), "mode 1: amplitudes"),
        (modes_like([]), "mode 1: frequencies"),
        (modes_like(["2 Hz"]), "mode 1: frequencies"),
        (modes_like([2.0], {1: [None]}), "mode 1: amplitudes of floor 1"),
        (lambda: MeasuredMode(1, Interval(-2, -1)), "mode 1: frequency"),
        (lambda: replace(FIRST, shape={1: FIRST}, reference=1), "mode 1: reference"),
        (lambda: identify("frame", PRIOR, [FIRST]), "frame"),
        (identified_from(), "identify.modes"),
        (held_out_of(FIRST, held_out=[1]), "identify.held_out"),
        (held_out_of(FIRST, held_out=[2]), "identify.held_out"),
        (identified_from(replace(FIRST, mode=4)), "identify.modes"),
        (identified_from(FIRST, prior={"c1": Interval(-1, 2)}), "identify.parameters"),
        (identified_from(FIRST, prior={}), "inputs"),
        (identified_from(FIRST, prior={"c1": "2"}), "input c1"),
        (
            identified_from(FIRST, prior={"d1": Interval(1, 2)}),
            "identify.parameters",
        ),
        (
            identified_from(FIRST, prior={"c4": Interval(1, 2)}),
            "identify.parameters",
        ),
        (identified_from(FIRST, alpha=(0.0, 0.5)), LEVELS),
        (identified_from(FIRST, alpha=(0.5, 1.2)), LEVELS),
        (identified_from(FIRST, alpha=()), LEVELS),
    ],
)
def test_what_makes_no_sense_is_refused(make, key):
    with refuses(key):
        make()


@pytest.mark.parametrize(("count", "share"), [(1, 0.9), (3, -0.6)])
def test_shapes_of_known_deviation_hold_the_truth_as_often_as_claimed(count: int, share: float):
    fixed, held = np.random.default_rng(count), 0
    for _ in range(60):  # all floors scatter alike, and no scatter of chance is refused
        rows = np.array([[share], [1.0]]) + 0.02 * fixed.standard_normal((2, count))
        mode = measured_mode(
            1, 2 + 0.01 * fixed.standard_normal(count), {1: rows[0], 2: rows[1]}, shape_deviation=0.02,
            frequency_deviation=0.01,
        )  # fmt: skip
        low, high = mode.shape[1].cut(0.1)
        held += low <= share <= high
    assert 0.84 <= held / 60 <= 0.96


def test_a_reference_is_near_the_largest_and_its_size_counts():
    """Of known deviations one value is enough."""
    assert measured_mode(1, [2.0], {1: [1.0], 2: [0.5]}, **KNOWN).reference == 1
    assert measured_mode(1, [2.0], {1: [0.9], 2: [-1], 3: [1], 4: [0.93]}, **KNOWN).reference == 4
    mode = measured_mode(1, [2.0], {1: [-1.0], 2: [0.85]}, **KNOWN)
    assert mode.reference == 2
    ratio = 1 / 0.85  # 2 % of the largest amplitude, over the reference's
    scatter = 0.02 * ratio * np.hypot(1, ratio)  # both amplitudes scatter
    width = mode.shape[1].cut(0.05).width  # and a little for second order
    assert 1.0 < width / (2 * 1.959964 * scatter) < 1.01
    assert mode.frequency.cut(0.05) == pytest.approx((1.960801, 2.039199), abs=1e-6)
    of_four = measured_mode(1, [2.0] * 4, frequency_deviation=0.01).frequency
    assert of_four.cut(0.05) == pytest.approx((1.9804, 2.0196), abs=1e-6)


def test_at_level_1_a_prior_that_agrees_is_a_point():
    frame = StoreyFrame([1000.0, 1000.0], stiffness=[103510.0, 103510.0])
    values = np.linalg.eigvalsh(103.51 * np.array([[2, -1], [-1, 1]]))
    modes = [
        measured_mode(k + 1, np.sqrt(x) / (2 * np.pi) * np.array([0.998, 1.0, 1.002]))
        for k, x in enumerate(values)
    ]
    prior = dict.fromkeys(("k1", "k2"), Triangular(95e3, 103510.0, 112e3))
    found = identify(frame, prior, modes, alpha=(0.05, 1.0))
    assert found.upper[1] == pytest.approx(found.lower[1], rel=1e-12)
    assert found.empty == 1.0


@pytest.mark.parametrize("known", [None, 0.1])
def test_ratios_of_noisy_amplitudes_are_not_biased(known, fixed):
    """A tenth of noise makes the mean ratio a hundredth too large, more than 1000 rows scatter."""
    inside = 0
    for _ in range(15):
        rows = {1: 0.6 + 0.1 * fixed.normal(size=1000), 2: 1 + 0.1 * fixed.normal(size=1000)}
        mode = measured_mode(1, 2 + 0.01 * fixed.normal(size=1000), rows, shape_deviation=known)
        low, high = mode.shape[1].cut(0.05)
        inside += low <= 0.6 <= high
    assert inside >= 13
