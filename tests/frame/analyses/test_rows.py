"""Rows of answers: no column has the number of another one."""

from itertools import pairwise

import numpy as np
import pytest

from alphacut.frame import (
    Force,
    History,
    Limit,
    StoreyFrame,
    TargetSpectrum,
    decide,
    envelope,
    peaks,
    probability,
    spectrum_response,
    static_bounds,
    tolerances,
)
from alphacut.fuzzy import Triangular

FRAME = StoreyFrame(
    masses=[9e3, 7e3],
    stiffness=[2e6, 1e6],
    damping_ratio=0.05,
    v0=[0.0, 0.4],
    outputs=("q1", "drift2"),
)
INPUTS = {"k1": Triangular(1.8e6, 2e6, 2.1e6), "k2": Triangular(0.9e6, 1e6, 1.2e6)}
MOTION = {"duration": 2.0, "step": 0.05}
RISING = {
    "decision": [
        ("least possibility", "greatest possibility"),
        ("peak reached", "bound of peak"),
    ],
    "probability": [("at least", "at most")],
    "tolerances": [("from", "to"), ("from in the case", "to in the case")],
    "static bounds": [("lower bound", "nominal", "upper bound")],
    "static attained": [("smallest attained", "nominal", "largest attained")],
    "response spectrum": [
        ("guaranteed lower", "attained lower", "nominal", "attained upper", "guaranteed upper")
    ],
}


def speeds(rng, count):
    return rng.normal(0.4, 0.1, count)


def answered(name):
    """An answer in which no two of these columns agree."""
    if name.startswith("static"):
        force = Force(2, 1e4, History.constant(0, is_static=True))
        frame = StoreyFrame([1.0, 1.0], stiffness=[2e6, 1e6], loads=[force], outputs=("q2",))
        return static_bounds(frame, INPUTS, alpha=[0.0])
    if name == "response spectrum":
        spectrum = TargetSpectrum([0.05, 1.0, 2.0], [2.0, 4.0, 1.0])
        return spectrum_response(FRAME, INPUTS, spectrum, alpha=[0.0])
    found = peaks(envelope(FRAME, INPUTS, **MOTION, alpha=(0.5, 1.0)))
    limit = Limit("q1", 1.3 * float(found["q1"].upper[0]))
    if name == "decision":
        return decide(found, [limit])
    if name == "tolerances":
        return tolerances(FRAME, INPUTS, limit, **MOTION)
    middle = Limit("q1", float(found["q1"].upper[-1]))
    return probability(
        FRAME, INPUTS, [middle], {"v2_0": speeds}, **MOTION, alpha=(0, 1), samples=200
    )


@pytest.mark.parametrize("name", RISING)
def test_lower_ends_stand_in_the_columns_of_lower_ends(name):
    rows = answered(name).records()
    for titles in RISING[name]:
        for low, high in pairwise(titles):
            pairs = [(row[low], row[high]) for row in rows]
            known = np.array([pair for pair in pairs if None not in pair], float)
            assert (known[:, 0] <= known[:, 1]).all(), (low, high)
            assert (known[:, 0] < known[:, 1]).any(), (low, high)
