"""Proved bounds of random frames: no exact motion leaves them."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import DualProof, Proof, envelope
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.structures.loads import Accelerogram
from alphacut.fuzzy.refused import FailedError
from alphacut.fuzzy.result import Nature
from tests.calibration.declared import Calibration, free_seed
from tests.calibration.motions import exact_flow, judged, random_frame, reached

FRAMES = 60


def record(rng, period, duration):
    """Noise with jumps and silence; its step is 1/100 to 5 times the shortest period."""
    step = period * 10 ** rng.uniform(-2, np.log10(5))
    step = float(np.clip(step, duration / 4000, duration / 3))
    samples = rng.normal(size=int(duration * rng.uniform(0.5, 1.2) / step) + 2)
    silent = np.sort(rng.integers(0, len(samples), 2))
    samples[silent[0] : silent[1]] *= rng.integers(0, 2)
    return Accelerogram(step, 3 * samples)


def shaken(rng):
    """A frame of 2 to 10 storeys under such a record, with 1 to 13 fuzzy inputs."""
    drawn = random_frame(rng, inputs=int(rng.integers(1, 14)), storeys=(2, 10))
    period = 2 * np.pi / float(frequencies(drawn.system)[-1])
    duration = float(rng.choice([1.0, 2.0, 4.0]))
    damping = {"damping_ratio": float(rng.uniform(0.02, 0.06))}
    if rng.random() < 0.4 and "zeta" not in drawn.inputs:
        damping = {
            "damping_ratio": None,
            "rayleigh": (rng.uniform(0.2, 0.6), rng.uniform(5e-4, 2e-3)),
        }
    system = replace(drawn.system, ground=record(rng, period, duration), q0=(), **damping)
    return system, drawn.inputs, {"duration": duration, "step": 0.04, "alpha": (0.0, 1.0)}


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


@pytest.mark.slow
def test_no_motion_leaves_a_guaranteed_envelope():
    """Each is judged by its own exact motions, under records of any step."""
    seed, natures = free_seed("the self-test of proofs"), []
    for number in range(FRAMES):
        system, inputs, motion = shaken(np.random.default_rng([seed, number]))
        try:
            natures.append(envelope(system, inputs, progress=False, **motion).nature)
        except FailedError as failure:
            if "the proof is wrong" in str(failure):
                raise
    assert natures.count(Nature.GUARANTEED) > FRAMES / 2
