"""What is done where no method is named, and what is said of a modal model that misses its
tolerance.
"""

from __future__ import annotations

import warnings
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from alphacut.frame import Envelope, Exact, LinearFlow, MatrixStructure, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.checks.step_error import step_error
from alphacut.frame.dynamics.integrators import Midpoint
from alphacut.frame.methods import auto
from alphacut.frame.methods.modal import GapError, Modal
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy import Interval, Triangular

FRAME = StoreyFrame((2e4, 1e4), (3.0, 3.0), 25e9, 1e-6, q0=(0.0, 0.01))
LIGHT = {"m1": Interval(1e-3, 2e4)}
EYE = np.eye(2)
DOUBLE = MatrixStructure(
    {"k": 10.0}, [(1.0, EYE)], [("k", EYE)], {"x": np.array([1.0, 0.0])}, q0=np.array([1.0, 2.0])
)


def test_a_double_mode_is_no_smooth_function_and_is_left_to_the_graph_follower() -> None:
    found = envelope(DOUBLE, {"k": Triangular(9, 10, 12)}, duration=1.0, step=0.01)
    assert found.method == "improved-graph-follower"
    assert "modes 1 and 2 have the same frequency" in str(found.facts["reason"])
    truth = np.cos(np.sqrt(np.linspace(9, 12, 400))[:, None] * found.time)
    assert found.upper[-1, 50, 0] == pytest.approx(np.cos(np.sqrt(10) / 2), abs=1e-6)
    assert found.error is not None
    assert (truth.max(0) - found.upper[0, :, 0] <= found.error[0, :, 0]).all()
    with pytest.raises(ModalError, match="take the method auto"):
        envelope(DOUBLE, {"k": Triangular(9, 10, 12)}, duration=1.0, step=0.01, method="modal")


def test_a_support_too_wide_for_polynomials_keeps_the_wanted_error() -> None:
    found = envelope(FRAME, LIGHT, duration=1.0, step=0.02, alpha=(0,))
    values = LinearFlow(FRAME, ("m1",), 1.0, 0.02, Exact()).values(
        np.geomspace(1e-3, 2e4, 1500)[:, None]
    )
    missed = max((values.max(0) - found.upper[0]).max(), (found.lower[0] - values.min(0)).max())
    assert found.error is not None
    assert missed <= found.error.max() <= 1e-4
    assert found.nature == "searched"
    assert "lead exact trajectories" in str(found.facts["reason"])


def test_a_modal_model_that_misses_its_tolerance_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*_: object, **__: object) -> ExactResponse:
        raise ModalError("modal: not here")

    monkeypatch.setattr(ExactResponse, "of", refused)
    with pytest.warns(
        UserWarning, match="reach .* and not the tolerance 1e-06.*take the method auto"
    ):
        found = envelope(FRAME, LIGHT, duration=1.0, step=0.02, alpha=(0,), method="modal")
    assert "not the tolerance" in str(found.facts["reason"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        envelope(FRAME, LIGHT, duration=1.0, step=0.02, alpha=(0,))


def test_forces_alone_are_told_to_a_share_of_their_peaks() -> None:
    shears = StoreyFrame(
        (2e4, 1e4), (3.0, 3.0), 25e9, 1e-6, q0=(0.0, 0.01), outputs=("base_shear", "v2")
    )
    found = envelope(shears, {"E": Triangular(24e9, 25e9, 26e9)}, duration=1.0, step=0.02)
    assert found.method == "modal"
    assert found.error is not None
    assert (found.error.max((0, 1)) < 1e-3 * np.abs(found.lower).max((0, 1))).all()


def test_options_that_a_proof_can_keep_do_not_end_it() -> None:
    def found(**options: Any) -> Envelope:
        inputs = {"E": Triangular(24e9, 25e9, 26e9)}
        return envelope(FRAME, inputs, duration=0.5, step=0.05, alpha=(0,), **options)

    plain = found()
    for asked in ({"workers": 2}, {"seed": 1}, {"progress": False}, {"progress": True}):
        same = found(**asked)
        assert (same.nature, same.facts["reason"]) == ("guaranteed", plain.facts["reason"])
        assert (same.upper == plain.upper).all()
    light = found(passes=1)
    assert "passes chose the method modal, which proves nothing" in str(light.facts["unproved"])
    assert "unproved" not in found(certify=1e-3).facts
    with pytest.raises(ValueError, match="progress is 5; it must be a function"):
        found(progress=5)


def test_a_seed_is_that_of_the_search_where_nothing_is_proved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def unproved(*_: object) -> Envelope:
        raise UnprovedError("not here")

    def made(**options: Any) -> Modal:
        seeds.append(options["seed"])
        return Modal(**options)

    seeds: list[int] = []
    monkeypatch.setattr(auto, "guaranteed", unproved)
    monkeypatch.setattr(auto, "Modal", made)
    inputs = {"E": Triangular(24e9, 25e9, 26e9)}
    envelope(FRAME, inputs, duration=0.2, step=0.1, alpha=(0,), seed=7)
    assert seeds == [7]


def unproved(error: type[RuntimeError], shares: list[float]) -> Any:
    """A proof that goes on to the end, which it does not reach."""

    def proof(flow: Any, gap: float, progress: Any, workers: Any) -> Any:
        for share in (0.2, 0.7, 1.0):
            progress(share)
        shares.append(np.nan)
        raise error("the boxes did not suffice")

    return proof


@pytest.mark.parametrize("error", [UnprovedError, GapError])
@pytest.mark.parametrize("tolerance", [1e-4, 1e-9])
def test_progress_never_falls_where_a_search_follows_a_proof(
    error: type[RuntimeError], tolerance: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    shares: list[float] = []
    monkeypatch.setattr(auto, "guaranteed", unproved(error, shares))
    given = {"m1": Interval(1e4, 2e4)}
    common: dict[str, Any] = {"duration": 1.0, "step": 0.02, "tolerance": tolerance}
    envelope(FRAME, given, alpha=(0,), progress=shares.append, **common)
    proofs = np.flatnonzero(np.isnan(shares))
    assert len(proofs) == (2 if error is GapError else 1)
    told = np.delete(shares, proofs)
    assert len(told) > 3 * len(proofs) + 2
    assert (np.diff(told) >= 0).all()
    assert told[2] < told[-1] <= 1


def test_stages_that_are_shown_by_name_begin_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []

    class Named:
        def stage(self, what: str) -> None:
            told.append(what)

        def __call__(self, done: float) -> None:
            told.append(done)

    monkeypatch.setattr(auto, "guaranteed", unproved(GapError, []))
    envelope(FRAME, LIGHT, alpha=(0,), progress=Named(), duration=1.0, step=0.02)
    names = [one for one in told if isinstance(one, str)]
    assert [name.partition(" (")[0] for name in names[:3]] == [
        "proof up to 1e-05 m",
        "proof up to 0.0001 m",
        "search",
    ]
    for name in names:
        after = told[told.index(name) + 1 :]
        own = after[: next((k for k, one in enumerate(after) if isinstance(one, str)), len(after))]
        assert own == sorted(own), name  # type: ignore[type-var]


class Memory(dict[str, Any]):
    """Keeps arrays by name, as a file of an unfinished run does."""

    load = dict.get
    save = dict.__setitem__


def test_a_proof_that_failed_is_not_tried_again_by_the_same_call(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shares: list[float] = []
    monkeypatch.setattr(auto, "guaranteed", unproved(GapError, shares))
    kept: Any = Memory()
    common: dict[str, Any] = {"alpha": (0,), "duration": 1.0, "step": 0.02, "kept": kept}
    first = envelope(FRAME, LIGHT, progress=shares.append, **common)
    assert np.isnan(shares).sum() == 2
    again = envelope(FRAME, LIGHT, progress=shares.append, **common)
    assert np.isnan(shares).sum() == 2
    assert again.facts.get("unproved") == first.facts.get("unproved")
    assert np.array_equal(again.upper, first.upper)
    assert set(kept) >= {"unproved"}


MANY = {name: Triangular(0.97 * x, x, 1.03 * x) for name, x in FRAME.parameters.items() if x}


def missing(self: Modal, flow: Any, progress: Any = None) -> Envelope:
    """A search among many inputs that goes on finding more."""
    found = Modal(self.tolerance).run(flow, progress)
    assert found.error is not None
    return replace(found, error=0.01 + found.error, facts={**found.facts, "bounds": "exact"})


def test_many_inputs_that_miss_the_tolerance_do_not_begin_the_graph_follower(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Missed(Modal):
        run = missing

    monkeypatch.setattr(auto, "Modal", Missed)
    monkeypatch.delattr(auto.BatchFollower, "run")
    assert len(MANY) > 6
    common: dict[str, Any] = {"duration": 0.4, "step": 0.02, "alpha": (0,)}
    with pytest.raises(auto.ToleranceError, match=r"modal estimates 0.01 m\); take fewer or"):
        envelope(FRAME, MANY, **common)


def test_time_stepping_takes_its_error_from_the_tolerance() -> None:
    flow = LinearFlow(FRAME, ("m1",), 1.0, 0.02, Midpoint())
    way = UnitFlow(flow, boxes(LIGHT, (0.0,)))
    steps = step_error(way)
    reached = float((steps / way.scale).max())
    assert reached > 0
    assert auto.Auto(3 * reached).left(way, steps) == pytest.approx(2 * reached)
    with pytest.raises(auto.ToleranceError, match="the error of time stepping"):
        auto.Auto(reached).left(way, steps)
