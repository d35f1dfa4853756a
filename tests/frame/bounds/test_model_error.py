"""The proved error of modal models: never below the true one, wherever that is sampled, and near
enough to be of use.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid, solve_ivp
from scipy.linalg import eigh
from scipy.sparse.linalg import expm_multiply

from alphacut.frame import (
    Accelerogram,
    Exact,
    LinearFlow,
    MatrixStructure,
    Midpoint,
    StoreyFrame,
)
from alphacut.frame.bounds import model_error
from alphacut.frame.bounds.model_error import proved_error
from alphacut.frame.bounds.ratio_damping import LoewnerBounds, RatioDamping
from alphacut.frame.bounds.remainder import largest_growth, parts
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.polynomial import Polynomial
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modal.fitting import fit_modes
from alphacut.frame.modal.ground_response import left_out
from alphacut.frame.modal.model import ModalModel
from alphacut.frame.response.duhamel import responses_at_nodes
from alphacut.frame.structures.linear import evaluate
from alphacut.frame.structures.modes import ModalError
from alphacut.frame.structures.polynomial_dependence import degrees, inverse_cube_degree
from alphacut.fuzzy import Interval, Triangular

FRAME = StoreyFrame(
    (20e3, 15e3, 10e3),
    (4.0, 3.5, 3.0),
    25e9,
    1e-4,
    (9e3, 5e3, 0.0),
    q0=(0.1, 0.2, 0.25),
    v0=(0.0, 0.5, 0.0),
    outputs=("q3", "v1", "drift2"),
)
SHEAR = replace(
    FRAME, outputs=("base_shear",), rayleigh=(0.02, 1e-4), dampers=(), damper_placement="storey"
)
SHAKEN = replace(
    FRAME, ground=Accelerogram(0.05, 3 * np.random.default_rng(8).standard_normal(120))
)
CHAIN = MatrixStructure(
    {"m": 2.0, "k": 80.0, "d": 0.3},
    mass=[("m", np.eye(2))],
    stiffness=[("k", np.array([[2.0, -1.0], [-1.0, 1.0]])), (3.0, np.eye(2))],
    observed={"tip": np.array([0.0, 1.0])},
    damping=[("d", np.diag([1.0, 0.0]))],
    q0=np.array([0.0, 0.1]),
)


def model(system, inputs, tolerance=1e-4, **changes) -> ModalModel:
    flow = LinearFlow(system, tuple(inputs), 10.0, 0.1, Exact())
    return fit_modes(replace(flow, **changes), boxes(inputs, (0,)), tolerance=tolerance)


@pytest.mark.parametrize(
    ("system", "inputs"),
    [
        (
            FRAME,
            {
                "E": Triangular(23e9, 25e9, 26e9),
                "m1": Interval(19e3, 21e3),
                "m3": Interval(9e3, 11e3),
            },
        ),
        (FRAME, {"l1": Interval(3.9, 4.1), "d1": Interval(7e3, 11e3), "q3_0": Interval(0.2, 0.3)}),
        (
            SHEAR,
            {
                "E": Interval(24e9, 26e9),
                "rayleigh_mass": Interval(0.01, 0.03),
                "rayleigh_stiffness": Interval(0.0, 2e-4),
            },
        ),
        (
            SHAKEN,
            {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3), "d1": Interval(7e3, 11e3)},
        ),
        (CHAIN, {"m": Interval(1.9, 2.1), "k": Interval(75, 85), "d": Interval(0.0, 0.6)}),
        (
            replace(SHAKEN, dampers=(), damping_ratio=0.03),
            {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3), "zeta": Interval(0.02, 0.05)},
        ),
        (
            replace(CHAIN, damping=[], ratios=(0.1,)),
            {"m": Interval(1.9, 2.1), "k": Interval(75, 85), "d": Interval(0.0, 0.6)},
        ),
    ],
)
@pytest.mark.parametrize("tolerance", [1e-2, 1e-5])
def test_no_sampled_trajectory_deviates_by_more_than_the_proved_error(
    system, inputs, tolerance
) -> None:
    scale = 1e5 if system is SHEAR else 1.0  # N beside m
    found = model(system, inputs, scale * tolerance)
    unit = np.vstack(
        [
            np.random.default_rng(3).uniform(-1, 1, (300, 3)),
            np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T,
        ]
    )
    truth = UnitFlow(found.flow, found.boxes).values(unit)
    deviation, proved = np.abs(found.values(unit) - truth).max(0), proved_error(found)
    assert (deviation <= proved + 1e-12 * np.abs(truth).max()).all()
    assert proved.max() < 1000 * deviation.max()


@pytest.mark.parametrize(("squared", "root"), [(1.02, 1.02), (1.0, 1.03)])
def test_what_a_damping_ratio_leaves_out_is_bounded_tightly(squared, root) -> None:
    """For the lowest mode both bounds are what a wrong frequency does to the damping."""
    damped = replace(FRAME, damping_ratio=0.07, dampers=())
    found = model(damped, {"E": Interval(24.9e9, 25.1e9)})
    matrices, _ = evaluate(damped, ("E",), np.array([[25e9]]), derivatives=False)
    M, D, K = (part.value for part in (matrices.mass, matrices.damping, matrices.stiffness))
    mu, shapes = eigh(K[0], M[0])
    one = np.zeros((1, 1), int)
    law = RatioDamping(
        0.07,
        0.07,
        found,
        Polynomial(one, np.array([[squared * mu[0]]])),
        Polynomial(one, np.array([[(root * mu[0]) ** 0.5]])),
    )
    speed = shapes[None, None, :, 0]
    force, own = law.defects(np.zeros((1, 1)), np.zeros((1, 1)), speed, M, K)
    missed = speed[0, 0] @ D[0] - force[0, 0]
    true = float(np.sqrt(missed @ np.linalg.solve(M[0], missed)))
    bound = law.damping_error(own, 0, LoewnerBounds(K), LoewnerBounds(M))
    assert 1 - 1e-9 <= bound / true <= 1.8


def stretched(polynomial: Polynomial) -> Polynomial:
    """The same with its constant and its first slope a thousandth too large."""
    coefficients = polynomial.coefficients.copy()
    coefficients[1] *= 1.001
    coefficients[0] *= 1.001
    return Polynomial(polynomial.index, coefficients)


@pytest.mark.parametrize("wrong", ["eigenvalue", "coefficient", "load"])
def test_a_model_that_is_wrong_is_proved_to_be_no_better(wrong) -> None:
    system = SHAKEN if wrong == "load" else FRAME
    good = model(system, {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3)}, 1e-7)
    if wrong == "load":
        (load,) = good.loads
        bad = replace(good, loads=(replace(load, share=stretched(load.share)),))
    else:
        bad = replace(good, **{wrong: stretched(getattr(good, wrong))})
    unit = np.array([[-1.0, 0.3], [1.0, -0.2], [0.9, 1.0]])
    deviation = np.abs(bad.values(unit) - UnitFlow(bad.flow, bad.boxes).values(unit)).max(0)
    assert deviation.max() > 1e-5 > proved_error(good).max()
    assert (deviation <= proved_error(bad) + 1e-12).all()


def test_what_is_not_known_is_not_proved() -> None:
    inputs = {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3)}
    with pytest.raises(ModalError, match="midpoint"):
        proved_error(model(FRAME, inputs, integrator=Midpoint()))
    with pytest.raises(UnprovedError, match="positive definite"):
        proved_error(
            model(
                FRAME,
                {"l1": Interval(3.0, 5.0), "l2": Interval(2.5, 4.5), "l3": Interval(2.0, 4.0)},
                0.1,
            )
        )


def test_structures_that_may_gain_energy_or_are_no_polynomials_are_refused() -> None:
    box = {"m": (1.9, 2.1)}
    with pytest.raises(UnprovedError, match="function"):
        degrees(replace(CHAIN, mass=[(lambda p: p["m"] ** 2, np.eye(2))]), box)
    with pytest.raises(UnprovedError, match="feed energy"):
        degrees(replace(CHAIN, damping=[("d", np.array([[0.0, 1.0], [1.0, 0.0]]))]), box)
    with pytest.raises(UnprovedError, match="feed energy"):
        degrees(CHAIN, {"d": (-0.1, 0.1)})
    with pytest.raises(UnprovedError, match="is known to be 0 or greater and below 1"):
        degrees(replace(CHAIN, ratios=("d",)), {"d": (-0.1, 0.1)})
    with pytest.raises(UnprovedError, match="is known to be 0 or greater and below 1"):
        degrees(replace(FRAME, damping_ratio=0.05), {"zeta": (-0.01, 0.06)})
    with pytest.raises(UnprovedError, match="nothing is known"):
        degrees(object(), box)  # type: ignore[arg-type]


@pytest.mark.parametrize(("lower", "upper"), [(3.96, 4.04), (3.0, 5.0), (1.0, 4.0)])
def test_degree_of_the_inverse_cube_reaches_round_off_and_not_far_beyond(lower, upper) -> None:
    degree = inverse_cube_degree(lower, upper)
    coefficients = np.polynomial.chebyshev.chebinterpolate(
        lambda u: ((upper + lower) / 2 + (upper - lower) / 2 * u) ** -3.0, 2 * degree + 8
    )
    size = np.abs(coefficients) / np.abs(coefficients).max()
    assert size[degree + 1 :].max() < 1e-13
    assert size[: degree // 2 + 1].min() > 1e-14


def test_comparison_holds_over_the_box() -> None:
    rng = np.random.default_rng(5)
    mean, part = np.diag([2.0, 3.0, 4.0]), rng.uniform(-0.3, 0.3, (2, 3, 3))
    coefficients = np.stack([mean, *(part + part.swapaxes(-1, -2)) / 2])
    found = LoewnerBounds(coefficients)
    x = rng.standard_normal((5, 3))
    for u, v in rng.uniform(-1, 1, (200, 2)):
        A = coefficients[0] + u * coefficients[1] + v * coefficients[2]
        assert (
            np.linalg.eigvalsh(A - found.lowest * mean).min()
            > 0
            > np.linalg.eigvalsh(A - found.highest * mean).max()
        )
        assert all(
            np.sqrt(y @ A @ y) <= found.sup(y[None])
            and np.sqrt(y @ np.linalg.solve(A, y)) <= found.sup_dual(y[None])
            for y in x
        )


def test_waves_and_their_derivatives_stay_below_their_bounds() -> None:
    found = model(SHAKEN, {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3)})
    growth = largest_growth(found.eigenvalue, np.ones(2))
    forced = parts(found, growth)[1]
    unit = np.random.default_rng(6).uniform(-1, 1, (40, 2))
    rate = found.eigenvalue(unit)
    nodes = np.arange(len(found.time))
    waves = found.loads[0].response(np.repeat(rate, len(nodes), 0), np.tile(nodes, len(rate)))
    for order, wave in enumerate(waves):
        size = np.abs(wave).reshape(len(rate), len(nodes), -1).max(0)
        assert (size <= forced.waves[order] * (1 + 1e-9) + 1e-15).all()
        assert size.max() > 0.05 * forced.waves[order].max()  # and the bounds are not idle
    (truth,), _ = responses_at_nodes(rate.ravel(), SHAKEN.ground, found.time, 0)
    truth = truth.reshape(len(nodes), *rate.shape)
    walked = cumulative_trapezoid(np.abs(truth), dx=found.flow.step, axis=0, initial=0)
    assert (walked.max(1) <= 1.02 * forced.elapsed + 1e-12).all()


@pytest.mark.parametrize(("phase", "order"), [(0.01, 4), (1.0, 8), (6.0, 20), (6.0, 35)])
def test_remainder_of_the_exponential_series_is_bounded(phase, order) -> None:
    x = phase * np.exp(1j * np.linspace(0, 2 * np.pi, 25))
    terms = (
        np.cumprod(
            np.concatenate([np.ones((1, 25)), x / np.arange(order, order + 40)[:, None]]), axis=0
        ).sum(0)
        * x**order
    )
    remainder = np.abs(terms).max() / np.prod(np.arange(1.0, order + 1))
    assert remainder <= left_out(phase, order) < 1e7 * remainder


def test_series_leave_out_of_the_load_response_no_more_than_they_say() -> None:
    found = model(SHAKEN, {"E": Interval(20e9, 30e9)})
    (load,) = found.loads
    unit = np.linspace(-1, 1, 21)[:, None]
    rate = found.eigenvalue(unit)
    (truth,), _ = responses_at_nodes(rate.ravel(), SHAKEN.ground, found.time, 0)
    truth = truth.reshape(len(found.time), *rate.shape)
    assert load.truncation.max() > 0
    bound = load.truncation * parts(found, largest_growth(found.eigenvalue, np.ones(1)))[1].waves[0]
    for node in (20, 60, 100):
        got = load.response(rate, np.full(len(unit), node))[0]
        assert (np.abs(got - truth[node]) <= bound[node] + 1e-13).all()


@pytest.mark.parametrize("kind", ["kinematic", "dynamic"])
def test_each_of_the_two_defects_counts(kind, monkeypatch) -> None:
    """A defect 2 Re d exp(λ t) in one of the two equations alone deviates as the integrated
    equations say, and not beyond the bound.
    """
    found = model(FRAME, {"E": Interval(24.9e9, 25.1e9)}, 1e-7)
    unit = np.zeros((1, 1))
    matrices, rows = evaluate(
        found.flow.system, found.flow.names, found.boxes.to_physical(unit), derivatives=False
    )
    M, D, K = (part.value[0] for part in (matrices.mass, matrices.damping, matrices.stiffness))
    strange = np.array([1e-6, -2e-6, 1e-6]) * (1.0 if kind == "kinematic" else 1e3)
    true = model_error._defects

    def only(*args):
        defects = {name: np.zeros_like(values) for name, values in true(*args).items()}
        defects[kind][:, 1] = strange
        return defects

    monkeypatch.setattr(model_error, "_defects", only)
    bound = proved_error(found)
    rate = found.eigenvalue(unit)[0, 1]
    inverse, zero = np.linalg.inv(M), np.zeros(3)
    pushed = np.concatenate((strange, zero) if kind == "kinematic" else (zero, inverse @ strange))
    matrix = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ K, -inverse @ D]])
    moved = solve_ivp(
        lambda t, x: matrix @ x + 2 * (pushed * np.exp(rate * t)).real,
        (0, 10),
        np.zeros(6),
        t_eval=found.time,
        rtol=1e-8,
        atol=1e-14,
    )
    deviation = np.abs(moved.y.T @ rows.value[0].T)
    assert (deviation <= bound + 1e-15).all()
    assert deviation.max() > bound.max() / 50


def test_half_of_a_defect_would_not_do(monkeypatch) -> None:
    """Early in a slow swing, 2 Re d exp(λ t) moves a mass by 2 d t, and no less than that."""
    frame = StoreyFrame((1.0,), stiffness=(1.0,), q0=(1.0,))
    flow = LinearFlow(frame, ("k1",), 1.0, 0.05, Exact())
    found = fit_modes(flow, boxes({"k1": Interval(0.999, 1.001)}, (0,)), tolerance=1e-6)
    true = model_error._defects

    def only(*args):
        defects = {name: np.zeros_like(values) for name, values in true(*args).items()}
        return defects | {"kinematic": defects["kinematic"] + 1e-3}

    monkeypatch.setattr(model_error, "_defects", only)
    bound, time = proved_error(found)[1:, 0], found.time[1:]
    moved = 1e-3 * (time * np.cos(time) + np.sin(time))  # q̈ + q = −2e-3 sin t, q̇(0) = 2e-3
    assert (moved <= bound).all()
    assert (bound[:6] <= 1.1 * moved[:6]).all()


@pytest.mark.parametrize(("kind", "most"), [("start_q", 1.8), ("start_v", 2.5)])
def test_a_wrong_start_counts_by_its_energy(kind, most, monkeypatch) -> None:
    """A start that is off by what moves the last storey most moves on freely, within the bound."""
    found = model(FRAME, {"E": Interval(24.9e9, 25.1e9)}, 1e-7)
    physical, true = found.boxes.to_physical(np.zeros((1, 1))), model_error._defects
    matrices, rows = evaluate(found.flow.system, found.flow.names, physical, derivatives=False)
    M, D, K = (part.value[0] for part in (matrices.mass, matrices.damping, matrices.stiffness))
    strange, zero, inverse = np.linalg.inv(K)[:, 2], np.zeros(3), np.linalg.inv(M)

    def only(*args):
        defects = {name: np.zeros_like(values) for name, values in true(*args).items()}
        return defects | {kind: np.zeros_like(defects[kind]) + strange}

    monkeypatch.setattr(model_error, "_defects", only)
    bound = proved_error(found)
    moved = expm_multiply(
        np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ K, -inverse @ D]]),
        np.concatenate([strange, zero] if kind == "start_q" else [zero, strange]),
        *(0.0, found.time[-1], len(found.time)),
    )
    deviation = np.abs(moved @ rows.value[0].T)
    assert (deviation <= bound * (1 + 1e-6)).all()
    assert deviation.max() > bound.max() / most


def test_a_grid_with_too_many_points_is_refused(monkeypatch) -> None:
    inputs = {"E": Interval(24e9, 26e9), "m1": Interval(19e3, 21e3), "zeta": Interval(0.02, 0.04)}
    frame = replace(SHAKEN, dampers=(), damping_ratio=0.03, outputs=("q3", "drift2"))
    monkeypatch.setattr(model_error, "MOST_NUMBERS", 1000)
    message = r"points of 3 fuzzy inputs, and \d+ are affordable; fewer outputs at once, narrower"
    with pytest.raises(UnprovedError, match=message):
        proved_error(model(frame, inputs))
