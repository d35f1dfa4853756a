"""The method `Proof`, by its pieces: the error of modal models, the remainder of their Taylor
polynomials, and branch and bound over boxes; and for both proofs the bisection of wide boxes.

Bounds are never below the truth, wherever this is sampled, and nearly attained: with half of an
error or of a remainder a worse model or a box with the highest value would be passed.
"""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from alphacut.frame import (
    Accelerogram,
    DualProof,
    Exact,
    Force,
    History,
    LinearFlow,
    MatrixStructure,
    Midpoint,
    Proof,
    StoreyFrame,
    UnprovedError,
    envelope,
)
from alphacut.frame.bounds.box_proof import BisectionError, BoxBounds
from alphacut.frame.bounds.branch_and_bound import (
    Frontier,
    Optima,
    Piece,
    bound_problems,
    examine_items,
    majorant_parts,
    remainder_bounds,
)
from alphacut.frame.bounds.kernel import (
    BoxTables,
    Examination,
    Items,
    examine,
    stays_below,
)
from alphacut.frame.bounds.spatial_branch_and_bound import prove
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.frame.methods.proof import bound_levels
from alphacut.frame.modes.damped import DampedModes, DampedStructure, require_dissipation
from alphacut.frame.modes.modal_model import (
    EnergyNorms,
    ModalModel,
    largest_growth,
    proved_error,
    response_parts,
)
from alphacut.frame.modes.modes import fitted_model
from alphacut.fuzzy import Interval, Triangular
from tests.frame import test_forces
from tests.frame.methods import test_methods
from tests.frame.motions import exact_motions, off_chords, random_points, require_inside

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
        *(
            (chain, {"m": (1.9, 2.1), "k": (75, 85), "d": (0.0, 0.6)})
            for chain in (
                CHAIN,
                replace(CHAIN, ratios=(0.1,)),
                replace(CHAIN, damping=[], ratios=(0.1,)),
            )
        ),
        (
            replace(SHAKEN, dampers=(), damping_ratio=0.03, outputs=("q3", "v1", "a2")),
            {"E": (24e9, 26e9), "m2": (14e3, 16e3), "zeta": (0.02, 0.05)},
        ),
        (
            replace(SHAKEN, damping_ratio=0.03, outputs=("q3", "v1", "a2")),
            {"E": (24e9, 26e9), "d1": (7e3, 11e3), "m2": (14e3, 16e3)},
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


@pytest.mark.parametrize("damping", [0.01, 0.3])
def test_modes_that_are_left_out_count_as_an_error_within_the_tolerance(damping) -> None:
    """Of damped modes too, which answer a record far less than their energy may."""
    flow = LinearFlow(
        replace(SHAKEN, dampers=(), damping_ratio=damping), ("E",), 10.0, 0.1, Exact()
    )
    cuts = boxes(NARROW, (0,))
    unit = np.linspace(-1, 1, 21)[:, None]
    truth = UnitFlow(flow, cuts).values(unit)
    with_all = proved_error(ModalModel.of_degree(flow, cuts, 4))
    for tolerance in np.geomspace(1.0, 10.0, 9):
        few = ModalModel.of_degree(flow, cuts, 4, np.full(3, tolerance))
        assert few.count < 3
        missed = np.abs(few.values(unit) - truth).max(0)
        assert missed.max() > 1e-5
        assert (missed <= proved_error(few)).all()
        assert (proved_error(few) <= with_all + 1.01 * tolerance).all()


def wrong(polynomials: TaylorModel) -> TaylorModel:
    """The same with their constants and their slopes a thousandth too large."""
    first, second, *others = polynomials.parts
    return replace(polynomials, parts=(1.001 * first, 1.001 * second, *others))


@pytest.mark.parametrize("kind", ["eigenvalue", "coefficient", "load", "at once"])
def test_a_model_that_is_wrong_is_proved_to_be_no_better(kind) -> None:
    inputs, motion = {"E": Interval(24e9, 26e9), "m2": Interval(14e3, 16e3)}, {}
    system = SHAKEN if kind == "load" else FRAME
    if kind == "at once":
        system = replace(test_forces.FRAME, damping_ratio=None, rayleigh=(0.3, 1e-4))
        inputs = {"m1": Interval(1.9e3, 2.1e3), "F1": Interval(1.9e3, 2.1e3)}
        motion = {"duration": 2.0, "step": 0.02}
    good = modal_model(system, inputs, 7, **motion)
    if kind in ("eigenvalue", "coefficient"):
        bad = replace(good, **{kind: wrong(getattr(good, kind))})
    else:  # the record, or what five histories of forces add at once
        off = [replace(x, share=x.share * 1.01) for x in good.loads[-5:]]
        bad = replace(good, loads=(*good.loads[:-5], *off))
    unit = np.array([[-1.0, 0.3], [1.0, -0.2], [0.9, 1.0]])
    truth = UnitFlow(bad.flow, bad.boxes).values(unit)
    deviation = np.abs(bad.values(unit) - truth).max(0)
    assert (deviation > 1e-5 + 10 * proved_error(good)).any()
    assert (deviation <= proved_error(bad) + 1e-12 * (1 + np.abs(truth).max())).all()


@pytest.mark.filterwarnings("error")
def test_modes_that_may_grow_without_end_have_an_infinite_error():
    """Over such a time the waves of a wide box overflow; an infinite one times 0 is no number."""
    inputs = {"E": Interval(15e9, 35e9), "m2": Interval(8e3, 22e3)}
    found = modal_model(FRAME, inputs, 3, duration=1e5, step=1e3)
    proved = proved_error(found)
    assert np.isinf(proved[-1]).all()
    assert (proved[0] < np.inf).all()
    assert fitted_model(found.flow, found.boxes, np.ones(3), {}).excess == np.inf


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


def test_bounds_of_waves_are_reached_by_a_pulse_on_a_soft_spring() -> None:
    """Short of a turn all of the pulse adds up: R and its derivatives by λ are ∫ τ^r a."""
    model = spring(1e-2, PULSE, 4.0, 0.1)
    free, forced = response_parts(model, largest_growth(model.eigenvalue, np.ones(1)))
    time, nodes = model.flow.time, np.arange(len(model.flow.time))
    rate = np.repeat(model.eigenvalue.at(np.zeros((1, 1))), len(nodes), 0)
    truth = np.abs(model.loads[0].response(rate, nodes)[:3, :, 0])
    elapsed = cumulative_trapezoid(truth[0], dx=0.1, initial=0)
    for order in range(4):
        assert free.waves[order][:, 0] == pytest.approx(time**order)
    for bound, reached in zip((*forced.waves[:3], forced.elapsed), (*truth, elapsed), strict=True):
        assert (bound[5:, 0] >= (1 - 1e-4 * (reached is elapsed)) * reached[5:]).all()
        assert (bound[5:, 0] <= 1.8 * reached[5:]).all()
    assert forced.impulse[-1] == pytest.approx(1.85)  # ∫ |a| of the pulse, cut at 1.85 s


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
    of_values = remainder_bounds(model, np.ones(1), np.ones(1)).tables[:, 0]
    assert 0.5 < (off / (proved_error(model)[:, 0] + of_values))[1:].max() <= 1


# branch and bound


def test_what_a_free_wave_does_between_nodes_is_bounded_and_half_would_not_do() -> None:
    """A cosine strays from its chord by h² ω²/8 about its crest, as the bound says."""
    frame = StoreyFrame((1.0,), stiffness=(1.0,), q0=(1.0,))
    inputs, given = {"k1": Interval(0.9, 1.1)}, {"duration": 6.0, "step": 0.2, "alpha": (0,)}
    found = envelope(frame, inputs, Proof(gap=1e-4), **given)
    # of the fastest of the box
    off = off_chords(np.cos(np.sqrt(1.1) * np.linspace(0, 6, 6001)), 200).max()
    assert found.between[1:, 0].min() / off >= 1
    assert found.between.max() / off <= 1.3


def test_the_model_error_counts_on_both_sides_of_the_gap_asked_for() -> None:
    """Bounds are raised and attained values lowered by it; both together stay within the gap."""
    model = spring(1.0, None, 6.0, 0.1)
    error = np.full((61, 1), 0.004)
    (proof,) = bound_levels(model, error, np.ones(1), gap=0.01)
    gap = (proof.upper - proof.attained).max()
    assert 2 * 0.004 < gap <= 0.01
    with pytest.raises(UnprovedError, match="take the method dual"):
        bound_levels(model, error, np.ones(1), gap=0.0079)


def test_an_error_that_rises_and_falls_within_a_step_is_in_what_is_between() -> None:
    """Kicked just after the node before, it has decayed by exp(−h) at the next one."""
    frame = StoreyFrame((1.0,), stiffness=(2.0,), rayleigh=(2.0, 0.0), q0=(1.0,))
    found = modal_model(frame, {"k1": Interval(1.999, 2.001)}, 3, duration=3.0, step=0.5)
    error = np.zeros((7, 1))
    error[3] = 1e-3 * np.exp(-0.5)
    plain, kicked = (
        bound_levels(found, x, np.ones(1), gap=1e-2)[0].between_nodes for x in (0 * error, error)
    )
    assert 1 - 1e-12 <= (kicked - plain)[3, 0] / 1e-3 <= 1.01


def cube():
    """A model of the motion x³ for all times; its third derivative is 6."""
    model = spring(1.0, None, 1.0, 1.0)
    half = polynomials(np.array([0, 0, 0, 0.5])[:, None] + 0j)
    return replace(model, eigenvalue=half * 0.0, coefficient=half[:, None])


@pytest.mark.parametrize(
    ("start", "gap", "budget"),
    [
        (0.5, 1e-3, 4000),  # about 0 the third derivative alone tells that x³ reaches 1
        (0.0, 1e-3, 1),
        (0.97, 0.1, 4000),  # the first box of x³ holds no more than the gap
    ],
)
def test_branch_and_bound_needs_all_of_the_remainder(start, gap, budget) -> None:
    """From a best point of a cubic, in which half of the remainder would hide the highest value."""
    best = np.full((4, 1), start)  # of two nodes and both sides
    optima = Optima(best, np.array([-1, 1, -1, 1]) * start**3)
    proved, _ = bound_problems(cube(), -np.ones(1), np.ones(1), optima, gap=gap, budget=budget)
    assert 1 <= proved[3] <= 1.02


def least_closed(model):
    """Of each problem the least target below which its whole box [−1, 1] is closed, shape (N,)."""
    ends, count = np.ones(1), 2 * len(model.flow.time)
    frontier = Frontier.whole_box(-ends, ends, count)
    piece = Piece(slice(0, 1), slice(0, count))
    third = remainder_bounds(model, -ends, ends).third
    low, high = np.full(count, -2.5), np.full(count, 2.5)
    for _ in range(30):
        target = (low + high) / 2
        code = examine_items(model, third, target, frontier, piece).code
        low, high = np.where(code, target, low), np.where(code, high, target)
    return high


def turning():
    """The motion cos((1 + 0.05 u) t) + u, highest at an end whatever the phase."""
    rate, share = np.array([[1j, 0], [0.05j, 0]]), np.array([[0.5 + 0j, 0], [0, 0.5]])
    plain = spring(1.0, None, 12.0, 0.1)
    return replace(plain, eigenvalue=polynomials(rate), coefficient=polynomials(share)[:, None])


@pytest.mark.parametrize("even", [True, False])
def test_a_box_is_closed_where_its_mode_allows_no_more(even: bool) -> None:
    """At all phases of a mode, of which the bound of the third derivative leaves φ³/6 and a little."""
    model = turning() if even else spring(1.0, None, 12.0, 0.1)
    closed = least_closed(model).reshape(-1, 2)
    values = model.values(np.linspace(-1, 1, 2001)[:, None])[..., 0]
    truth = np.stack([-values.min(0), values.max(0)], 1)
    assert (closed >= truth - 1e-7).all()
    early = model.flow.time <= 6  # up to 0.3 rad from the midpoint, where little is left out
    assert (closed - truth)[early].max() <= 9e-3


def test_concave_bound_is_that_of_the_curvature_it_adds() -> None:
    """x²/2 − y² on [−1, 1]² is at most 1/2, and no shift below 1 makes it concave."""
    g, H, r = np.zeros(2), np.diag([1.0, -2.0]), np.ones(2)
    work, L = np.empty((3, 2)), np.empty((2, 2))
    for shown in (stays_below, stays_below.py_func):  # compiled, and as it is read
        assert shown(g, H, r, 8.01, work, L)
        assert not shown(g, H, r, 0.49, work, L)


def code_of_box(*, slope, bend, third, radius, target, is_at_ends):
    """Code of one box |x| ≤ `radius` of one input, of one output at one node, on its upper side.

    About its centre the output is slope · x + bend · x²/2, with a third derivative of at most
    `third` in size.
    """
    table = np.array([0.0, slope, bend]).reshape(1, 1, 1, 3)
    found = Examination(np.zeros(1, np.int64), np.zeros(1), np.zeros(1))
    examine(
        Items(np.array([0, 1]), np.array([0, 1]), node=np.array([0]), column=np.array([1])),
        BoxTables(np.full((1, 1), radius), np.full((1, 2, 1), is_at_ends), table),
        np.ones((1, 1)),
        np.full((1, 1, 1, 1, 1), third),
        np.array([np.inf, target]),
        found,
    )
    return found.code[0]


@pytest.mark.parametrize("part", ["bend", "third"])
@pytest.mark.parametrize("is_at_ends", [False, True])
def test_a_box_whose_highest_point_lies_inside_is_bisected(part, is_at_ends, rng):
    """It is neither left to its neighbour nor confined to its end, though it rises at its centre.

    The slope falls from the centre to the upper end, by one part of what it may change by, to less
    than zero; half of that part would not suffice. So the output is highest inside.
    """
    radius, fall = rng.uniform(0.1, 10, 2)
    slope = fall * rng.uniform(0.55, 0.95)
    x = radius * np.linspace(-1, 1, 20001)
    # by each part the slope at `radius` is smaller than that at the centre by `fall`
    parts = {
        "bend": {"bend": -fall / radius, "third": 0.0},
        "third": {"bend": 0.0, "third": 2 * fall / radius**2},
    }[part]
    output = slope * x + parts["bend"] * x**2 / 2 - parts["third"] * x**3 / 6
    target = (output.max() + max(output[-1], 0.0)) / 2
    code = code_of_box(slope=slope, radius=radius, target=target, is_at_ends=is_at_ends, **parts)
    assert code == 1


# bisection of wide boxes

NAMES = ("k", "m", "z")
SYSTEM = MatrixStructure(
    {"k": 100.0, "m": 1.0, "z": 0.05},
    [("m", np.eye(1))],
    [("k", np.eye(1))],
    {"q": np.ones(1)},
    q0=np.ones(1),
    ratios=("z",),
)
FUZZY = {
    "k": Interval(80, 125),
    "m": Triangular(0.95, 1.0, 1.05),
    "z": Triangular(0.04, 0.05, 0.06),
}
FLOW = UnitFlow(LinearFlow(SYSTEM, NAMES, 0.6, 0.1, Exact()), boxes(FUZZY, (0, 0.5)), relative=True)


def margin(problem):
    return 1e-9 * problem.peak


class Lipschitz:
    """Bounds by the motion in the middle and a constant; refuses parts that are wide in `along`."""

    name, workers = "lipschitz", 2

    def __init__(self, parts=400, widest=np.inf, along=None, gap=0.3):
        self.parts, self.widest, self.along, self.gap = parts, widest, along, gap
        self.seen = []

    def forecast(self, flow, cuts):
        return 1.0

    def peak_gap(self, flow):
        return self.gap * flow.peak

    def bounds(self, flow, cuts, goal):
        self.seen.append((cuts, goal.needed.copy()))
        place = 0 if self.along is None else self.along
        if cuts.radius[place] > self.widest:
            raise UnprovedError("too wide", along=self.along)
        found = []
        for low, high in zip(cuts.lower, cuts.upper, strict=True):
            middle = (low + high) / 2
            value = flow.values(middle[None])[0]
            # |∂q/∂ω| ≤ t, |∂q/∂ζ| ≤ ω t, and δω/ω ≤ (δk/k + δm/m) / 2, of the lower ends
            size = np.sqrt(high[0] / low[1])
            each = (high - low) / 2 * [0.5 * size / low[0], 0.5 * size / low[1], size]
            slack = (1.5 * flow.time * each.sum() + 1e-14)[:, None, None]  # and rounding
            both = np.stack([-value, value], -1)
            at = np.broadcast_to(middle, (*both.shape, 3))
            shares = np.broadcast_to(each / max(each.sum(), 1e-300), (1, 2, 3))
            found.append(BoxBounds(both + slack, both, at, 0 * value, shares))
        return found


def test_the_hull_of_all_parts_holds_every_motion_and_closes_the_gaps_of_peaks(rng):
    proof = Lipschitz()
    found = prove(proof, FLOW, margin)
    for level, alpha in enumerate(found.alpha):
        values = FLOW.flow.values(random_points(FUZZY, 3000, rng, alpha))
        require_inside(values, found, level, slack=1e-12)
    assert (found.upper.max(1) - found.inner.upper.max(1) <= 0.3 * FLOW.peak).all()
    assert (found.inner.lower.min(1) - found.lower.min(1) <= 0.3 * FLOW.peak).all()
    assert len(proof.seen) > 10
    assert proof.seen[-1][1].sum() < 0.5 * proof.seen[0][1].sum()


def test_a_refused_part_is_bisected_along_the_input_named_at_its_geometric_middle():
    proof = Lipschitz(widest=0.03, along=1, gap=9.0)
    prove(proof, FLOW, margin)
    low, high = sorted((cuts for cuts, _ in proof.seen[1:3]), key=lambda cuts: cuts.lower[0, 1])
    assert low.upper[0, 1] == high.lower[0, 1] == pytest.approx(1.0)
    assert (low.upper[0, [0, 2]] == [125, 0.06]).all()
    proof = Lipschitz(widest=15.0, along=0, gap=9.0)
    prove(proof, FLOW, margin)
    assert min(cuts.upper[0, 0] for cuts, _ in proof.seen[1:3]) == pytest.approx(100.0)


def test_what_no_bisection_cures_is_refused():
    with pytest.raises(UnprovedError, match="too wide"):
        prove(Lipschitz(parts=5, widest=0.0, along=2), FLOW, margin)
    proof = Lipschitz()
    proof.bounds = lambda *_: (_ for _ in ()).throw(BisectionError("in vain"))
    with pytest.raises(BisectionError, match="in vain"):
        prove(proof, FLOW, margin)


def test_a_gap_that_falls_too_slowly_is_left_and_its_bounds_stay(rng):
    found = prove(Lipschitz(parts=12, gap=1e-6), FLOW, margin)
    assert found.facts["parts"] < 60
    require_inside(FLOW.flow.values(random_points(FUZZY, 3000, rng)), found, slack=1e-12)


def soil_spring():
    """A chain on a soil spring, with its modes a factor of two apart or more."""
    chain = 400.0 * (2 * np.eye(4) - np.eye(4, k=1) - np.eye(4, k=-1))
    chain[0, 0] = chain[3, 3] = 400.0
    time = np.arange(0, 3.001, 0.02)
    ground = Accelerogram(0.02, 3 * np.sin(9 * time) * np.exp(-((time - 1) ** 2)))
    soil = np.zeros((4, 4))
    soil[0, 0] = 300.0
    arrays = [(1.0, np.eye(4))], [(1.0, chain), ("s", soil)], {"top": np.eye(4)[3]}
    return MatrixStructure({"s": 1.0}, *arrays, ground=ground, ratios=(0.04,))


@pytest.mark.parametrize("method", [DualProof(peaks=1e-3), Proof(tolerance=1e-3)], ids=repr)
def test_a_soil_spring_known_within_a_factor_of_four_is_proved_in_parts(method):
    fuzzy = {"s": Interval(0.5, 2.0)}
    given = {"duration": 2.0, "step": 0.1, "alpha": (0,), "relative": True, "progress": False}
    alone, threads = (
        envelope(soil_spring(), fuzzy, replace(method, workers=n), **given) for n in (1, 3)
    )
    assert alone.facts["parts"] > 1
    assert alone.facts["gap_of_peaks"] <= 1.1e-3
    points = np.linspace(0.5, 2.0, 1001)[:, None]
    require_inside(exact_motions(soil_spring(), points, fuzzy, 2.0, 0.1), alone)
    for name in ("lower", "upper", "lower_at", "upper_at", "between"):
        assert (getattr(alone, name) == getattr(threads, name)).all()


def test_parts_left_after_a_refusal_have_bounds():
    """A gap that is left as it is leaves no half of a refused part without bounds."""
    frame = StoreyFrame(
        [1e3] * 4, stiffness=[4e5] * 4, damping_ratio=0.02, v0=(0, 0, 0, 1.0), outputs=("q4",)
    )
    inputs = {f"k{z}": Triangular(3.2e5, 4e5, 4.8e5) for z in (1, 2, 3, 4)}
    inputs |= {f"m{z}": Triangular(800.0, 1e3, 1200.0) for z in (1, 2, 3)}
    motion = {"duration": 1.6, "step": 0.16, "alpha": (0.0,), "progress": False}
    found = envelope(frame, inputs, method=DualProof(), **motion)
    assert found.facts["parts"] > 1
    assert found.facts["motions_tested"] >= 24
    assert np.isfinite(found.upper).all()
