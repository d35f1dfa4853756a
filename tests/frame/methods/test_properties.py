"""Properties that hold for any frame: containment, nesting, inner inside outer, and the promise of
`auto`.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import HealthCheck, given, reject, settings
from hypothesis import strategies as st

from alphacut.frame import Envelope, Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.methods.auto import ToleranceError
from alphacut.fuzzy import FuzzyNumber, Triangular
from tests.frame.nesting import nesting_violation

TIME = {"duration": 6, "step": 0.1}


@st.composite
def problems(draw: st.DrawFn) -> tuple[StoreyFrame, dict[str, FuzzyNumber]]:
    """Random frames of one to four floors with one to three fuzzy parameters."""
    n = draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 10**6)))
    frame = StoreyFrame(
        rng.uniform(4e3, 3e4, n),
        rng.uniform(2.3, 3.2, n),
        25e9,
        1e-6,
        rng.uniform(20, 500, n),
        str(rng.choice(["ground", "storey"])),
        rng.uniform(-0.1, 0.1, n),
        rng.uniform(-0.5, 0.5, n),
    )
    names = ["E", "l1", "d1", "q1_0", *(f"m{k + 1}" for k in range(n))]
    chosen = draw(st.lists(st.sampled_from(names), min_size=1, max_size=3, unique=True))
    inputs: dict[str, FuzzyNumber] = {}
    for name in chosen:
        middle, width = frame.parameters[name], rng.uniform(0.01, 0.08)
        low, high = sorted((middle * (1 - width), middle * (1 + 0.7 * width)))
        inputs[name] = Triangular(low, middle, high)
    return frame, inputs


def certified(
    frame: StoreyFrame, inputs: dict[str, FuzzyNumber], gap: float, **options: object
) -> Envelope:
    """The certified envelope; a problem with modes so close that no polynomials reach the gap, one
    in a thousand, is passed over.
    """
    try:
        return envelope(frame, inputs, method="modal", certify=gap, **TIME, **options)
    except ValueError as refused:
        if "not above twice the model error" not in str(refused):
            raise
        reject()


def outside(found: Envelope, lower: np.ndarray, upper: np.ndarray) -> float:
    return float(max((upper - found.upper).max(), (found.lower - lower).max()))


@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(problems(), st.integers(0, 10**6))
def test_certified_envelopes_contain_nest_and_enclose(
    problem: tuple[StoreyFrame, dict[str, FuzzyNumber]], seed: int
) -> None:
    frame, inputs = problem
    found = certified(frame, inputs, 2e-6, alpha=(0, 0.5, 1))
    assert found.inner_lower is not None
    assert found.inner_upper is not None
    assert (found.lower <= found.inner_lower).all()
    assert (found.inner_upper <= found.upper).all()
    assert (found.upper - found.inner_upper).max() <= 2.001e-6
    assert (found.lower <= found.upper).all()
    assert nesting_violation(found) == 0
    rng, flow = np.random.default_rng(seed), LinearFlow(frame, tuple(inputs), 6, 0.1, Exact())
    low, high = np.array([number.cut(0) for number in inputs.values()]).T
    points = np.clip(
        rng.uniform(low - 0.2 * (high - low), high + 0.2 * (high - low), (300, len(low))), low, high
    )
    values = flow.values(points)
    assert (values <= found.upper[0]).all()
    assert (values >= found.lower[0]).all()


@settings(max_examples=8, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    problems(),
    st.sampled_from(
        [
            (1e-2, ()),
            (1e-4, ()),
            (1e-5, ()),
            (1e-2, ("modal",)),
            (1e-3, ("modal",)),
            (1e-4, ("modal",)),
        ]
    ),
)
def test_auto_keeps_its_promise(
    problem: tuple[StoreyFrame, dict[str, FuzzyNumber]], order: tuple[float, tuple[str, ...]]
) -> None:
    frame, inputs = problem
    tolerance, exclude = order
    truth = certified(frame, inputs, 1e-6, alpha=(0,))
    found = envelope(
        frame, inputs, alpha=(0,), method="auto", tolerance=tolerance, exclude=exclude, **TIME
    )
    assert (
        max(np.abs(found.upper - truth.upper).max(), np.abs(found.lower - truth.lower).max())
        <= tolerance
    )
    assert float(found.facts["estimated_error"]) <= tolerance
    assert found.method not in exclude
    assert "reason" in found.facts


def test_graph_follower_is_inner_for_any_frame() -> None:
    frame = StoreyFrame(
        (9e3, 7e3), (2.4, 3.0), 25e9, 1e-6, (90, 60), "storey", (0.05, 0.0), (0.0, 0.4)
    )
    inputs = {"E": Triangular(23e9, 25e9, 26e9), "l2": Triangular(2.9, 3.0, 3.05)}
    truth = certified(frame, inputs, 1e-6)
    followed = envelope(frame, inputs, method="graph-follower", integrator="exact", **TIME)
    assert outside(followed, truth.lower, truth.upper) < 2e-3
    assert (followed.upper <= truth.upper).all()
    assert (followed.lower >= truth.lower).all()


def test_auto_says_what_it_cannot_do() -> None:
    frame = StoreyFrame((9e3,), (2.4,), 25e9, 1e-6, (90,), "ground", (0.05,), (0.0,))
    inputs = {"E": Triangular(20e9, 25e9, 30e9)}
    with pytest.raises(ToleranceError, match="no method reaches"):
        envelope(
            frame,
            inputs,
            method="auto",
            tolerance=1e-6,
            exclude=("modal", "improved-graph-follower"),
            **TIME,
        )
    with pytest.raises(ValueError, match="'magic' is unknown"):
        envelope(frame, inputs, method="auto", exclude=("magic",), **TIME)
    overdamped = StoreyFrame((9e3,), (2.4,), 25e9, 1e-6, (1e6,), "ground", (0.05,), (0.0,))
    found = envelope(overdamped, {"E": Triangular(20e9, 25e9, 30e9)}, alpha=(0,), **TIME)
    assert found.method == "improved-graph-follower"
    assert "does not oscillate" in str(found.facts["reason"])
