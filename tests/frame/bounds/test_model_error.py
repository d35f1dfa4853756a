"""The proved error of modal models, and the remainder of their Taylor polynomials over a box: never
below the true ones, wherever these are sampled, and nearly attained where half would not do.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid
from scipy.linalg import sqrtm

from alphacut.frame import (
    Accelerogram,
    Exact,
    Force,
    History,
    LinearFlow,
    MatrixStructure,
    Midpoint,
    StoreyFrame,
    UnprovedError,
)
from alphacut.frame.bounds.model_error import (
    EnergyNorms,
    largest_growth,
    majorant_parts,
    proved_error,
    remainder_bounds,
    response_parts,
)
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.modes.damped import DampedModes, DampedStructure, require_dissipation
from alphacut.frame.modes.modal_model import ModalModel
from alphacut.fuzzy import Interval
from tests.frame.methods import test_methods

FRAME = replace(test_methods.FRAME, outputs=("q3", "v1", "drift2"))
SHEAR = replace(
    FRAME, outputs=("base_shear",), rayleigh=(0.02, 1e-4), dampers=(), damper_placement="storey"
)
SHAKEN = replace(FRAME, ground=test_methods.RECORD)
CHAIN = MatrixStructure(
    {"m": 2.0, "k": 80.0, "d": 0.3},
    mass=[("m", np.eye(2))],
    stiffness=[("k", np.array([[2.0, -1.0], [-1.0, 1.0]])), (3.0, np.eye(2))],
    observed={"tip": np.array([0.0, 1.0])},
    damping=[("d", np.diag([1.0, 0.0]))],
    q0=np.array([0.0, 0.1]),
)
NARROW = {"E": Interval(24.9e9, 25.1e9)}
PULSE = Accelerogram(0.37, np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0]))


APART = MatrixStructure(
    {"k": 1.0},
    mass=[(1.0, np.eye(2))],
    stiffness=[("k", np.diag([1.0, 4.0]))],
    observed={"force": np.array([1e12, 0.0])},
    damping=[(0.01, np.eye(2))],
    q0=np.array([0.1, 0.0]),
)


def modal_model(system, inputs, degree=4, **changes) -> ModalModel:
    flow = LinearFlow(system, tuple(inputs), 10.0, 0.1, Exact())
    return ModalModel.of_degree(replace(flow, **changes), boxes(inputs, (0,)), degree)


@pytest.mark.filterwarnings("error")
def test_a_mode_that_adds_nothing_is_left_out_without_a_tolerance():
    """The second unknown is at rest; the output is so large that its modes over 0 overflow."""
    assert modal_model(APART, {"k": Interval(0.99, 1.01)}).count == 1


@pytest.mark.parametrize(
    ("system", "box"),
    [
        (FRAME, {"E": (23e9, 26e9), "m1": (19e3, 21e3), "m3": (9e3, 11e3)}),
        (FRAME, {"l1": (3.9, 4.1), "d1": (7e3, 11e3), "q3_0": (0.2, 0.3)}),
        (
            SHEAR,
            {"E": (24e9, 26e9), "rayleigh_mass": (0.01, 0.03), "rayleigh_stiffness": (0.0, 2e-4)},
        ),
        (SHAKEN, {"E": (24e9, 26e9), "m2": (14e3, 16e3), "d1": (7e3, 11e3)}),
        (CHAIN, {"m": (1.9, 2.1), "k": (75, 85), "d": (0.0, 0.6)}),
        (
            replace(SHAKEN, dampers=(), damping_ratio=0.03, outputs=("q3", "v1", "a2")),
            {"E": (24e9, 26e9), "m2": (14e3, 16e3), "zeta": (0.02, 0.05)},
        ),
        (
            replace(SHAKEN, damping_ratio=0.03, outputs=("q3", "v1", "a2")),
            {"E": (24e9, 26e9), "d1": (7e3, 11e3), "m2": (14e3, 16e3)},
        ),
        (
            replace(CHAIN, ratios=(0.1,)),
            {"m": (1.9, 2.1), "k": (75, 85), "d": (0.0, 0.6)},
        ),
        (
            replace(CHAIN, damping=[], ratios=(0.1,)),
            {"m": (1.9, 2.1), "k": (75, 85), "d": (0.0, 0.6)},
        ),
    ],
)
@pytest.mark.parametrize("degree", [2, 5])
def test_no_sampled_trajectory_deviates_by_more_than_the_proved_error(system, box, degree, rng):
    found = modal_model(system, {name: Interval(*ends) for name, ends in box.items()}, degree)
    unit = np.vstack([rng.uniform(-1, 1, (300, 3)), list(product((-1.0, 1.0), repeat=3))])
    truth = UnitFlow(found.flow, found.boxes).values(unit)
    deviation, proved = np.abs(found.values(unit) - truth).max(0), proved_error(found)
    assert (deviation <= proved + 1e-12 * np.abs(truth).max()).all()
    assert proved.max() < 1000 * deviation.max()


def test_modes_that_are_left_out_count_as_an_error_of_the_start() -> None:
    flow = LinearFlow(SHAKEN, ("E",), 10.0, 0.1, Exact())
    cuts = boxes(NARROW, (0,))
    few = ModalModel.of_degree(flow, cuts, 4, np.full(3, 1.0))
    assert few.count < 3
    unit = np.linspace(-1, 1, 21)[:, None]
    missed = np.abs(few.values(unit) - UnitFlow(flow, cuts).values(unit)).max(0)
    assert missed.max() > 1e-4
    assert (missed <= proved_error(few)).all()


def test_the_damping_force_over_a_mass_is_bounded_closely(rng):
    """Accelerations read the damping force 2 ζ M √(M⁻¹K) v over their mass."""
    frame = StoreyFrame((1e4, 8e3), stiffness=(1e6, 6e5), damping_ratio=0.04, outputs=("a1", "a2"))
    found = modal_model(frame, {"k1": Interval(9e5, 11e5), "m2": Interval(7e3, 9e3)})
    of_frame = EnergyNorms(found.structure).outputs
    reached = np.zeros(2)
    for k1, m2 in rng.uniform([9e5, 7e3], [11e5, 9e3], (40, 2)):
        M, K = np.diag([1e4, m2]), np.array([[k1 + 6e5, -6e5], [-6e5, 6e5]])
        by_ratio = 2 * 0.04 * sqrtm(np.linalg.solve(M, K)).real  # times v, over its norm in M
        by_ratio = np.linalg.norm(by_ratio / np.sqrt(np.diag(M)), axis=1)
        by_springs = np.linalg.norm(np.linalg.solve(M, np.linalg.cholesky(K)), axis=1)
        reached = np.maximum(reached, np.hypot(by_ratio, by_springs))
    assert (reached <= of_frame).all()
    assert (of_frame < 2 * reached).all()


def wrong(polynomials: TaylorModel) -> TaylorModel:
    """The same with their constants and their slopes a thousandth too large."""
    first, second, *others = polynomials.parts
    return replace(polynomials, parts=(1.001 * first, 1.001 * second, *others))


@pytest.mark.parametrize("kind", ["eigenvalue", "coefficient", "load"])
def test_a_model_that_is_wrong_is_proved_to_be_no_better(kind) -> None:
    system = SHAKEN if kind == "load" else FRAME
    good = modal_model(system, {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3)}, 7)
    if kind == "load":
        (load,) = good.loads
        bad = replace(good, loads=(replace(load, share=wrong(load.share)),))
    else:
        bad = replace(good, **{kind: wrong(getattr(good, kind))})
    unit = np.array([[-1.0, 0.3], [1.0, -0.2], [0.9, 1.0]])
    deviation = np.abs(bad.values(unit) - UnitFlow(bad.flow, bad.boxes).values(unit)).max(0)
    assert deviation.max() > 1e-5 > proved_error(good).max()
    assert (deviation <= proved_error(bad) + 1e-12).all()


def test_what_is_not_known_is_not_proved() -> None:
    inputs = {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3)}
    with pytest.raises(UnprovedError, match="midpoint"):
        modal_model(FRAME, inputs, integrator=Midpoint())
    wide = {"l1": Interval(3.0, 5.0), "l2": Interval(2.5, 4.5), "l3": Interval(2.0, 4.0)}
    with pytest.raises(UnprovedError, match="positive definite"):
        proved_error(modal_model(FRAME, wide))


@pytest.mark.parametrize(
    ("system", "box", "message"),
    [
        (replace(CHAIN, damping=[("d", np.eye(2)[::-1])]), {"m": (1.9, 2.1)}, "feed energy"),
        (
            replace(CHAIN, damping=[(lambda p: p["d"] ** 2, np.eye(2))]),
            {"d": (0.1, 0.2)},
            "function",
        ),
        (CHAIN, {"d": (-0.1, 0.1)}, "feed energy"),
        (replace(CHAIN, ratios=("d",)), {"d": (-0.1, 0.1)}, "known to be 0 or greater and below 1"),
    ],
)
def test_structures_that_may_gain_energy_are_refused(system, box, message) -> None:
    inputs = {name: Interval(*ends) for name, ends in box.items()}
    with pytest.raises(UnprovedError, match=message):
        require_dissipation(system, boxes(inputs, (0,)))


def test_energy_norms_hold_over_the_box(rng):
    """√(x* K x), √(f* K⁻¹ f) and √(f* M⁻¹ f) of all inputs."""
    inputs = {"k1": Interval(9e5, 11e5), "m2": Interval(7e3, 9e3)}
    frame = StoreyFrame((1e4, 8e3), stiffness=(1e6, 6e5))
    cuts = boxes(inputs, (0,))
    structure = DampedStructure.over_box(frame, cuts, 2)
    norms, x = EnergyNorms(structure), rng.standard_normal((5, 2))
    reached = np.zeros((3, 5))
    for point in rng.uniform(-1, 1, (60, 2)):
        M, K = structure.mass.at(point[None])[0], structure.stiffness.at(point[None])[0]
        squares = [
            np.einsum("si,ij,sj->s", x, A, x) for A in (K, np.linalg.inv(K), np.linalg.inv(M))
        ]
        reached = np.maximum(reached, np.sqrt(squares))
    bounds = norms.of_displacement(x), norms.of_spring_force(x), norms.of_force(x)
    assert (reached <= bounds).all()
    assert (np.array(bounds) <= 1.3 * reached).all()


def oscillator(omega: complex, shape: complex, velocity: complex, **start) -> ModalModel:
    """A model of q̈ + q = 0 with λ, φ and w as given, that is read as q and q̇."""
    outputs = ("q1", "v1")
    frame = StoreyFrame((1.0,), stiffness=(1.0,), outputs=outputs, **start)
    flow = LinearFlow(frame, ("k1",), 2.0, 0.05, Exact())
    cuts = boxes({"k1": Interval(1 - 1e-12, 1 + 1e-12)}, (0,))
    structure = DampedStructure.over_box(frame, cuts, 2)
    state = np.array([[[shape]]], complex), np.array([[[velocity]]], complex)
    models = (structure.mass.like(x) for x in (np.array([1j * omega]), *state))
    return ModalModel.from_modes(flow, cuts, structure, DampedModes(*models))


@pytest.mark.parametrize(
    ("output", "given"),
    [
        # the second equation alone: λ w + φ = −2e-3 φ pushes the velocity
        (1, {"omega": 1.001, "shape": 0.5, "velocity": 0.5005j, "q0": (1.0,)}),
        # the first alone: λ φ − w = 1e-3
        (0, {"omega": 1.001, "shape": -0.5j, "velocity": 0.5 / 1.001, "v0": (1 / 1.001,)}),
        # displacement and velocity of the start
        (0, {"omega": 1.0, "shape": 0.501, "velocity": 0.501j, "q0": (1.0,)}),
        (1, {"omega": 1.0, "shape": -0.501j, "velocity": 0.501, "v0": (1.0,)}),
    ],
)
def test_half_of_a_defect_would_not_do(output, given) -> None:
    """Early in a slow swing all of a defect moves the mass, and no less than that."""
    found = oscillator(**given)
    bound = proved_error(found)[:, output]
    truth = found.flow.values(np.ones((1, 1)))[0, :, output]
    deviation = np.abs(found.values(np.zeros((1, 1)))[0, :, output] - truth)
    assert (deviation <= bound + 1e-12).all()
    early = slice(1, 6)
    assert (bound[early] <= 1.2 * deviation[early]).all()


def spring(omega: float, ground: Accelerogram | None, duration: float, step: float) -> ModalModel:
    """An undamped mass whose frequency is uncertain by 5 %."""
    frame = StoreyFrame((1.0,), (1.0,), omega**2 / 24, 1.0, q0=(1.0,), ground=ground)
    inputs = {"E": Interval(0.9 * omega**2 / 24, 1.1 * omega**2 / 24)}
    return modal_model(frame, inputs, 12, duration=duration, step=step)


def polynomials(coefficients: np.ndarray) -> TaylorModel:
    """Polynomials of one variable, coefficients (terms, n)."""
    parts, degree = tuple(coefficients[:, None]), len(coefficients) - 1
    return TaylorModel(parts, np.zeros(coefficients.shape[1]), 1, degree)


def test_remainder_of_the_quadratic_model_is_that_of_a_late_oscillation(rng) -> None:
    """By all three of two inputs, of which the frequency and the velocity's share are functions."""
    frame = StoreyFrame((1.0,), stiffness=(1.0,), q0=(1.0,), outputs=("v1",))
    inputs, h = {"k1": Interval(0.9, 1.1), "m1": Interval(0.95, 1.05)}, 1e-4
    found = modal_model(frame, inputs, 12, duration=400.0, step=1.0)
    bound = remainder_bounds(found, -np.ones(2), np.ones(2)).third[:, 0]
    unit = rng.uniform(-0.99, 0.99, (4000, 2))
    for node in (100, 200, 400):
        at = np.full(len(unit), node), np.zeros(len(unit), int)
        ends = (found.at(unit + h * e, *at)[2] - found.at(unit - h * e, *at)[2] for e in np.eye(2))
        ratio = bound[node] / np.abs(np.stack([*ends], 1) / (2 * h)).max(0)
        assert (ratio >= 1).all()
        assert (ratio <= 2.5).all()


@pytest.mark.parametrize("reach", [3e-9, 1.0, 2.0])
def test_majorants_are_exact_in_narrow_boxes_and_beyond_the_unit_box(reach) -> None:
    """The derivatives of 2 u³ are 6 u², 12 u and 12; coefficients are these over 1, 2 and 6."""
    cubic = polynomials(np.array([0, 0, 0, -2.0])[:, None])
    found = [float(part.item()) for part in majorant_parts(cubic, np.full(1, reach))]
    exact = [2 * reach**3, 6 * reach**2, 6 * reach, 2.0]
    np.testing.assert_allclose(found, exact, rtol=1e-14)


def test_remainder_at_the_start_is_that_of_a_force_over_an_uncertain_mass() -> None:
    loads = [Force(1, 1.0, History.constant())]
    frame = StoreyFrame((1.0,), stiffness=(1.0,), damping_ratio=0.05, loads=loads, outputs=("a1",))
    found = modal_model(frame, {"m1": Interval(0.9, 1.1)}, 12, duration=1.0)
    bound = remainder_bounds(found, -np.ones(1), np.ones(1)).third[0, 0, 0, 0, 0]
    assert bound == pytest.approx(6 * 0.1**3 / 0.9**4, rel=1e-6)  # of F/m at m = 0.9


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_bounds_of_waves_are_reached_by_a_pulse_on_a_soft_spring(order: int) -> None:
    """Short of a turn all of the pulse adds up: R and its derivatives by λ are ∫ τ^r a."""
    model = spring(1e-2, PULSE, 4.0, 0.1)
    growth = largest_growth(model.eigenvalue, np.ones(1))
    free, forced = response_parts(model, growth)
    rate = model.eigenvalue.at(np.zeros((1, 1)))
    time = model.flow.time
    if order < 3:
        nodes = np.arange(len(time))
        truth = model.loads[0].response(np.repeat(rate, len(nodes), 0), nodes)[order][:, 0]
        ratio = forced.waves[order][5:, 0] / np.abs(truth)[5:]
        assert (ratio >= 1).all()
        assert (ratio <= 1.8).all()
    assert free.waves[order][:, 0] == pytest.approx(time**order)
    assert forced.impulse[-1] == pytest.approx(1.85)  # ∫ |a| of the pulse, cut at 1.85 s
    nodes = np.arange(len(time))
    driven = model.loads[0].response(np.repeat(rate, len(nodes), 0), nodes)[0][:, 0]
    elapsed = cumulative_trapezoid(np.abs(driven), dx=0.1, initial=0)
    assert (forced.elapsed[5:, 0] >= (1 - 1e-4) * elapsed[5:]).all()
    assert (forced.elapsed[5:, 0] <= 1.8 * elapsed[5:]).all()


def test_what_a_series_of_a_load_leaves_out_is_in_the_errors_of_the_model() -> None:
    """A series is cut short, and said to leave out what it does: half would not cover the error."""
    model, unit = spring(1.0, PULSE, 6.0, 0.1), np.linspace(-1, 1, 21)[:, None]
    (load,), nodes = model.loads, np.arange(61)
    assert proved_error(model)[-1, 0] < 1e-10
    (table,) = load.tables
    table.moment = table.moment[:, :2]
    rate, at = model.eigenvalue.at(unit), (np.repeat(unit, 61, 0), np.tile(nodes, 21))
    series = load.response(np.repeat(rate, 61, 0), at[1])[0].reshape(21, 61)
    missed = load.at_nodes(rate)[..., 0] - series
    largest = response_parts(model, largest_growth(model.eigenvalue, np.ones(1)))[1].waves[0][:, 0]
    table.truncation[0] = (np.abs(missed[:, 1:]) / largest[1:]).max()
    truth = UnitFlow(model.flow, model.boxes).values(unit)[..., 0]
    off = np.abs(model.at(*at, 0 * at[1])[0].reshape(21, 61) - truth).max(0)
    of_values = remainder_bounds(model, np.ones(1), np.ones(1)).rounding[:, 0, 0]
    assert 0.5 < (off / (proved_error(model)[:, 0] + of_values))[1:].max() <= 1


def test_rounding_of_late_phases_is_in_the_margin() -> None:
    model, narrow = spring(1.0, None, 1e8, 1e6), np.full(1, 1e-8)
    margin = remainder_bounds(model, -narrow, narrow).rounding[:, 0, 0]
    unit = np.random.default_rng(2).uniform(-narrow, narrow, (200, 1))
    powers = np.longdouble(unit) ** model.eigenvalue.exponents[:, 0]
    phase = powers @ model.eigenvalue.coefficients[:, 0].imag
    growth = powers @ model.eigenvalue.coefficients[:, 0].real
    share = [
        powers @ part[:, 0, 0]
        for part in (model.coefficient.coefficients.real, model.coefficient.coefficients.imag)
    ]
    nodes = np.array([1, 10, 100])
    for node in nodes:
        t = np.longdouble(model.flow.time[node])
        exact = (
            2 * np.exp(growth * t) * (share[0] * np.cos(phase * t) - share[1] * np.sin(phase * t))
        )
        off = np.abs(model.at(unit, np.full(200, node), np.zeros(200, int))[0] - exact)
        assert 0 < off.max() <= margin[node]
        assert off.max() > 1e-3 * margin[node]
