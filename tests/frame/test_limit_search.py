"""The proof behind safe tolerances: what it leaves unproved, and the model's error against it."""

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame
from alphacut.frame.decisions.limit_search import LimitSearch, unproved
from alphacut.frame.decisions.safe_scale import scaled

MASS = np.array([1e3])
RIGIDITY = 24 * 2.5e10 * 1e-6 / 27


def searched(scale: float) -> LimitSearch:
    """One floor without damping, |q| = v0 / ω, whose limit is reached at a scale."""
    frame = StoreyFrame([1e3], [3.0], 2.5e10, 1e-6, v0=[0.5], outputs=("q1",))
    limit = 0.5 * np.sqrt(1e3 * (1 + 0.1 * scale) / RIGIDITY)
    flow = LinearFlow(frame, ("m1",), 2.0, 0.005, Exact())
    found = LimitSearch(
        flow, scaled(MASS, 0.1 * MASS, 0.1 * MASS), np.array([limit]), MASS, gap=1e-4
    )
    found.fit(2.0)
    return found


def left(search: LimitSearch, size: float) -> int:
    pending = np.arange(2 * len(search.flow.time))
    return len(unproved(search, size, pending, 100, 1)[0])


@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_an_unsafe_box_is_never_proved_and_a_safe_one_is(scale):
    search = searched(scale)
    assert left(search, scale - 0.05) == 0
    assert left(search, scale + 0.05) > 0


def test_the_error_of_the_model_counts_against_the_limit():
    search = searched(1.5)
    assert left(search, 1.2) == 0
    search.error = search.error + 0.05  # of the limit; the motion reaches 0.987 of it
    assert left(search, 1.2) > 0
    search.error = search.error - 0.05
    assert left(search, 1.2) == 0
