"""Proved bounds of random frames with one to six inputs: no exact motion leaves them."""

import numpy as np
import pytest

from alphacut.frame import DualProof, Proof, envelope
from tests.calibration.declared import Calibration, free_seed
from tests.calibration.motions import exact_flow, judged, random_frame, reached


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [1, 2, 3, 4, 5, 6])
def test_no_exact_motion_leaves_proved_bounds(inputs):
    seed = free_seed(f"frames under proof, {inputs} inputs")
    table = Calibration(f"frames under proof, {inputs} inputs: proved over attained width", seed)
    for number in range(3):
        rng = np.random.default_rng([seed, inputs, number])
        drawn = random_frame(rng, inputs, damped=number > 0)
        method = DualProof() if len(drawn.inputs) > 4 else Proof(tolerance=1e-2)
        found = envelope(drawn.system, drawn.inputs, method=method, **drawn.motion)
        ends = reached(exact_flow(drawn), drawn.inputs, rng)
        for k, output in enumerate(found.outputs):
            quantity = output.rstrip("1234")
            judged(table, found, ends, quantity, (number, output), outputs=[k])
    table.judge()
