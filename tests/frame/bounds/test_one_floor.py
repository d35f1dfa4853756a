"""One floor alone has one mode, whatever its dashpot, weight and outputs: the dual bound holds."""

import numpy as np
import pytest

from alphacut.frame import DualProof, Force, History, StoreyFrame, envelope
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions, random_points, require_inside

NOMINAL = {
    "m1": 2e4,
    "k1": 6e6,
    "l1": 3.2,
    "d1": 4e4,
    "zeta": 0.02,
    "rayleigh_mass": 0.05,
    "rayleigh_stiffness": 2e-3,
    "q1_0": 0.004,
    "v1_0": 0.3,
    "F1": 2e4,
}
OUTPUTS = ("q1", "v1", "a1", "base_shear", "overturning_moment")


@pytest.mark.parametrize("gravity", [0.0, 500.0])  # the latter halves the stiffness
@pytest.mark.parametrize("width", [0.0, 0.03])
def test_one_floor_with_a_dashpot_and_its_overturning_moment_is_proved(gravity, width, rng):
    """Also where some of its inputs have no width, and all of them none."""
    frame = StoreyFrame(
        [NOMINAL["m1"]],
        stiffness=[NOMINAL["k1"]],
        lengths=[NOMINAL["l1"]],
        dampers=[NOMINAL["d1"]],
        damping_ratio=NOMINAL["zeta"],
        rayleigh=(NOMINAL["rayleigh_mass"], NOMINAL["rayleigh_stiffness"]),
        q0=(NOMINAL["q1_0"],),
        v0=(NOMINAL["v1_0"],),
        gravity=gravity,
        loads=[Force(1, NOMINAL["F1"], History.constant())],
        outputs=OUTPUTS,
    )
    fuzzy = [*NOMINAL]
    inputs = {x: Interval(NOMINAL[x] * (1 - width), NOMINAL[x] * (1 + width)) for x in fuzzy}
    found = envelope(frame, inputs, DualProof(), duration=1.0, step=0.02, alpha=(0,))
    assert found.nature == "guaranteed"
    values = exact_motions(frame, random_points(inputs, 500, rng), inputs, 1.0, 0.02)
    require_inside(values, found, slack=1e-12)
    size = np.abs(values).max((0, 1))
    peak = np.maximum(found.upper[0], -found.lower[0]).max(0)
    assert (peak <= size * (1 + (0.02 if width else 2e-9))).all()  # the margin for rounding
