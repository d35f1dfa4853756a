"""A harmonic force of uncertain frequency: times count in periods, nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Force, History, StoreyFrame
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from tests.refused import refuses

HERTZ = 2.0
FORCE = Force(2, 30.0, History.harmonic(HERTZ, 0.7, 0.1))


def frame(**changes):
    arguments = {
        "masses": [10.0, 8.0], "stiffness": [3e3, 2e3], "lengths": [3.0, 3.0], "gravity": 9.81,
        "dampers": [5.0, 3.0], "damper_placement": "storey", "rayleigh": (0.1, 1e-3),
        "damping_ratio": [0.02, 0.05], "v0": [0.2, -0.1], "q0": [0.01, 0.02], "loads": [FORCE],
        "outputs": ("q2", "v1", "drift2", "base_shear", "overturning_moment"),
    }  # fmt: skip
    return StoreyFrame(**arguments | changes)


def response(model, duration, steps, names=(), point=()):
    flow = LinearFlow(model, names, duration, duration / steps, Exact())
    return flow.values(np.reshape(point, (1, len(names))))[0]


def test_the_response_is_that_of_the_frequency_at_the_same_part_of_a_period(rng):
    hertz = rng.uniform(0.5, 5.0)
    ratio = hertz / HERTZ
    moved = Force(2, 30.0, History.harmonic(hertz, 0.7, 0.1 / ratio))
    expected = response(frame(loads=[moved]), 2.0 / ratio, 200)
    found = response(frame(frequency=HERTZ), 2.0, 200, ["frequency"], [hertz])
    assert found == pytest.approx(expected, rel=1e-9, abs=1e-12 * abs(expected).max())


def test_other_loads_and_accelerations_are_refused():
    ground = Accelerogram(0.1, [0.0, 1.0, 0.0])
    step = Force(1, 1.0, History.constant())
    refused = [{"frequency": 3.0}, {"ground": ground}, {"loads": [FORCE, step]}, {"loads": []}]
    refused += [{"loads": [FORCE, Force(1, 1.0, None)]}, {"yield_force": [9.0, 9.0]}]
    for changes in refused:
        with refuses("frequency"):
            frame(**{"frequency": HERTZ, "gravity": 0.0} | changes)
    with refuses("output"):
        replace(frame(frequency=HERTZ), outputs=("a1",))
