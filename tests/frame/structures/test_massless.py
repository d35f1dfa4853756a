"""Unknowns without mass follow the others: motions, outputs that read them, and what is refused."""

import numpy as np
import pytest

from alphacut.frame import Accelerogram, DualProof, MatrixStructure, Proof, UnprovedError, envelope
from alphacut.fuzzy import Interval
from tests.frame.motions import exact_motions
from tests.refused import refuses

K = np.array([[3.0, -1, 0, 0], [-1, 2, -1, 0], [0, -1, 1.5, -0.4], [0, 0, -0.4, 1.0]])
SOIL = np.diag([0, 0, 0, 1.0])
RECORD = Accelerogram(0.02, np.sin(np.arange(100) * 0.21) * np.sin(np.arange(100) * 0.047))


def frame(light=0.0, **values):
    """Two floors and two rotations, on a soil spring, the rotations with mass `light`."""
    given = {
        "parameters": {"k": 1.0, "s": 1.0},
        "mass": [(1.0, np.diag([1.0, 2.0, light, light]))],
        "stiffness": [("k", 100 * K), ("s", 60 * SOIL)],
        "observed": {"roof": np.array([0, 1.0, 0, 0]), "turn": np.array([0, 0, 0.5, 1.0])},
        "ground": RECORD,
        "pattern": np.array([1.0, 1.0, 0, 0]),
        "ratios": (0.03,),
    }
    return MatrixStructure(**{**given, **values})


def test_motions_are_the_limit_of_small_masses():
    points = np.array([[1.0, 1.0], [1.1, 0.7]])
    motions = [exact_motions(frame(x), points, ("k", "s"), 2.0, 0.05) for x in (0.0, 1e-7)]
    size = np.abs(motions[0]).max((0, 1))
    assert (np.abs(motions[0] - motions[1]).max((0, 1)) < 1e-4 * size).all()


def test_the_dual_proof_bounds_outputs_that_read_them():
    """Exact motions at corners and inside are compared with its bounds by the envelope itself."""
    fuzzy = {"k": Interval(0.9, 1.1), "s": Interval(0.7, 1.3)}
    given = {"duration": 2.0, "step": 0.05, "alpha": (0,), "progress": False}
    found = envelope(frame(), fuzzy, method=DualProof(), **given)
    assert found.facts["motions_tested"] >= 24
    assert found.facts["gap_of_peaks"] < 0.03
    with pytest.raises(UnprovedError, match="take the method dual"):
        envelope(frame(), fuzzy, method=Proof(), **given)


@pytest.mark.parametrize(
    ("values", "key"),
    [
        ({"damping": [(1.0, np.diag([0, 0, 1.0, 0]))]}, "damping"),
        ({"stiffness": [("k", 100 * np.diag([1.0, 1, 1, 0]))]}, "stiffness"),
        ({"mass": [(1.0, np.diag([1.0, -1.0, 0, 0]))]}, "mass"),
    ],
)
def test_what_has_no_motion_is_refused_in_one_line(values, key):
    with refuses(key) as failure:
        frame(**values)
    assert "\n" not in str(failure.value)
