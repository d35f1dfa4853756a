"""The modal model against trajectories, its search against certified bounds, and the certificate
against sampling.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from alphacut import frame
from alphacut.frame import (
    Accelerogram,
    Envelope,
    Exact,
    LinearFlow,
    Midpoint,
    RungeKutta4,
    StoreyFrame,
    envelope,
)
from alphacut.frame.boxes import Boxes, UnitFlow, boxes
from alphacut.frame.certificate import certificate
from alphacut.frame.certificate.branch_and_bound import BranchAndBound
from alphacut.frame.certificate.remainder import Remainder
from alphacut.frame.dynamics.integrators import Integrator
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.search import ModalSearch
from alphacut.frame.structures.modes import ModalError
from alphacut.fuzzy import Triangular
from benchmarks.frame.envelopes import FRAME
from benchmarks.frame.integrators import Gauss4
from tests.frame.nesting import nesting_violation

INPUTS = {"E": Triangular(22.7626e9, 24.7561e9, 25.8312e9)} | {
    f"m{i + 1}": Triangular(0.95 * m, m, 1.05 * m) for i, m in enumerate(FRAME.masses)
}
CUTS: Boxes = boxes(INPUTS, (0,))
POINTS = np.random.default_rng(1).uniform(-1, 1, (40, 4))


@pytest.fixture(scope="module")
def certified() -> Envelope:
    return envelope(
        FRAME, INPUTS, duration=6, step=0.1, alpha=(0, 0.5, 1), method="modal", certify=1e-6
    )


@pytest.mark.parametrize("method", [Exact(), Midpoint(), Gauss4(), RungeKutta4()], ids=str)
def test_polynomials_stand_for_the_integrator(method: Integrator) -> None:
    flow = LinearFlow(FRAME, CUTS.names, 30, 0.05, method)
    model = fit_modes(flow, CUTS)
    assert model.analyses < 60
    assert np.abs(model.values(POINTS) - flow.values(CUTS.to_physical(POINTS))).max() < 1e-6


def test_derivatives_of_the_modal_model() -> None:
    flow = LinearFlow(FRAME, CUTS.names, 20, 0.05, Exact())
    model, jet = fit_modes(flow, CUTS), UnitFlow(flow, CUTS).taylor(POINTS)
    rng, k = np.random.default_rng(2), np.arange(len(POINTS))
    node, output = rng.integers(0, 401, len(k)), rng.integers(0, 3, len(k))
    f, g, H = model.at(POINTS, node, output)
    assert np.abs(f - jet.value[k, node, output]).max() < 1e-6
    assert np.abs(g.T - jet.first[:, k, node, output]).max() < 1e-5
    assert np.abs(np.moveaxis(H, 0, -1) - jet.second[:, :, k, node, output]).max() < 1e-4


def test_base_excitation_enters_the_modal_model() -> None:
    ground = Accelerogram(0.05, np.random.default_rng(4).standard_normal(200))
    flow = LinearFlow(replace(FRAME, ground=ground), CUTS.names, 12, 0.05, Exact())
    model = fit_modes(flow, CUTS)
    truth = flow.values(CUTS.to_physical(POINTS))
    assert np.abs(model.values(POINTS) - truth).max() < 2e-6 * np.abs(truth).max()
    node, output, k = np.full(40, 200), np.full(40, 1), np.arange(40)
    f, g, _ = model.at(POINTS, node, output)
    jet = UnitFlow(flow, CUTS).taylor(POINTS)
    assert np.abs(f - truth[k, node, output]).max() < 2e-6 * np.abs(truth).max()
    assert np.abs(g.T - jet.first[:, k, node, output]).max() < 1e-5 * np.abs(jet.first).max()


def test_long_excitation_is_cut_into_windows() -> None:
    ground = Accelerogram(0.05, np.random.default_rng(5).standard_normal(800))
    inputs = {"E": Triangular(20e9, 24.7561e9, 28e9)}
    cuts = boxes(inputs, (0,))
    flow = LinearFlow(
        replace(FRAME, ground=ground, dampers=(900.0, 800.0, 500.0)), ("E",), 40, 0.05, Exact()
    )
    model = fit_modes(flow, cuts)
    assert model.load is not None
    assert len(model.load.starts) >= 2
    points = np.linspace(-1, 1, 9)[:, None]
    truth = UnitFlow(flow, cuts).taylor(points)
    size = np.abs(truth.value).max()
    assert np.abs(model.values(points) - truth.value).max() < 1e-5 * size
    node, output, k = np.full(9, 777), np.full(9, 2), np.arange(9)
    f, g, H = model.at(points, node, output)
    assert np.abs(f - truth.value[k, node, output]).max() < 1e-5 * size
    assert np.abs(g.T - truth.first[:, k, node, output]).max() < 1e-4 * np.abs(truth.first).max()
    assert (
        np.abs(np.moveaxis(H, 0, -1) - truth.second[:, :, k, node, output]).max()
        < 1e-3 * np.abs(truth.second).max()
    )


def test_default_method_is_modal_and_meets_the_certified_envelope(certified: Envelope) -> None:
    options = {"duration": 6.0, "step": 0.1, "alpha": (0, 0.5, 1), "tolerance": 5e-6}
    found = envelope(FRAME, INPUTS, **options)  # type: ignore[arg-type]
    assert found.method == "modal"
    assert found.trajectories < 90
    assert (certified.upper - found.upper).max() < 5e-6
    assert (found.lower - certified.lower).max() < 5e-6
    assert (found.upper - certified.upper).max() < 0


def test_certificate_has_the_gap_asked_for_and_contains_sampled_trajectories(
    certified: Envelope,
) -> None:
    assert certified.nature == "guaranteed"
    assert float(certified.facts["gap"]) <= 1e-6
    assert certified.inner_upper is not None
    assert certified.inner_lower is not None
    assert (certified.upper - certified.inner_upper).min() > 0
    assert (certified.upper - certified.inner_upper).max() <= 1.001e-6
    assert (certified.inner_lower - certified.lower).max() <= 1.001e-6
    sampled = envelope(
        FRAME,
        INPUTS,
        duration=6,
        step=0.1,
        alpha=certified.alpha,
        method="quasi-monte-carlo",
        integrator="exact",
        samples=4096,
    )
    assert (sampled.upper <= certified.upper).all()
    assert (sampled.lower >= certified.lower).all()
    assert (sampled.upper - certified.inner_upper).max() <= 1e-6


def test_attained_bounds_belong_to_their_parameters(certified: Envelope) -> None:
    flow = LinearFlow(FRAME, CUTS.names, 6, 0.1, Exact())
    for node, output in ((17, 0), (44, 1), (60, 2)):
        value = flow.values(certified.upper_at[1, node, output][None])[0, node, output]
        assert certified.inner_upper is not None
        assert certified.inner_upper[1, node, output] <= value <= certified.upper[1, node, output]


def test_budget_that_ends_leaves_an_honest_gap() -> None:
    short = envelope(
        FRAME, INPUTS, duration=12, step=0.5, alpha=(0,), method="modal", certify=1e-6, boxes=6
    )
    full = envelope(FRAME, INPUTS, duration=12, step=0.5, alpha=(0,), method="modal", certify=1e-6)
    assert float(short.facts["gap"]) > 1e-4
    assert full.inner_upper is not None
    assert (short.upper >= full.inner_upper).all()


def test_third_derivatives_stay_below_their_bound() -> None:
    model = fit_modes(LinearFlow(FRAME, CUTS.names, 30, 0.05, Exact()), CUTS)
    tensor = Remainder.of(model, -np.ones(4), np.ones(4)).tensor
    node, output, h = np.full(40, 600), np.full(40, 2), 1e-4
    for i in range(4):
        up, down = (
            model.at(0.99 * POINTS + s * h * np.eye(4)[i], node, output)[2] for s in (1, -1)
        )
        third = np.abs(up - down).max(0) / (2 * h)
        assert (third <= tensor[600, 2, i] * (1 + 1e-6)).all()
        assert third.max() > 0.3 * tensor[600, 2, i].max()  # and the bound is not idle


def test_branch_and_bound_finds_what_a_search_missed() -> None:
    model = fit_modes(LinearFlow(FRAME, CUTS.names, 20, 0.5, Exact()), CUTS)
    lower, upper = -np.ones(4), np.ones(4)
    from alphacut.frame.modal.optima import problems

    optima = problems(np.arange(41), 3, 4)
    # starts from the middle only
    optima.value[:] = optima.side * model.value_at(optima.point, optima.node, optima.output)
    found = BranchAndBound(1e-6).run(model, lower, upper, optima)
    bounds = ModalSearch().run(model, lower, upper)[0]
    assert np.abs(found.value - bounds.ravel()).max() < 1e-6


def test_modes_that_do_not_oscillate_are_refused() -> None:
    heavy = replace(FRAME, dampers=(9e5, 9e5, 9e5))
    with pytest.raises(ModalError, match="does not oscillate"):
        envelope(heavy, INPUTS, duration=2, step=0.1, method="modal")
    shaken = replace(FRAME, ground=Accelerogram(0.1, np.array([0.0, 1.0, 0.0])))
    with pytest.raises(ModalError, match="keeps no modes"):
        envelope(shaken, INPUTS, duration=2, step=0.1, method="modal", integrator="midpoint")
    with pytest.raises(ValueError, match="certify: -1"):
        envelope(FRAME, INPUTS, duration=2, step=0.1, method="modal", certify=-1.0)


def test_step_error_is_kept_apart() -> None:
    found = envelope(
        FRAME, INPUTS, duration=30, step=0.01, alpha=(1,), method="modal", integrator="midpoint"
    )
    assert float(found.facts["step_error"]) == pytest.approx(1.5 * 0.51e-3, abs=0.03e-3)
    assert "time stepping" in str(found.facts["dominant_error"])
    assert frame.envelope(FRAME, INPUTS, duration=3, step=0.01, alpha=(1,)).facts["step_error"] == 0


def test_what_one_node_finds_reaches_all_others(monkeypatch) -> None:
    from alphacut.frame.modal import search as modal_search
    from alphacut.frame.modal.optima import problems

    monkeypatch.setattr(modal_search, "refine", lambda *_: None)
    offered: list[int] = []

    class Flat:
        """The same number of one parameter at every node: highest at 0.7."""

        def value_at(self, unit, node, output):
            offered.append(len(unit))
            return -np.abs(unit[:, 0] - 0.7)

    count = 400
    found = problems(np.arange(count), 1, 1)
    found.value[:] = np.where(found.side > 0, -0.7, -1e9)
    found.point[found.side > 0] = 0.0
    first = np.flatnonzero(found.side > 0)[0]
    found.point[first], found.value[first] = 0.7, 0.0
    modal_search.ModalSearch()._follow(
        Flat(), found, count, np.array([-1.0]), np.array([1.0]), np.ones(len(found.value), bool)
    )
    assert (found.point[found.side > 0] == 0.7).all()
    assert sum(offered) < 0.6 * len(offered) * len(found.value)  # only what changed is tried again


def test_wide_boxes_are_searched_with_more_effort() -> None:
    from alphacut.frame.modal.search import ModalSearch

    def effort(share: float) -> tuple[int, int]:
        cuts = boxes(
            {
                name: Triangular((1 - share) * x, x, (1 + share) * x)
                for name, x in (("E", 24.7561e9), ("m1", 20e3))
            },
            (0,),
        )
        suited = ModalSearch.suited(
            fit_modes(
                LinearFlow(FRAME, cuts.names, 30 if share < 0.1 else 120, 0.25, Exact()),
                cuts,
                tolerance=0.05,
            )
        )
        return suited.samples, suited.starts

    assert effort(0.05) == (ModalSearch().samples, ModalSearch().starts)
    assert effort(0.5)[0] >= 2 * effort(0.05)[0]
    assert effort(0.5)[1] > effort(0.05)[1]


def test_what_is_proved_on_a_wide_box_is_taken_up_on_those_inside(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    class Careless(certificate.BranchAndBound):
        """Proves less on narrow boxes, which come first."""

        slack = iter((3e-4, 2e-4, 1e-4))

        def run(self, *arguments: Any, **options: Any) -> Any:
            found = super().run(*arguments, **options)
            return replace(found, proved=found.proved + next(self.slack))

    monkeypatch.setattr(certificate, "BranchAndBound", Careless)
    found = envelope(
        FRAME, INPUTS, duration=3, step=0.1, alpha=(0, 0.001, 0.002), method="modal", certify=2e-3
    )
    assert nesting_violation(found) == 0


def test_at_tolerances_that_no_double_keeps_rounding_is_declared():
    frame = StoreyFrame(
        masses=(1e3, 1e3), modulus=2.5e10, lengths=(3, 3), second_moment=1e-6, v0=(0, 0.5)
    )
    modulus = {"E": Triangular(2.4975e10, 2.5e10, 2.5025e10)}
    options = dict(alpha=(0,), method="modal", tolerance=1e-15)
    found = envelope(frame, modulus, duration=60, step=0.05, **options)
    wide = np.longdouble
    root = (3 + np.array([-1, 1]) * np.sqrt(wide(5))) / 2  # of det(K − λ k M / m), in longer words
    shapes = np.stack([np.ones(2, wide), 2 - root])
    for bound, at in ((found.lower, found.lower_at), (found.upper, found.upper_at)):
        stiffness = 24 * at[0].astype(wide) * wide(1e-6) / 27
        rates = np.sqrt(stiffness / 1000 * root)
        waves = np.sin(rates * found.time[:, None, None]) / rates
        exact = (wide(0.5) * shapes * shapes[1] / (shapes**2).sum(0) * waves).sum(-1)
        assert (np.abs(bound[0] - exact) <= found.error[0]).all()
    assert found.error.max() < 1e-12 * np.abs(found.upper).max()
