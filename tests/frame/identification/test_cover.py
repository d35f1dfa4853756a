"""Bounds of the motions of a learned set: members by rejection, integrated independently."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import eigh, expm

from alphacut.frame import Accelerogram, StoreyFrame, envelope, identify, measured_mode, peaks
from alphacut.frame.identification.cover import contains, cover, learned_envelope
from alphacut.frame.identification.modes import chain_modes
from alphacut.fuzzy import Interval, Nature

STEP, COUNT = 0.05, 16


@pytest.fixture(autouse=True)
def coarse(monkeypatch):
    """Boxes of sets that are wider than need be, which are found in a tenth of the time."""
    monkeypatch.setattr("alphacut.frame.identification.contraction.SMALLEST_SIDE", 0.03)


def identified(rng, alpha=(0.1, 1.0)):
    """A random frame at rest under a random record, and what its measured modes teach."""
    floors = int(rng.integers(2, 4))
    masses = rng.uniform(0.8, 1.2, floors) * 1e3
    stiffness = rng.uniform(0.8, 1.2, floors) * 4e5
    values, shapes = chain_modes(stiffness, masses)
    modes = []
    for j in range(floors - 1):
        shape = None
        if rng.random() < 0.4:
            shape = {z + 1: [float(shapes[z, j])] for z in range(floors)}
        frequency = [np.sqrt(values[j]) / (2 * np.pi) * (1 + 1e-3 * rng.normal())]
        deviations = {"frequency_deviation": 0.004, "shape_deviation": 0.03}
        modes.append(measured_mode(j + 1, frequency, shape, **deviations))
    frame = StoreyFrame(masses.tolist(), stiffness=stiffness.tolist(), damping_ratio=0.05)
    inputs = {f"k{z + 1}": Interval(0.75 * k, 1.3 * k) for z, k in enumerate(stiffness)}
    learned = identify(frame, inputs, modes, alpha=alpha)
    ground = Accelerogram(STEP, np.append(rng.normal(size=11), 0.0))  # no jump at its end
    return replace(frame, ground=ground, outputs=("drift1", f"q{floors}")), learned


def rejected(learned, alpha, boxes, count, rng):
    """Members of the set of a level, by the modes of their matrices: none of the program's own."""
    evidence, kept, drawn = learned.evidence, [], 0
    masses = np.asarray(evidence.chain.mass)
    cuts = evidence.modes(alpha)
    while len(kept) < count and drawn < 60_000:
        low, high = boxes[rng.integers(len(boxes))]
        point = rng.uniform(low, high)
        drawn += 1
        chain = np.diag(point + np.append(point[1:], 0.0))
        chain -= np.diag(point[1:], 1) + np.diag(point[1:], -1)
        values, vectors = eigh(chain, np.diag(masses))
        for mode, cut in zip(evidence.measured, cuts, strict=True):
            vector = vectors[:, cut.mode - 1]
            ratios = vector / vector[mode.reference - 1]
            if not cut.low <= values[cut.mode - 1] <= cut.high or any(
                not low - 1e-12 <= ratios[z - 1] <= high + 1e-12
                for z, (low, high) in cut.shape.items()
            ):
                break
        else:
            kept.append(point)
    return np.array(kept)


def integrated(frame, point):
    """Motion of a frame by the matrix exponential of its state under a piecewise linear record."""
    masses, n = np.asarray(frame.masses), len(point)
    stiff = np.diag(point + np.append(point[1:], 0.0))
    stiff -= np.diag(point[1:], 1) + np.diag(point[1:], -1)
    root = np.sqrt(masses)
    values, modes = np.linalg.eigh(stiff / np.outer(root, root))
    damp = root[:, None] * (modes * 2 * 0.05 * np.sqrt(values)) @ modes.T * root
    state = np.zeros((2 * n + 2, 2 * n + 2))  # u, v, the acceleration of the ground, its slope
    state[:n, n : 2 * n] = np.eye(n)
    state[n : 2 * n, :n] = -stiff / masses[:, None]
    state[n : 2 * n, n : 2 * n] = -damp / masses[:, None]
    state[n : 2 * n, 2 * n] = -1.0
    state[2 * n, 2 * n + 1] = 1.0
    step = expm(state * STEP)
    ground = np.pad(frame.ground.samples, (0, COUNT + 1 - 12))
    x, motion = np.zeros(2 * n + 2), []
    for k in range(COUNT + 1):
        motion.append((x[0], x[n - 1]))
        if k < COUNT:
            x[2 * n] = ground[k]
            x[2 * n + 1] = (ground[k + 1] - ground[k]) / STEP
            x = step @ x
    return np.array(motion)


def checked(rng, members, boxes):
    """The width of the bounds of a random learned set over those of its box, after all checks."""
    frame, learned = identified(rng)
    times = {"duration": COUNT * STEP, "step": STEP}
    found = learned_envelope(frame, learned, **times, boxes=boxes, count=20)
    level = 0
    points = rejected(learned, 0.1, cover(learned, level, 1), members, rng)
    assert len(points) > members / 4
    of_cover = cover(learned, level, boxes)[:, :, np.newaxis]
    assert ((points >= of_cover[:, 0]) & (points <= of_cover[:, 1])).all(axis=2).any(axis=0).all()
    motions = np.array([integrated(frame, point) for point in points])
    rounding = 1e-9 * np.abs(motions).max()
    assert (motions >= found.lower[0] - rounding).all()
    assert (motions <= found.upper[0] + rounding).all()
    for end, at in ((found.inner.lower, found.lower_at), (found.inner.upper, found.upper_at)):
        of_output = at[0, 1:].reshape(-1, at.shape[-1])
        assert contains(learned.evidence, of_output, 0.1).all()
        k = int(rng.integers(1, COUNT))
        assert integrated(frame, at[0, k, 1])[k, 1] == pytest.approx(end[0, k, 1], rel=1e-6)
    peak = peaks(found)["drift1"]
    assert not peak.encloses
    assert 0 < peak.reached[0] <= peak.upper[0]
    whole = envelope(frame, learned.inputs, alpha=[0.1, 1.0], **times)
    assert (found.upper <= whole.upper).all()
    assert (found.lower >= whole.lower).all()
    return float(np.median((found.upper - found.lower)[0, 1:] / (whole.upper - whole.lower)[0, 1:]))


def test_members_of_the_learned_set_stay_in_its_bounds(rng):
    assert checked(rng, 100, 3) < 0.95


@pytest.mark.parametrize("lacks", ["proof", "between"])
def test_a_part_without_a_proof_has_the_bounds_of_the_whole_box(rng, monkeypatch, lacks):
    """One part of the cover is no proof, or says nothing of what lies between its nodes."""
    frame, learned = identified(rng, alpha=(0.1,))
    found = {}

    def weakened(model, inputs, *arguments, **options):
        of_inputs = envelope(model, inputs, *arguments, **options)
        found.setdefault("whole", of_inputs)
        found["count"] = found.get("count", 0) + 1
        if found["count"] != 2:
            return of_inputs
        if lacks == "between":
            return replace(of_inputs, between=None)
        nothing = np.zeros_like(of_inputs.lower)
        ends = {"lower": nothing, "upper": nothing, "inner": None, "between": 0 * of_inputs.between}
        return replace(of_inputs, **ends, nature=Nature.ESTIMATED, natures=())

    monkeypatch.setattr("alphacut.frame.identification.cover.envelope", weakened)
    bounds = learned_envelope(frame, learned, duration=0.5, step=STEP, boxes=2, count=5)
    np.testing.assert_array_equal(bounds.between, found["whole"].between)
    if lacks == "proof":
        np.testing.assert_array_equal(bounds.upper[0], found["whole"].upper[0])
        np.testing.assert_array_equal(bounds.lower[0], found["whole"].lower[0])


@pytest.mark.slow
def test_members_of_ten_random_learned_sets_stay_in_their_bounds(rng):
    widths = [checked(rng, 2000, 12) for _ in range(10)]
    assert np.median(widths) < 0.7
