"""Proved bounds of random frames with one to six inputs: no exact motion leaves them."""

import numpy as np
import pytest

from alphacut.frame import DualProof, Proof, envelope
from tests.calibration.declared import Calibration, free_seed
from tests.calibration.motions import exact_flow, judged, random_frame, reached


@pytest.mark.slow
def test_no_exact_motion_leaves_proved_bounds():
    seed = free_seed("frames under proof")
    table = Calibration("frames under proof: proved over attained width", seed)
    for number in range(12):
        rng = np.random.default_rng([seed, number])
        drawn = random_frame(rng, inputs=1 + number % 6, damped=number % 4 > 0)
        method = DualProof() if len(drawn.inputs) > 4 else Proof(tolerance=1e-2)
        found = envelope(drawn.system, drawn.inputs, method=method, **drawn.motion)
        ends = reached(exact_flow(drawn), drawn.inputs, rng)
        for k, output in enumerate(found.outputs):
            one = [end[:, [k]] for end in ends]
            judged(table, found.select(output), one, output.rstrip("1234"), (number, output))
    table.judge()
