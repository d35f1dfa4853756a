"""Straying of motions between nodes is bounded, by 3.5 times the true one at coarse steps."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, Force, History, Proof, StoreyFrame, envelope
from alphacut.fuzzy import Triangular
from tests.frame.motions import exact_motions, off_chords, random_points

FLOORS, PARTS = 3, 20
NOISE = np.random.default_rng(800900).normal(size=300)
LOADS = {
    "ground": {"ground": Accelerogram(0.01, np.convolve(NOISE, np.ones(4) / 2, "same"))},
    "start": {"v0": (0.0, 0.0, 0.5)},
    "sine": {"loads": [Force(3, 1e3, History.harmonic(3.0, 0.3))]},
    "wind": {"loads": [Force(3, 1e3, History(0.35, NOISE[:9], 0.1))]},
}
CENTRE = {"k1": 4e7, "m3": 2e4}
STIFFNESS = 2e3 * (2 * np.eye(FLOORS) - np.eye(FLOORS, k=1) - np.eye(FLOORS, k=-1))
STIFFNESS[-1, -1] = 2e3
SHORTEST_PERIOD = 2 * np.pi / np.sqrt(np.linalg.eigvalsh(STIFFNESS)[-1])
PROOFS = [DualProof(slabs=2, steps=4, peaks=1.0, workers=1), Proof(tolerance=5e-2, workers=1)]


@pytest.mark.parametrize(
    ("load", "periods"),
    [*((load, 0.1) for load in LOADS), *zip(LOADS, (1.5, 1.0, 1.0, 1.5), strict=True)],
)
@pytest.mark.parametrize("proof", PROOFS)
def test_between_is_at_most_a_few_times_the_true_deviation(proof, load, periods):
    frame = StoreyFrame(
        [2e4] * FLOORS,
        stiffness=[4e7] * FLOORS,
        damping_ratio=0.03,
        outputs=("q3", "a3"),
        **LOADS[load],
    )
    step = periods * SHORTEST_PERIOD
    steps = min(int(1.5 / step), 24)
    inputs = {name: Triangular(0.97 * value, value, 1.03 * value) for name, value in CENTRE.items()}
    points = random_points(inputs, 16, np.random.default_rng(1))
    values = exact_motions(frame, points, inputs, steps * step, step / PARTS)
    off = off_chords(values.swapaxes(0, 1), PARTS).max(1)
    given = {"duration": steps * step, "step": step, "alpha": (0,), "progress": False}
    between = envelope(frame, inputs, proof, **given).between
    assert (off <= between[1:] * (1 + 1e-9)).all()
    assert (between.max(0) <= 3.5 * off.max(0)).all()
