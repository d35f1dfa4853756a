"""Proved bounds of random frames with seven to thirty inputs: no exact motion leaves them."""

import numpy as np
import pytest

from alphacut.frame import DualProof, envelope
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.fuzzy import Nature
from tests.calibration.declared import Calibration, free_seed
from tests.calibration.motions import exact_flow, judged, random_frame, reached


@pytest.mark.slow
def test_no_exact_motion_leaves_the_dual_bounds():
    seed, refused = free_seed("many inputs"), 0
    table = Calibration("frames of many inputs: proved over attained width", seed)
    for number in range(6):
        rng = np.random.default_rng([seed, number])
        drawn = random_frame(rng, inputs=int(rng.integers(7, 31)), storeys=(4, 15))
        try:
            found = envelope(drawn.system, drawn.inputs, method=DualProof(), **drawn.motion)
        except UnprovedError as error:
            refused += 1
            print(number, error)
            continue
        assert found.nature is Nature.GUARANTEED
        ends = reached(exact_flow(drawn), drawn.inputs, rng)
        for k, output in enumerate(found.outputs):
            quantity = output.rstrip("0123456789")
            judged(table, found, ends, quantity, (number, output), outputs=[k])
    print(f"{refused} of 6 refused")
    table.judge()
