"""Proved bounds of random frames: no exact motion leaves them."""

import numpy as np
import pytest

from alphacut.frame import DualProof, Proof, UnprovedError, envelope
from alphacut.fuzzy import Nature
from tests.calibration.declared import Calibration, free_seed
from tests.calibration.motions import exact_flow, judged, random_frame, reached


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [1, 2, 3, 4, 5, 6, "7 to 30"])
def test_no_exact_motion_leaves_proved_bounds(inputs):
    seed, refused = free_seed(f"frames under proof, {inputs} inputs"), 0
    table = Calibration(f"frames under proof, {inputs} inputs: proved over attained width", seed)
    for number in range(3 if inputs != "7 to 30" else 6):
        rng = np.random.default_rng([seed, number])
        if inputs == "7 to 30":
            drawn = random_frame(rng, inputs=int(rng.integers(7, 31)), storeys=(4, 15))
        else:
            drawn = random_frame(rng, inputs, damped=number > 0)
        method = DualProof() if len(drawn.inputs) > 4 else Proof(tolerance=1e-2)
        try:
            found = envelope(drawn.system, drawn.inputs, method=method, **drawn.motion)
        except UnprovedError as error:
            refused += 1
            print(number, error)
            continue
        assert found.nature is Nature.GUARANTEED
        ends = reached(exact_flow(drawn), drawn.inputs, rng)
        for k, output in enumerate(found.outputs):
            quantity = output.rstrip("0123456789")
            judged(table, found, ends, quantity, (number, output), outputs=[k])
    assert refused == 0 or inputs == "7 to 30"
    table.judge()
