"""Bounds of linear structures are guaranteed unless something forbids it, which is then told."""

from __future__ import annotations

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, MatrixStructure, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.methods.modal import Modal, model_with_error
from alphacut.fuzzy import Interval, Triangular

FRAME = StoreyFrame((2e4, 1e4), (3.0, 3.0), 25e9, 1e-6, (50.0, 50.0), q0=(0.0, 0.01))
INPUTS = {"E": Triangular(24e9, 25e9, 26e9), "m1": Triangular(1.9e4, 2e4, 2.1e4)}
SPAN = {"duration": 3.0, "step": 0.05, "alpha": (0, 0.5, 1)}


def trajectories(frame: StoreyFrame) -> np.ndarray:
    """Exact motions in the support, corners among them."""
    low, high = np.array([number.cut(0) for number in INPUTS.values()]).T
    share = np.vstack([np.random.default_rng(7).random((500, 2)), [[0, 0], [0, 1], [1, 0], [1, 1]]])
    return LinearFlow(frame, tuple(INPUTS), 3.0, 0.05, Exact()).values(low + (high - low) * share)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_the_default_is_guaranteed_and_not_wide(tolerance: float) -> None:
    found = envelope(FRAME, INPUTS, tolerance=tolerance, **SPAN)
    assert found.nature == "guaranteed"
    assert found.facts["kernel"] in ("C", "NumPy")
    assert found.error is not None
    assert found.error.max() <= tolerance
    values = trajectories(FRAME)
    assert (values <= found.upper[0]).all()
    assert (values >= found.lower[0]).all()
    assert np.abs(values.max((0, 1)) - found.maximum[0]).max() <= tolerance + 1e-4


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (replace(FRAME, damping_ratio=(0.02, 0.03)), "for each mode"),
        (replace(FRAME, dampers=(50.0, 50.0), damper_placement="storey"), None),
    ],
)
def test_the_reason_is_told_where_nothing_is_guaranteed(frame, reason) -> None:
    found = envelope(frame, INPUTS, **SPAN)
    assert found.nature == ("guaranteed" if reason is None else "estimated")
    assert reason is None or reason in str(found.facts["unproved"])


def test_gaps_and_errors_are_told_with_their_unit_and_promise_no_proof() -> None:
    flow = UnitFlow(LinearFlow(FRAME, tuple(INPUTS), 1.0, 0.1, Exact()), boxes(INPUTS, (0,)))
    *_, reason = model_with_error(flow.flow, flow, Modal(), 1e-16)
    told = (
        r"some \S+ m, takes too much of the gap 1e-16 m; a proof may need a gap of some \S+ m, or"
    )
    assert re.search(told, reason)
    assert replace(flow, relative=True).told(0.001) == "0.001 of each peak"
    with pytest.raises(ValueError, match=r"gap 1e-16 m is not above twice .* error, \S+ m; ask"):
        envelope(FRAME, INPUTS, method="modal", certify=1e-16, duration=1.0, step=0.1, alpha=(0,))


def test_more_than_six_inputs_are_not_proved() -> None:
    names = [*list(FRAME.parameters)[:6], "d1", "d2"]
    many = {
        n: Triangular(0.999 * x, x, 1.001 * x) for n, x in FRAME.parameters.items() if n in names
    }
    found = envelope(FRAME, many, tolerance=1e-4, **SPAN)
    assert found.nature == "searched"
    assert "up to 6 fuzzy inputs" in str(found.facts["unproved"])


@pytest.mark.parametrize("method", ["graph-follower", "improved-graph-follower"])
def test_followers_have_guaranteed_bounds_beside_their_own(method: str) -> None:
    found = envelope(FRAME, INPUTS, method=method, integrator="exact", tolerance=1e-4, **SPAN)
    assert found.proved_lower is not None
    assert found.proved_upper is not None
    assert found.error is not None
    values = trajectories(FRAME)
    assert (values <= found.proved_upper[0]).all()
    assert (values >= found.proved_lower[0]).all()
    assert (found.proved_upper - found.upper <= found.error + 1e-15).all()
    assert float(found.facts["proved_gap"]) <= 0.25e-4
    assert found.to_dataset()["proved_upper"].dims == ("alpha", "time", "output")


def test_a_structure_free_to_drift_is_followed_though_round_off_lets_its_drift_oscillate() -> None:
    spring = np.array([[1.0, -1.0], [-1.0, 1.0]])
    system = MatrixStructure(
        {"k": 123.0},
        [(1.0, np.diag([3.0, 2.0]))],
        damping=[(0.123, spring)],
        stiffness=[("k", spring)],
        v0=[1.0, 0.0],
        observed={"q1": [1, 0, 0, 0]},
    )
    found = envelope(system, {"k": Triangular(110.7, 123.0, 135.3)}, duration=1, step=0.1)
    assert "does not oscillate" in str(found.facts["reason"])


@pytest.mark.parametrize("stiffer", [1e4, 1e7, 1e9])
def test_a_declared_error_holds_the_round_off_beside_nearly_rigid_storeys(stiffer: float) -> None:
    masses, k = (1e4, 1e4, 1e4), (4e7, 4e7 * stiffer, 4e7)
    frame = StoreyFrame(masses, stiffness=k, q0=(0.01, 0.01, 0.01), outputs=("q1", "q3"))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        way = {"method": "modal", "tolerance": 1e-9}
        found = envelope(
            frame, {"k1": Interval(3.9e7, 4.1e7)}, duration=3, step=0.25, alpha=(0,), **way
        )
    said = [str(one.message) for one in caught]
    assert any("round-off alone" in one for one in said) is (stiffer > 1e8)
    assert not any("period is" in one and "0.186" not in one for one in said)
    for k1 in (3.9e7, 3.97e7, 4.1e7):
        true = exact_chain((k1, *k[1:]), masses[0], 0.01, found.time)[:, [0, 2]]
        assert (true - found.upper[0] <= found.error[0]).all()
        assert (found.lower[0] - true <= found.error[0]).all()


def exact_chain(k: tuple[float, ...], mass: float, start: float, time: Array) -> Array:
    """Free motion of a chain of equal masses from one place, to 60 digits, shape (T, n)."""
    mpmath = pytest.importorskip("mpmath")
    with mpmath.workdps(60):
        springs = [mpmath.mpf(x) / mpmath.mpf(mass) for x in (*k, 0)]
        n, A = len(k), mpmath.zeros(len(k))
        for i in range(n):
            A[i, i] = springs[i] + springs[i + 1]
            if i:
                A[i, i - 1] = A[i - 1, i] = -springs[i]
        squared, V = mpmath.eigsy(A)
        shares = [start * sum(V[:, a]) for a in range(n)]
        waves = [
            [shares[a] * mpmath.cos(mpmath.sqrt(squared[a]) * t) for a in range(n)] for t in time
        ]
        return np.array(
            [[float(sum(V[i, a] * w[a] for a in range(n))) for i in range(n)] for w in waves]
        )
