"""Boxes of a frame of one yielding storey: motions stay inside, and the error is not too small."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Force, History, StoreyFrame
from alphacut.frame.bounds.interpolated_box import InterpolatedFrame
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import YieldingFlow

OUTPUTS = ("q1", "v1", "a1", "shear1", "ductility1", "residual1", "dissipated1")


def random_storey(rng, **changes):
    """A storey of a random period and ductility under a random record."""
    period = float(rng.uniform(0.3, 1.0))
    stiffness = 4e4 * (2 * np.pi / period) ** 2
    yield_force = 4e4 * float(rng.uniform(0.5, 1.5))
    samples = 4 * rng.normal(size=20).repeat(3) + rng.normal(size=60)
    frame = StoreyFrame(
        masses=[4e4],
        stiffness=[stiffness],
        lengths=[30.0],
        damping_ratio=float(rng.uniform(0.0, 0.08)),
        yield_force=[yield_force],
        hardening=[float(rng.uniform(0.02, 0.2))],
        ground=Accelerogram(0.05, samples),
        outputs=OUTPUTS,
    )
    return replace(frame, **changes)


def bounds_and_motions(frame, names, radius, rng, step=0.05):
    """Bounds over a box of inputs ± radius (1 + random) and motions in it: values and peaks."""
    flow = YieldingFlow(frame, names, 2.5, step)
    nominal = np.array([frame.parameters[name] for name in names])
    low, high = nominal * (1 - radius), nominal * (1 + radius)
    found = InterpolatedFrame(flow, np.arange(len(names))).bounds(low, high)
    points = np.vstack([low, high, rng.uniform(low, high, (60, len(names)))])
    return found, *flow.values_and_peaks(points)


@pytest.mark.parametrize(
    "names", [("k1",), ("fy1",), ("m1", "zeta"), ("k1", "fy1"), ("k1", "fy1", "hardening1")]
)
def test_motions_stay_inside_tight_bounds(names, rng):
    for radius in (1e-4, float(rng.choice([1e-3, 3e-3, 0.01, 0.02]))):
        frame = random_storey(rng, gravity=float(rng.choice([0.0, 9.81])))
        found, values, peaks = bounds_and_motions(frame, names, radius, rng)
        if not np.isfinite(found.peaks).all():  # a grazed yield drift may be too wide
            continue
        scale = np.abs(values).max(axis=(0, 1)) + 1e-12
        assert (values - found.upper[..., 1] <= 1e-9 * scale).all()
        assert (-values - found.upper[..., 0] <= 1e-9 * scale).all()
        assert (peaks <= found.peaks.max(axis=1)).all()
        if radius == 1e-4 and found.error < 1e-6:  # no event is grazed
            wide = found.upper.sum(axis=-1) - np.ptp(values, axis=0)
            assert (wide[:, :2] <= 0.05 * scale[:2]).all()


def test_steps_bound_what_lies_between_nodes(rng):
    frame = random_storey(rng)
    found, _, _ = bounds_and_motions(frame, ("k1",), 1e-3, rng)
    _, finer, _ = bounds_and_motions(frame, ("k1",), 1e-3, rng, step=0.005)
    steps = finer[:, 1:].reshape(len(finer), -1, 10, len(OUTPUTS))
    assert (steps.max(axis=(0, 2)) <= found.steps[1:, :, 1] + 1e-9).all()
    assert (-steps.min(axis=(0, 2)) <= found.steps[1:, :, 0] + 1e-9).all()


def test_a_grazed_yield_drift_is_within_an_error_of_its_size(rng):
    # The motion passes the yield drift for so short a time that no event is looked for. Then the
    # plastic drift is the whole error, and a bound without a constant would be too small.
    for _ in range(5):
        excess = 10 ** float(rng.uniform(-7, -5))
        frequency = float(rng.uniform(100, 300))
        drift = 0.01
        frame = StoreyFrame(
            masses=[1.0],
            stiffness=[frequency**2],
            v0=[frequency * drift * (1 + excess)],
            yield_drift=[drift],
            hardening=[0.1],
            outputs=("residual1", "dissipated1", "q1"),
        )
        frame = replace(frame, loads=[Force(1, 0.0, History(0.1, [1.0, 1.0]))])
        flow = YieldingFlow(frame, ("k1",), 2.5 / frequency, 0.5 / frequency)
        point = np.array([frequency**2])
        found = InterpolatedFrame(flow, np.arange(0)).bounds(point, point)
        values, _ = flow.values_and_peaks(point[np.newaxis])
        assert (values[0, -1] <= found.upper[-1, :, 1]).all()
        assert values[0, -1, 0] > 0
        assert found.upper[-1, 0, 1] <= 40 * excess * drift


@pytest.mark.parametrize("changes", [{"hardening": [0.0]}, {"dampers": [600 * 4e4]}])
def test_no_hardening_and_stiff_dashpots_are_enclosed(changes, rng):
    frame = random_storey(rng, **changes)
    found, values, _ = bounds_and_motions(frame, ("k1",), 1e-4, rng)
    assert np.isfinite(found.peaks).all()
    scale = 1e-9 * np.abs(values).max(axis=(0, 1))
    assert (values.max(axis=0) <= found.upper[..., 1] + scale).all()
    assert (-values.min(axis=0) <= found.upper[..., 0] + scale).all()


@pytest.mark.parametrize("offset", [-1e-12, 0.0, 1e-12])
def test_an_event_beside_a_sample_at_a_corner_is_enclosed(offset, rng):
    # A free motion yields at half its elastic amplitude. At the upper corner this is beside a
    # sample, where the length of the element behind or before it is almost zero.
    frequency = float(rng.uniform(2, 20))
    frame = StoreyFrame(
        masses=[1e3],
        stiffness=[1e3 * frequency**2],
        yield_drift=[0.01],
        hardening=[0.1],
        v0=[0.02 * frequency],
        ground=Accelerogram(np.arcsin(0.5) / frequency + offset, np.zeros(8)),
        outputs=OUTPUTS,
    )
    step = frame.ground.step
    flow = YieldingFlow(frame, ("k1",), 6 * step, step)
    high = 1e3 * np.array([frequency**2])
    for radius in (0.0, 1e-6, 0.01):
        low = high * (1 - radius)
        found = InterpolatedFrame(flow, np.arange(1)).bounds(low, high)
        values, peaks = flow.values_and_peaks(np.linspace(low, high, 30))
        scale = 1e-9 * np.abs(values).max(axis=(0, 1))
        assert np.isfinite(found.peaks).all()
        assert (values.max(axis=0) <= found.upper[..., 1] + scale).all()
        assert (-values.min(axis=0) <= found.upper[..., 0] + scale).all()
        assert (peaks.max(axis=0) <= found.peaks.max(axis=1) + scale).all()


@pytest.mark.parametrize(
    ("changes", "names", "words"),
    [
        ({"masses": [1.0] * 2, "stiffness": [1.0] * 2, "yield_force": [1.0] * 2}, "k1", "one storey"),
        ({"rayleigh": (0.0, 1e-3), "rayleigh_of": "tangent"}, "k1", "tangent"),
        ({"q0": [1.0]}, "k1", "yield drift at the start"),
        ({"gravity": 9.81, "hardening": [0.0]}, "k1", "negative"),
        ({"loads": [Force(1, 1.0, History.constant(is_static=True))]}, "k1", "static"),
        ({"loads": [Force(1, 1.0, History.constant())]}, "k1", "accelerations"),
    ],
)  # fmt: skip
def test_what_is_not_proved_is_refused(changes, names, words, rng):
    frame = (
        random_storey(rng, **changes)
        if len(changes.get("masses", "1")) == 1
        else StoreyFrame(**changes)
    )
    flow = YieldingFlow(frame, (names,), 1.0, 0.1)
    point = np.array([frame.parameters[names]])
    with pytest.raises(UnprovedError, match=words):
        InterpolatedFrame(flow, np.arange(1)).bounds(0.99 * point, 1.01 * point)
