"""No guaranteed envelope of random frames is left by exact motions; the test's share of the time."""

import time

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, envelope, propagation
from alphacut.frame.structures.linear import frequencies
from alphacut.frame.structures.loads import Accelerogram
from alphacut.fuzzy import Triangular
from alphacut.fuzzy.refused import FailedError
from alphacut.fuzzy.result import Nature
from tests.calibration.declared import free_seed

FRAMES = 60


def record(rng, period, duration):
    """Noise with jumps and silence; its step is 1/100 to 5 times the shortest period."""
    step = period * 10 ** rng.uniform(-2, np.log10(5))
    step = float(np.clip(step, duration / 4000, duration / 3))
    samples = rng.normal(size=int(duration * rng.uniform(0.5, 1.2) / step) + 2)
    silent = np.sort(rng.integers(0, len(samples), 2))
    samples[silent[0] : silent[1]] *= rng.integers(0, 2)
    return Accelerogram(step, 3 * samples)


def frame(rng):
    """A frame of 1 to 10 storeys with outputs of all kinds, and 1 to 13 fuzzy inputs."""
    n = int(rng.integers(1, 11))
    own = {"masses": tuple(rng.uniform(2e4, 6e4, n)), "stiffness": tuple(rng.uniform(2e7, 2e8, n))}
    if rng.random() < 0.6:
        own["damping_ratio"] = float(rng.uniform(0.02, 0.06))
    else:
        own["rayleigh"] = (rng.uniform(0.2, 0.6), rng.uniform(5e-4, 2e-3))
    kinds = ("q", "v", "a", "drift", "shear")
    own["outputs"] = tuple(f"{kind}{rng.integers(1, n + 1)}" for kind in kinds)
    duration = float(rng.choice([1.0, 2.0, 4.0]))
    period = 2 * np.pi / float(frequencies(StoreyFrame(**own, q0=(1.0,) * n))[-1])
    own["ground"] = record(rng, period, duration)
    names = [f"{x}{z + 1}" for x in "km" for z in range(n)]
    chosen = rng.choice(names, min(int(rng.integers(1, 14)), len(names)), replace=False)
    system, width = StoreyFrame(**own), rng.uniform(0.01, 0.08)
    inputs = {
        str(x): Triangular(*(system.parameters[x] * np.array([1 - width, 1, 1 + width])))
        for x in chosen
    }
    return system, inputs, {"duration": duration, "step": 0.04, "alpha": (0.0, 1.0)}


@pytest.mark.slow
def test_no_motion_leaves_a_guaranteed_envelope(monkeypatch):
    seed, test = free_seed("the self-test of proofs"), propagation.with_motions_tested
    spent, shares, natures = [0.0], [], []

    def timed(*given):
        begun = time.process_time()
        try:
            return test(*given)
        finally:
            spent.append(time.process_time() - begun)

    monkeypatch.setattr(propagation, "with_motions_tested", timed)
    for number in range(FRAMES):
        system, inputs, motion = frame(np.random.default_rng([seed, number]))
        begun = time.process_time()
        try:
            found = envelope(system, inputs, progress=False, **motion)
        except FailedError as failure:
            if "the proof is wrong" in str(failure):
                raise
            continue
        natures.append(found.nature)
        if found.nature is Nature.GUARANTEED:
            shares.append(spent[-1] / (time.process_time() - begun))
            print(
                f"{len(system.masses)} storeys, {len(inputs)} inputs, {found.method}:"
                f" {found.facts['motions_tested']} motions, {shares[-1]:.1%} of the time"
            )
    guaranteed = natures.count(Nature.GUARANTEED)
    print(f"{guaranteed} of {FRAMES} guaranteed; median share {np.median(shares):.1%}")
    assert guaranteed > FRAMES / 2
