"""Ingredients of a proof on cases where they nearly are the truth: halved, none would cover it."""

from __future__ import annotations

import numpy as np
import pytest

from alphacut.frame import Accelerogram, Exact, LinearFlow, StoreyFrame
from alphacut.frame.boxes import boxes
from alphacut.frame.certificate.branch_and_bound import BranchAndBound
from alphacut.frame.certificate.certificate import certify
from alphacut.frame.certificate.remainder import Remainder, largest_growth
from alphacut.frame.certificate.wave_bounds import parts
from alphacut.frame.dynamics.spectral import responses
from alphacut.frame.modal.model import ModalModel, fit_modes
from alphacut.frame.modal.search import Optima
from alphacut.fuzzy import Interval

PULSE = Accelerogram(0.37, np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]))


def spring(omega: float, ground: Accelerogram | None, duration: float, step: float) -> ModalModel:
    """An undamped mass whose frequency is uncertain by 5 %."""
    frame = StoreyFrame((1.0,), (1.0,), omega**2 / 24, 1.0, q0=(1.0,), ground=ground)
    inputs = {"E": Interval(0.9 * omega**2 / 24, 1.1 * omega**2 / 24)}
    flow = LinearFlow(frame, ("E",), duration, step, Exact())
    return fit_modes(flow, boxes(inputs, (0,)), tolerance=1e-9)


def test_remainder_of_the_quadratic_model_is_that_of_a_late_oscillation() -> None:
    model = spring(1.0, None, 400.0, 1.0)
    bound = Remainder.of(model, -np.ones(1), np.ones(1)).tensor[:, 0, 0, 0, 0]
    unit, h = np.linspace(-0.99, 0.99, 400)[:, None], 1e-4
    for node in (100, 200, 400):
        at = np.full(len(unit), node), np.zeros(len(unit), int)
        third = (model.at(unit + h, *at)[2] - model.at(unit - h, *at)[2])[:, 0, 0] / (2 * h)
        assert 1 <= bound[node] / np.abs(third).max() <= 1.8


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_bounds_of_waves_are_reached_by_a_pulse_on_a_soft_spring(order: int) -> None:
    """Short of a turn all of the pulse adds up: R and its derivatives by λ are ∫ τ^r a."""
    model = spring(1e-2, PULSE, 4.0, 0.1)
    growth = largest_growth(model.eigenvalue, np.ones(1))
    free, forced = parts(model, growth)
    rate = model.eigenvalue(np.zeros((1, 1)))
    time = model.time
    if order < 3:
        truth = responses(rate, PULSE, 0.1, 40, derivatives=True)[order][0, :, 0]
        ratio = forced.waves[order][5:, 0] / np.abs(truth)[5:]
        assert (ratio >= 1).all()
        assert (ratio <= 1.8).all()
    assert free.waves[order][:, 0] == pytest.approx(time**order)
    assert forced.push[-1] == pytest.approx(1.85)  # ∫ |a| of the pulse, cut at 1.85 s
    elapsed = np.cumsum(np.abs(responses(rate, PULSE, 0.1, 40)[0][0, :, 0])) * 0.1
    assert (forced.elapsed[5:, 0] >= 0.93 * elapsed[5:]).all()
    assert (forced.elapsed[5:, 0] <= 1.8 * elapsed[5:]).all()


def test_what_outputs_do_between_nodes_is_bounded_where_the_record_jumps() -> None:
    """The velocity's kink at the end of the pulse lies halfway between two nodes."""
    frame = StoreyFrame((1.0,), (1.0,), 1e-6 / 24, 1.0, outputs=("v1",), ground=PULSE)
    flow = LinearFlow(frame, ("E",), 3.7 * 20 / 20, 3.7, Exact())
    model = fit_modes(flow, boxes({"E": Interval(0.9e-6 / 24, 1e-6 / 24)}, (0,)), tolerance=1e-9)
    values = model.values(np.zeros((1, 1)))[0]
    bounds = np.stack([-values, values], -1)[None]
    at = np.zeros((*bounds.shape, 1))
    proof = certify(model, bounds, at, gap=1e-2, model_error=np.zeros(values.shape))
    fine = LinearFlow(frame, ("E",), 3.7, 3.7 / 200, Exact()).values(np.array([[1e-6 / 24]]))[0]
    line = np.linspace(fine[0], fine[-1], len(fine))
    assert 1 <= proof.between[1, 0] / np.abs(fine - line).max() <= 1.8


class Cube:
    """The function x³, whose third derivative is 6."""

    def at(self, unit: np.ndarray, *_: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return unit[:, 0] ** 3, 3 * unit**2, 6 * unit[:, :, None]


@pytest.mark.parametrize(("start", "budget"), [(0.5, 4000), (0.0, 1)])
def test_branch_and_bound_needs_all_of_the_remainder(
    start: float, budget: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """About 0 nothing but the third derivative tells that x³ reaches 1."""
    tensor = np.full((1, 1, 1, 1, 1), 6.0)
    monkeypatch.setattr(Remainder, "of", lambda *_: Remainder(tensor))
    none, best = np.zeros(1, int), np.full((1, 1), start)
    optima = Optima(none, none, np.ones(1), best, best[0] ** 3, np.zeros(1))
    found = BranchAndBound(1e-3, budget).run(Cube(), -np.ones(1), np.ones(1), optima)  # type: ignore[arg-type]
    assert 1 <= found.proved[0] <= 1.01
