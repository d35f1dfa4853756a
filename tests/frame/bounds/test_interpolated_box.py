"""Boxes of frames with one yielding storey: motions stay inside, and the bounds are close."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, StoreyFrame
from alphacut.frame.bounds.interpolated_box import InterpolatedFrame
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import YieldingFlow


def isolated_building(rng, storeys, **changes):
    """A building of elastic storeys on an isolator of a random period under a random record."""
    floors = storeys + 1
    stiffness = 4e4 * floors * (2 * np.pi / float(rng.uniform(0.4, 1.0))) ** 2
    samples = 4 * rng.normal(size=10).repeat(3) + rng.normal(size=30)
    frame = StoreyFrame(
        masses=[4e4] * floors,
        stiffness=[stiffness] + [10 * stiffness] * storeys,
        lengths=[10.0] * floors,
        rayleigh=(0.1, 1e-3),
        dampers=[1e4] * floors,
        damper_placement="storey",
        yield_force=[4e4 * floors * float(rng.uniform(0.5, 1.0))] + [1e9] * storeys,
        hardening=[float(rng.uniform(0.05, 0.2))] + [1.0] * storeys,
        ground=Accelerogram(0.05, samples),
        outputs=("q1", "v1", "a1", "base_shear", "residual1", f"drift{floors}", f"a{floors}"),
    )
    return replace(frame, **changes)


def compared(frame, names, radius, rng):
    """Bounds over a box of inputs, and values and peaks of motions in it."""
    flow = YieldingFlow(frame, names, 1.5, 0.05)
    nominal = np.array([frame.parameters[name] for name in names])
    low, high = nominal * (1 - radius), nominal * (1 + radius)
    found = InterpolatedFrame(flow, np.arange(len(names))).bounds(low, high)
    points = np.vstack([low, high, rng.uniform(low, high, (40, len(names)))])
    return found, *flow.values_and_peaks(points)


@pytest.mark.parametrize(
    ("names", "changes"),
    [
        (("k1",), {}),
        (("k1", "fy1"), {"gravity": 1.0}),
        (("fy1", "m2"), {"damping_ratio": 0.03}),
        (("k1",), {"damping_ratio": 0.03}),
        (("fy1",), {"hardening": [0.0, 1.0]}),
    ],
)
def test_motions_of_an_isolated_building_stay_inside_close_bounds(names, changes, rng):
    for radius in (1e-4, 0.01):
        frame = isolated_building(rng, 1, **changes)
        found, values, peaks = compared(frame, names, radius, rng)
        if not np.isfinite(found.peaks).all():
            assert radius > 1e-3
            continue
        scale = np.abs(values).max(axis=(0, 1)) + 1e-12
        assert (values <= found.upper[..., 1] + 1e-9 * scale).all()
        assert (-values <= found.upper[..., 0] + 1e-9 * scale).all()
        assert (peaks <= found.peaks.max(axis=1) * (1 + 1e-9)).all()
        if radius == 1e-4 and found.error < 1e-3:
            assert found.peaks.max(axis=1)[0] <= 1.01 * peaks.max(axis=0)[0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"hardening": [0.1, 0.1]}, "one storey"),
        ({"rayleigh_of": "tangent"}, "tangent"),
        ({"gravity": 9.81, "hardening": [0.0, 1.0]}, "negative"),
    ],
)
def test_what_is_not_proved_is_refused(changes, words, rng):
    with pytest.raises(UnprovedError, match=words):
        compared(isolated_building(rng, 1, **changes), ("k1",), 0.01, rng)
