"""Fuzzy peaks and probabilities of exceedance."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy.stats

from alphacut.frame import Accelerogram, LagrangianFlow, LinearFlow, StoreyFrame, envelope, pendulum
from alphacut.frame.boxes import boxes
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.exceedance import exceedance, exceedances, peaks, tried_peaks
from alphacut.fuzzy import Interval, Triangular

FRAME = StoreyFrame(
    (9e3, 7e3),
    (2.4, 3.0),
    25e9,
    1e-6,
    (90, 60),
    "storey",
    (0.05, 0.0),
    (0.0, 0.4),
    outputs=("q1", "drift2", "base_shear"),
)
INPUTS = {"E": Triangular(23e9, 25e9, 26e9), "m2": Triangular(6.8e3, 7e3, 7.3e3)}


def test_no_trajectory_peaks_outside_the_fuzzy_peak() -> None:
    found = peaks(envelope(FRAME, INPUTS, duration=5, step=0.02, tolerance=1e-6))
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.uniform(*INPUTS[name].cut(0), 500) for name in INPUTS])
    sampled = np.abs(LinearFlow(FRAME, tuple(INPUTS), 5, 0.02, Exact()).values(points)).max(1)
    assert (sampled <= found.upper[0] * (1 + 1e-5)).all()
    assert (sampled >= found.lower[0] * (1 - 1e-5)).all()
    assert (found.upper[-1] <= found.upper[0]).all()
    assert found.upper[-1] == pytest.approx(found.lower[-1], rel=1e-4)


def test_probability_of_exceedance_is_fuzzy_and_nested() -> None:
    def speed(rng: np.random.Generator, count: int) -> np.ndarray:
        return rng.normal(0.4, 0.1, count)

    found = exceedance(
        FRAME,
        INPUTS,
        {"v2_0": speed},
        limit=0.16,
        duration=4,
        step=0.05,
        alpha=(0, 0.5, 1),
        spread=16,
    )
    assert (np.diff(found.upper) <= 0).all()
    assert (np.diff(found.lower) >= 0).all()
    assert 0.02 < found.upper[-1] < 0.98
    assert found.lower[-1] == found.upper[-1]
    assert found.upper[0] > found.lower[0]
    with pytest.raises(ValueError, match="both fuzzy and random"):
        exceedance(FRAME, INPUTS, {"E": speed}, limit=0.2, duration=4, step=0.05)


def test_the_least_peak_tried_lies_between_the_bounds_and_is_attained() -> None:
    found = envelope(FRAME, INPUTS, duration=5, step=0.02, alpha=(0, 0.5, 1), tolerance=1e-6)
    cuts, flow = boxes(INPUTS, (0, 0.5, 1)), LinearFlow(FRAME, tuple(INPUTS), 5, 0.02, Exact())
    tried, of = tried_peaks(flow, cuts), peaks(found)
    assert (tried >= of.lower * (1 - 1e-5)).all()
    assert (tried <= of.upper * (1 + 1e-5)).all()
    assert (np.diff(tried, axis=0) >= 0).all()
    assert tried[-1] == pytest.approx(of.upper[-1], rel=1e-4)
    points = np.column_stack(
        [np.random.default_rng(1).uniform(*INPUTS[name].cut(0), 3000) for name in INPUTS]
    )
    dense = np.abs(flow.values(points)).max(1).min(0)
    assert (tried[0] <= dense * 1.01).all()
    assert (of.lower[0] < dense).all()


@pytest.mark.parametrize(("limit", "share"), [(1e9, 0), (1e-9, 1)])
def test_few_draws_leave_the_probability_uncertain(limit: float, share: float) -> None:
    def speed(rng: np.random.Generator, count: int) -> np.ndarray:
        return rng.normal(0.4, 0.1, count)

    one, many = (
        exceedance(
            FRAME, INPUTS, {"v2_0": speed}, limit=limit, duration=1, step=0.1, alpha=(0,), samples=n
        )
        for n in (1, 400)
    )
    assert one.lower[0] == one.upper[0] == many.upper[0] == share
    assert one.deviation > 0.2
    assert 0 < many.deviation < 0.01


@pytest.mark.parametrize("certify", [None, 1e-4])
def test_peaks_between_nodes_are_within_the_error(certify: float | None) -> None:
    """A step of 0.1 s misses a peak by a millimetre, which the error covers and does not dwarf."""
    frame = StoreyFrame(
        (2e3, 1e3),
        (2.5, 2.7),
        25e9,
        1e-6,
        (5, 5),
        "ground",
        (0.0, 0.0),
        (0.3, -0.6),
        outputs=("q1", "q2", "v2"),
        ground=Accelerogram(0.017, 0.5 * np.ones(150)),
    )
    inputs = {"E": Interval(24e9, 26e9), "m2": Interval(9.8e2, 1.02e3)}
    options = {} if certify is None else {"method": "modal", "certify": certify}
    found = peaks(envelope(frame, inputs, duration=6, step=0.1, alpha=(0,), **options))
    share = np.random.default_rng(0).random((300, 2))
    share[:4] = [[0, 0], [0, 1], [1, 0], [1, 1]]
    points = np.array([24e9, 9.8e2]) + share * np.array([2e9, 40.0])
    true = np.abs(LinearFlow(frame, tuple(inputs), 6, 0.002, Exact()).values(points)).max((0, 1))
    assert found.error is not None
    excess = true - found.upper[0]
    assert excess[0] > 5e-4
    assert (excess <= found.error[0]).all()
    assert found.error[0, 0] <= (8 if certify is None else 60) * excess[0]


@pytest.mark.parametrize("certify", [None, 1e-3])
def test_the_error_between_nodes_is_that_of_a_peak_in_the_middle(certify: float | None) -> None:
    """The velocity's sine peaks halfway between two nodes."""
    swing = StoreyFrame((1.0,), (1.0,), 1 / 24, 1.0, v0=(1.0,))  # sin t
    options = {} if certify is None else {"method": "modal", "certify": certify}
    step, inputs = np.pi / 5, {"E": Interval(1 / 24, 1.0001 / 24)}
    found = peaks(envelope(swing, inputs, duration=5 * step, step=step, alpha=(0,), **options))
    assert found.error is not None
    assert 1 <= found.error[0, 0] / (1 - found.upper[0, 0]) <= 1.8


def test_an_exceedance_counts_peaks_between_nodes() -> None:
    """The limit lies between the peak at the nodes and the true one."""
    swing = StoreyFrame((1.0,), (1.0,), 1 / 24, 1.0, v0=(1.0,))  # sin t
    inputs = {"E": Interval(1 / 24, 1.0001 / 24)}
    exceeded = exceedance(swing, inputs, {}, limit=0.998, duration=2.8, step=0.7, alpha=(0,))
    assert exceeded.upper[0] == 0
    assert exceeded.error[0] == 1
    below = exceedance(swing, inputs, {}, limit=1.5, duration=2.8, step=0.7, alpha=(0,))
    assert below.error[0] == 0


def asked(random: Any, **changed: Any) -> Any:
    given = {"limit": 0.2, "duration": 1, "step": 0.1, "alpha": (0,), "spread": 2, "samples": 4}
    return exceedance(FRAME, INPUTS, random, **{**given, **changed})


@pytest.mark.parametrize(
    ("random", "changed", "told"),
    [
        ({}, {"output": "q9"}, "there is no output 'q9'; known are q1, drift2, base_shear"),
        ({}, {"output": 3}, "there is no output '3'; known are q1"),
        ({}, {"output": [1]}, "there is no output"),
        ({}, {"samples": "5"}, "samples: '5' is not allowed; it must be a whole number, 1 or"),
        (scipy.stats.norm(100, 8), {}, "random is <.*; it must map names to samplers or laws, as"),
        ({"m1": 100.0}, {}, r"random 'm1' is 100.0; .* such as scipy.stats.norm\(100, 8\)"),
        (
            {"m1": scipy.stats.norm},
            {},
            "'m1' is <.*; it must be a function of a generator and a count",
        ),
        (
            {"m1": lambda count: [1.0]},
            {},
            "'m1' is <.*; it must be a function of a generator and a count",
        ),
        (
            {"m1": lambda rng, count: ["a"] * count},
            {},
            "random 'm1' is <.*could not convert string to float",
        ),
        ({"m1": lambda rng, count: np.ones((count, 1))}, {}, r"of shape \(4, 1\); .* 4 finite num"),
        ({"m1": lambda rng, count: np.full(count, np.nan)}, {}, "must be 4 finite numbers"),
        ({"m1": scipy.stats.norm(0, 1)}, {}, "mass: the matrix is not positive definite at E"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_a_line(random: Any, changed: Any, told: str) -> None:
    with pytest.raises(ValueError, match=told) as refused:
        asked(random, **changed)
    assert "\n" not in str(refused.value)


def test_distributions_and_names_of_outputs_are_taken() -> None:
    frozen = asked({"v2_0": scipy.stats.norm(0.4, 0.1)}, output="drift2")
    drawn = asked({"v2_0": lambda rng, count: rng.normal(0.4, 0.1, count)}, output=1)
    assert (frozen.curve_upper == drawn.curve_upper).all()


def test_draws_with_which_motions_may_grow_are_warned_of() -> None:
    with pytest.warns(UserWarning, match="stiffness: the matrix has the negative eigenvalue"):
        exceedance(
            StoreyFrame((1.0,), stiffness=(9.0,), q0=(0.1,)),
            {"m1": Interval(1, 2)},
            {"k1": lambda rng, count: np.linspace(-1, 9, count)},
            **{"limit": 1, "duration": 1, "step": 0.1, "alpha": (0,), "samples": 3},
        )


def test_peaks_show_themselves_in_lines_with_units_and_errors() -> None:
    found = peaks(envelope(FRAME, INPUTS, duration=1, step=0.1, alpha=(0, 1)))
    first, *lines = repr(found).splitlines()
    assert first == "fuzzy peaks on 2 levels"
    assert lines[1].startswith(
        f"  drift2: {found.lower[0, 1]:.6g} … {found.upper[0, 1]:.6g} m at α"
    )
    assert found.error is not None
    assert lines[1].endswith(f", error {found.error[0, 1]:.2g} m")
    assert len(lines) == 3
    assert repr(replace(found, error=None, outputs=())).endswith(" at α = 0, error not estimated")


def test_probabilities_show_themselves_in_a_line_for_each_level() -> None:
    random = {"v2_0": scipy.stats.norm(0.4, 0.05)}
    found = exceedance(FRAME, INPUTS, random, limit=0.1, duration=1, step=0.1, alpha=(0, 1))
    lines = str(found).splitlines()
    assert [line.split(":")[0].strip() for line in lines[1:]] == ["α = 0", "α = 1"]
    assert f"{found.lower[0]:.4g} … {found.upper[0]:.4g}, " in lines[1]
    assert f"with peaks between {found.limits[0]:.4g} and {found.limits[-1]:.4g}" in lines[0]
    assert "<td>1</td>" in found._repr_html_()


def test_a_random_mass_in_tonnes_is_refused() -> None:
    random = {"m1": scipy.stats.norm(9, 0.5)}
    with pytest.raises(ValueError, match=r"m1: its support .* of another size than .* own value"):
        exceedance(FRAME, {"E": INPUTS["E"]}, random, limit=0.1, duration=1, step=0.1)


@pytest.mark.parametrize("scheme", ["midpoint", "composition4"])
def test_the_probability_of_a_pendulum_holds_the_error_of_time_stepping(scheme: str) -> None:
    """Twenty steps a period: the peaks of the scheme alone are passed too often or too seldom."""
    system = pendulum(length=0.7228, damping=0.014, phi0=2.15, omega0=0.0)
    step, random = 0.0853, {"phi_0": scipy.stats.norm(2.15, 0.02)}
    draws = scipy.stats.norm(2.15, 0.02).rvs(400, random_state=3)
    fine = LagrangianFlow(system, ("phi_0",), 49 * step, step / 16, "composition4")
    force = np.abs(fine.values(draws[:, None])[:, ::16, 0]).max(1)
    limit = float(np.median(force))
    found = exceedances(
        system,
        {"m": Interval(0.9999, 1.0001)},
        random,
        limits={"force": limit},
        duration=49 * step,
        step=step,
        alpha=(1,),
        samples=400,
        spread=1,
        integrator=scheme,
    )["force"]
    assert found.lower[0] - 3 * found.deviation <= 0.5 <= found.upper[0] + 3 * found.deviation
    if scheme == "composition4":
        assert found.upper[0] - found.lower[0] < 0.5
