"""Declared errors against true ones: each estimate and each proof has a case where it is tight."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import Exact, LinearFlow, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.certificate.model_error import proved_error
from alphacut.frame.certificate.numpy_kernel import Items
from alphacut.frame.certificate.remainder import Remainder
from alphacut.frame.methods import auto
from alphacut.frame.methods.auto import Auto, ToleranceError
from alphacut.frame.methods.modal import Modal
from alphacut.frame.modal.exact_response import ExactResponse
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.modal.newton import refine
from alphacut.frame.modal.optima import problems
from alphacut.frame.modal.polynomial_error import polynomial_error
from alphacut.fuzzy import Interval
from benchmarks.frame.calibration import judged, random_case

ONE = StoreyFrame((1e4,), (3.0,), 25e9, 1e-6, q0=(0.01,))
TWO = StoreyFrame((2e4, 1e4), (3.0, 3.0), 25e9, 1e-6, q0=(0.0, 0.01))
TIGHT = 1.8
"""Declared over true error, at most, where an estimate is meant to be tight."""


def undamped(share: float, duration: float, step: float) -> ModalModel:
    cuts = boxes({"E": Interval((1 - share) * 25e9, (1 + share) * 25e9)}, (0,))
    return fit_modes(LinearFlow(ONE, cuts.names, duration, step, Exact()), cuts, tolerance=1e-12)


def test_remainder_of_a_box_is_needed_in_full() -> None:
    model, r = undamped(0.01, 60, 0.1), 0.1
    nodes = np.arange(1, len(model.time))
    output, centre = np.zeros_like(nodes), np.zeros((len(nodes), 1))
    bounds = Remainder.of(model, np.array([-r]), np.array([r]))
    f, g, H = model.at(centre, nodes, output)
    own = np.full((len(nodes), 1), r), bounds.tensor[nodes, 0], bounds.margin[nodes, 0]
    rest = Items(f, g, H, *own, nodes).rest
    true = np.max(
        [
            np.abs(
                model.value_at(centre + x, nodes, output) - f - g[:, 0] * x - H[:, 0, 0] * x**2 / 2
            )
            for x in np.linspace(-r, r, 41)
        ],
        0,
    )
    assert (rest >= true).all()
    assert (rest[-100:] / true[-100:]).min() < TIGHT


def test_proved_deviation_is_needed_in_full() -> None:
    exact = undamped(1e-4, 20, 0.1)
    off = exact.eigenvalue.coefficients.copy()
    off[0] += 1e-5j  # a frequency that is wrong by 1e-5 rad/s
    model = replace(exact, eigenvalue=Polynomial(exact.eigenvalue.index, off))
    points = np.linspace(-1, 1, 21)[:, None]
    wrong = np.abs(model.values(points) - exact.flow.values(exact.boxes.to_physical(points))).max(0)
    proved = proved_error(model)
    assert (proved >= wrong).all()
    assert proved[-30:].max() < TIGHT * wrong[-30:].max()


def test_error_of_the_polynomials_covers_dense_trajectories_and_is_near() -> None:
    cuts = boxes({"E": Interval(20e9, 30e9)}, (0,))
    flow = LinearFlow(TWO, cuts.names, 20, 0.05, Exact())
    model = fit_modes(flow, cuts, tolerance=1e-5)
    points = np.linspace(-1, 1, 401)[:, None]
    wrong = np.abs(model.values(points) - flow.values(cuts.to_physical(points))).max(0)
    declared = polynomial_error(model)
    assert (declared >= wrong).all()
    assert declared.max() < 2.5 * wrong.max()  # the factor of two on held-out trajectories


def test_error_of_polynomials_in_three_inputs_is_needed_in_full() -> None:
    shares = {name: 0.05 * TWO.parameters[name] for name in ("E", "m1", "m2")}
    middle = TWO.parameters
    cuts = boxes({n: Interval(middle[n] - s, middle[n] + s) for n, s in shares.items()}, (0,))
    flow = LinearFlow(TWO, cuts.names, 10, 0.1, Exact())
    model = fit_modes(flow, cuts, tolerance=1e-6)
    points = np.random.default_rng(1).uniform(-1, 1, (1500, 3))
    points = np.where(np.random.default_rng(2).random(points.shape) < 0.5, np.sign(points), points)
    wrong = np.abs(model.values(points) - flow.values(cuts.to_physical(points))).max(0)
    declared = polynomial_error(model)
    assert (declared >= wrong).all()
    assert declared.max() < TIGHT * wrong.max()


def test_auto_returns_nothing_above_its_tolerance(monkeypatch: pytest.MonkeyPatch) -> None:
    cuts = boxes({"E": Interval(24e9, 26e9)}, (0,))
    flow = UnitFlow(LinearFlow(TWO, cuts.names, 5, 0.1, Exact()), cuts)
    made = Modal(tolerance=1e-6).run(flow)
    known = replace(made, error=np.full_like(made.lower, 1e-4))
    monkeypatch.setattr(Modal, "run", lambda *_: known)
    monkeypatch.setattr(auto, "_proved", lambda *_: (None, "not tried"))
    alone = ("improved-graph-follower",)
    found = Auto(tolerance=1.01e-4, exclude=alone).run(flow)
    assert found.error is not None
    assert found.error.max() == 1e-4
    with pytest.raises(ToleranceError, match="modal estimates"):
        Auto(tolerance=0.99e-4, exclude=alone).run(flow)


def test_midpoint_rule_is_part_of_the_declared_error() -> None:
    inputs = {"E": Interval(24e9, 26e9)}
    common = {"duration": 5.0, "step": 0.05, "alpha": (0,)}
    found = envelope(TWO, inputs, method="graph-follower", **common)  # type: ignore[arg-type]
    exact = LinearFlow(TWO, ("E",), 5.0, 0.05, Exact()).values(
        np.linspace(24e9, 26e9, 999)[:, None]
    )
    wrong = np.maximum(np.abs(exact.max(0) - found.upper[0]), np.abs(exact.min(0) - found.lower[0]))
    assert found.error is not None
    assert (found.error[0] >= wrong - 1e-8).all()
    assert found.error.max() < TIGHT * wrong.max()
    with pytest.raises(ToleranceError, match="time stepping"):
        envelope(TWO, inputs, integrator="midpoint", tolerance=1e-6, **common)  # type: ignore[arg-type]


@pytest.mark.parametrize("seed", [pytest.param(61006, marks=pytest.mark.slow), 61032])
def test_optima_beside_jumps_are_found_where_polynomials_lead_little(seed: int) -> None:
    row = judged(
        random_case(seed), method="auto", tolerance=1e-3, samples=2000, starts=6, seed=61001
    )
    assert row["method"] == "modal"
    assert row["error"] <= 1e-3
    assert row["above_declared"] == 0


def test_newton_learns_curvature_from_gradients() -> None:
    inputs = {name: TWO.parameters[name] for name in ("E", "m1", "m2")}
    cuts = boxes({n: Interval(0.9 * x, 1.1 * x) for n, x in inputs.items()}, (0,))
    flow = LinearFlow(TWO, cuts.names, 10, 0.1, Exact())
    model, ends = fit_modes(flow, cuts, tolerance=1e-3), np.ones(3)
    found = {}
    for bent in (True, False):
        exact = ExactResponse.of(model, np.ones(2), bent=bent)
        optima = problems(np.arange(20, 100, 10), 2, 3)
        every = np.arange(len(optima.value))
        optima.offer(exact, np.full((len(every), 3), 0.1), every)
        refine(exact, optima, every, -ends, ends, 1e-9)
        assert optima.left.max() <= 1e-9
        slope = optima.side[:, None] * exact.at(optima.point, optima.node, optima.output)[1]
        free = np.abs(optima.point) < 1 - 1e-9
        assert np.abs(np.where(free, slope, np.minimum(slope * np.sign(optima.point), 0))).max() < (
            1e-4
        )
        found[bent] = optima.value
    assert np.median(np.abs(found[True] - found[False])) < 1e-8


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2000, 2012))
def test_declared_errors_cover_random_frames(seed: int) -> None:
    row = judged(
        random_case(seed), method="auto", tolerance=1e-3, samples=1000, starts=2, seed=seed
    )
    assert row["error"] <= 1e-3
    assert row["above_declared"] == 0
