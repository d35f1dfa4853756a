"""Every method keeps what its nature promises, on structures of all kinds."""

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from alphacut import frame
from alphacut.base.progress_bar import Foretold
from alphacut.frame import Accelerogram, MatrixStructure, Proof, StoreyFrame, envelope
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.methods.sampled import independent_excess
from alphacut.fuzzy import FailedError, Interval, Nature, RefusedError, Triangular
from tests.frame.motions import exact_motions, random_points, require_inside

FRAME = StoreyFrame(
    (20e3, 15e3, 10e3),
    (4.0, 3.5, 3.0),
    25e9,
    1e-4,
    (9e3, 5e3, 0.0),
    q0=(0.1, 0.2, 0.25),
    v0=(0.0, 0.5, 0.0),
    outputs=("q3", "v1", "drift2", "base_shear"),
)
RECORD = Accelerogram(0.05, 3 * np.random.default_rng(8).standard_normal(120))
SHAKEN = replace(FRAME, ground=RECORD, damping_ratio=0.03, dampers=(), outputs=("q3", "a3", "a1"))
CHAIN = MatrixStructure(
    {"m": 2.0, "k": 80.0, "zeta": 0.04},
    [("m", np.eye(2))],
    [("k", np.array([[2.0, -1.0], [-1.0, 1.0]]))],
    {"top": np.array([0.0, 1.0])},
    q0=np.array([0.0, 0.1]),
    ratios=["zeta"],
)
COLUMNS = StoreyFrame((2e4,) * 2, (3.0,) * 2, 25e9, 1e-4, q0=(0.02, 0.03), columns=(4, 4))
KINDS = {
    "dampers": (FRAME, {"E": Triangular(24e9, 25e9, 26e9), "m2": Interval(14e3, 16e3)}),
    "record": (SHAKEN, {"E": Triangular(24e9, 25e9, 26e9), "m1": Triangular(19e3, 20e3, 21e3)}),
    "matrices": (CHAIN, {"k": Triangular(75, 80, 85), "zeta": Triangular(0.02, 0.04, 0.05)}),
    "columns": (COLUMNS, {"c1": Interval(3.8, 4.2), "l2": Triangular(2.9, 3.0, 3.1)}),
}
MOTION = {"duration": 2.0, "step": 0.05, "alpha": (0, 0.5, 1), "relative": True, "progress": False}


@pytest.fixture(scope="module")
def proofs():
    """The proof of each kind of structure."""
    return {
        kind: envelope(*case, method=frame.Proof(tolerance=1e-5), **MOTION)
        for kind, case in KINDS.items()
    }


def trajectories(system, inputs, points, duration=2.0):
    """Exact motions at the nodes of `MOTION`."""
    return exact_motions(system, points, inputs, duration, 0.05)


def attained(found, system, inputs):
    """Largest distance of stated from true values at the points given, of some nodes."""
    worst, rng = 0.0, np.random.default_rng(2)
    of = found.inner or found
    for node in rng.integers(len(found.time), size=5):
        for k in range(len(found.outputs)):
            for value, at in ((of.lower, found.lower_at), (of.upper, found.upper_at)):
                true = trajectories(system, inputs, at[:, node, k])[:, node, k]
                worst = max(worst, np.abs(true - value[:, node, k]).max())
    return worst


@pytest.mark.parametrize("kind", KINDS)
def test_a_proof_contains_every_motion_and_nearly_attains_its_bounds(proofs, kind, rng):
    system, inputs = KINDS[kind]
    found = proofs[kind]
    peak = np.abs(found.upper).max((0, 1))
    assert found.nature is Nature.GUARANTEED
    assert (found.error.max((0, 1)) <= 1e-5 * peak * 1.3).all()
    assert attained(found, system, inputs) <= 1e-5 * peak.max()
    for level, alpha in enumerate(found.alpha):
        values = trajectories(system, inputs, random_points(inputs, 600, rng, alpha))
        require_inside(values, found, level, slack=1e-12)


@pytest.mark.parametrize("method", [frame.GraphFollower(tolerance=1e-3),
                                    frame.GraphFollower(order=1, tolerance=1e-3),
                                    frame.ImprovedFollower(tolerance=1e-3)], ids=repr)  # fmt: skip
@pytest.mark.parametrize("kind", ["dampers", "matrices"])
def test_a_follower_stays_within_proved_bounds_and_says_what_it_misses(proofs, kind, method):
    system, inputs = KINDS[kind]
    proof = proofs[kind]
    found = envelope(system, inputs, method=method, **MOTION)
    assert found.nature is Nature.ESTIMATED
    off = np.maximum(np.abs(found.upper - proof.upper), np.abs(found.lower - proof.lower))
    assert (off <= found.error + proof.error + 1e-12).all()
    assert (found.attained.upper <= found.proved.upper + 1e-9).all()
    assert np.isfinite(found.proved.upper).all()
    true = proof.attained
    assert (np.abs(found.upper - true.upper) <= found.error + 1e-12).all()


@pytest.mark.parametrize(
    ("masses", "stiffness", "q0", "step"),
    [
        ((2e4, 1.5e4, 1e4), (8e6, 6e6, 5e6), (0.01, 0.02, 0.03), 0.304),
        ((1e4, 2e4, 3e4), (5e6, 7e6, 9e6), (0.0, 0.02, 0.03), 0.448),
    ],
)
def test_a_graph_follower_declares_the_basins_that_it_misses_between_distant_nodes(
    masses, stiffness, q0, step
):
    """Nodes half of a period apart share no basins, and five inputs have no proof."""
    system = StoreyFrame(masses, stiffness=stiffness, q0=q0, outputs=("q3", "base_shear"))
    names = ("k1", "k2", "k3", "m1", "m2")
    inputs = {x: Interval(0.9 * system.parameters[x], 1.1 * system.parameters[x]) for x in names}
    motion = {**MOTION, "duration": 20 * step, "step": step, "alpha": (0,), "integrator": "exact"}
    found = envelope(system, inputs, frame.GraphFollower(tolerance=1e-3), **motion)
    further = envelope(system, inputs, frame.ImprovedFollower(1e-3), **motion)
    peak = np.abs(further.upper).max((0, 1))
    missed = np.maximum(found.lower - further.lower, further.upper - found.upper)
    assert found.nature is Nature.ESTIMATED
    assert (missed.max((0, 1)) > 0.05 * peak).any()  # so that there is something to declare
    assert (missed <= found.error + 1e-9 * peak).all()


def test_auto_takes_a_proof_else_the_follower_and_says_why():
    follower = "improved-graph-follower"
    stiff = CHAIN.stiffness[0][1]
    each = replace(CHAIN, stiffness=[(lambda p: 1.0 * p["k"], stiff), *CHAIN.stiffness[1:]])
    two = {"k": Interval(78, 82)}
    many = {name: Interval(0.995 * x, 1.005 * x) for name, x in [*FRAME.parameters.items()][:8]}
    swing = {"l": Interval(0.99, 1.01)}
    cases = (
        (CHAIN, two, 1e-3, Nature.GUARANTEED, "proof"),
        (each, two, None, Nature.GUARANTEED, "dual succeeded; proof: stiffness has a factor"),
        (each, two, 1e-9, Nature.ESTIMATED, f"{follower}; unproved: proof: stiffness has a"),
        (FRAME, many, 1e-3, Nature.ESTIMATED, f"{follower}; unproved: dual: its gap is wider"),
        (frame.pendulum(), swing, 1e-3, Nature.ESTIMATED, f"{follower}: not linear"),
    )
    for system, inputs, tolerance, nature, why in cases:
        method = frame.Auto(tolerance=tolerance)
        found = envelope(
            system,
            inputs,
            method=method,
            **{**MOTION, "duration": 1.0, "alpha": (0,)},
        )
        assert found.nature is nature
        assert found.notes[0].startswith(why)


def test_a_floor_that_does_not_oscillate_is_said_to_have_much_damping():
    chain = StoreyFrame([20e3], stiffness=[8e6], dampers=[2e6], ground=RECORD)
    inputs = {"k1": Interval(7.9e6, 8.1e6)}
    for method in ("dual", "proof"):
        with pytest.raises(UnprovedError, match="does not oscillate; take less damping"):
            envelope(chain, inputs, method=method, **MOTION)


@pytest.mark.parametrize("dashpots", [(), (2e4, 5e3)])
def test_more_inputs_than_a_proof_takes_are_followed_to_the_error_allowed(dashpots, rng):
    names = ["k1", "k2", "m1", "m2", "zeta", *["d1", "d2"][: len(dashpots)]]
    start = {"q0": (0.01, 0.03), "damping_ratio": 0.03, "dampers": dashpots}
    system = StoreyFrame((2e4,) * 2, stiffness=(8e6,) * 2, **start)
    inputs = {x: Interval(0.9 * system.parameters[x], 1.1 * system.parameters[x]) for x in names}
    motion = {**MOTION, "alpha": (0,), "duration": 0.4, "integrator": "exact"}
    method = frame.Auto(1e-3) if dashpots else frame.ImprovedFollower(2e-4)
    found = envelope(system, inputs, method=method, **motion)
    values = trajectories(system, inputs, random_points(inputs, 500, rng), duration=0.4)
    assert found.method == "improved-graph-follower"
    assert attained(found, system, inputs) <= 1e-9 * np.abs(found.upper).max()
    require_inside(values, found)
    peak = np.maximum(found.upper, -found.lower).max(1)
    assert (values.max(0).max(0) <= found.upper[0].max(0) * (1 + 1e-9)).all()
    assert (found.error.max(1) <= (2e-3 if dashpots else 2e-2) * peak).all()


def test_wide_bounds_of_a_proof_get_peaks_that_are_followed_inside_them(monkeypatch):
    """Coarse bounds whose reached values are the nominal motion's."""
    system, inputs = KINDS["record"]
    close = envelope(system, inputs, frame.Proof(tolerance=1e-4), **MOTION)
    nominal = np.array([[number.nominal for number in inputs.values()]])
    reached = np.repeat(trajectories(system, inputs, nominal), 3, axis=0)
    more = np.abs(close.upper).max((0, 1))
    at = np.broadcast_to(nominal, close.upper_at.shape)
    wide = replace(close, inner=close.inner._replace(lower=reached, upper=reached),
                   upper=close.upper + more, lower=close.lower - more,
                   lower_at=at, upper_at=at,
                   facts={**close.facts, "gap_of_peaks": 1.0})  # fmt: skip
    monkeypatch.setattr(frame.DualProof, "run", lambda *_: wide)
    monkeypatch.setattr(frame.Proof, "run", lambda *_: wide)
    found = envelope(system, inputs, frame.Auto(), **MOTION | {"relative": False})
    assert found.notes[0].endswith(" and improved-graph-follower")
    peaks = close.inner.upper.max(1)
    assert found.inner.upper.max(1) == pytest.approx(peaks, rel=1e-4)
    assert (found.inner.upper <= close.upper + 1e-9).all()
    assert attained(found, system, inputs) <= 1e-8 * peaks.max()
    assert (found.error == np.maximum(wide.upper - found.inner.upper,
                                      found.inner.lower - wide.lower)).all()  # fmt: skip


@pytest.mark.parametrize(
    "name", ["graph-follower", "improved-graph-follower", "quasi-monte-carlo", "dual"]
)
def test_progress_rises_to_one(name):
    told = []
    system, inputs = KINDS["matrices"]
    envelope(system, inputs, method=name, **{**MOTION, "progress": told.append})
    assert (np.diff(told) >= 0).all()
    assert len(set(told)) > 5
    assert told[-1] == 1.0
    # The number of samples is known, how many sub-boxes or trajectories are needed is not.
    is_foretold = not any(isinstance(x, Foretold) and x.seconds_left is None for x in told)
    assert is_foretold == (name == "quasi-monte-carlo")


def test_bounds_that_are_too_narrow_are_left_by_as_much():
    cut = boxes({"l": Interval(0.99, 1.01)}, (0,))
    flow = UnitFlow(frame.LagrangianFlow(frame.pendulum(), ("l",), 0.5, 0.05), cut)
    ends = flow.values(np.linspace(*flow.boxes.unit_ends(0), 200))
    bounds = np.stack([-ends.min(0), ends.max(0)], axis=-1)[None]
    size = 0.1 * np.ptp(ends, axis=(0, 1))
    told: list[float] = []
    missed, _ = independent_excess(flow, bounds - size[:, None], told.append)
    assert missed[0] == pytest.approx(size, rel=1e-2)
    assert independent_excess(flow, bounds + size[:, None], told.append)[0].max() == 0


@pytest.mark.parametrize(("start", "nature"), [(2.9, Nature.ESTIMATED), (3.14, Nature.ATTAINED)])
def test_bounds_about_a_separatrix_are_attained_and_no_more(start, nature):
    """A pendulum let go near its top falls to either side."""
    system = frame.pendulum(phi0=start, damping=0.0)
    inputs = {"phi_0": Interval(start - 0.05, start + 0.05)}
    motion = {"duration": 3.0, "step": 0.05, "alpha": (0,)}
    found = envelope(system, inputs, frame.ImprovedFollower(1e-2, budget=200), **motion)
    assert found.nature is nature


def test_a_pendulum_is_followed_to_its_error(rng):
    system = frame.pendulum()
    inputs = {"l": Triangular(0.95, 1, 1.05), "phi_0": Triangular(1.4, 1.5, 1.6)}
    motion = {**MOTION, "relative": False, "step": 0.02}
    found = envelope(system, inputs, method=frame.ImprovedFollower(1e-2), **motion)
    flow = frame.LagrangianFlow(system, tuple(inputs), 2.0, 0.02)
    values = flow.values(random_points(inputs, 500, rng))
    require_inside(values, found)
    off = np.maximum(found.upper[0] - values.max(0), values.min(0) - found.lower[0])
    assert off.max() <= 0.05 * np.abs(found.upper).max()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"method": frame.Proof(tolerance=1e-3), "integrator": "midpoint"}, "midpoint"),
        ({"method": "vertex"}, "method is vertex; allowed: auto, proof"),
        ({"method": "search"}, "take auto, or improved-graph-follower with the integrator exact"),
        ({"method": "proof", "order": 2}, "option of proof is order; allowed: gap, tolerance"),
        ({"method": "auto", "tolerance": 0.0}, "tolerance is 0.0; allowed: finite numbers greater than 0"),
        ({"method": frame.Auto(), "seed": 1}, "none beside a method that is no name"),
        ({"integrator": "euler"}, "integrator is euler; allowed: midpoint, exact"),
        ({"step": 0.07}, "duration is 2 s; allowed: 1 to .* whole steps of 0.07 s"),
        ({"alpha": (1.0, 0.0)}, "levels that rise within"),
        ({"inputs": {}}, "inputs is {}; allowed: a mapping"),
        ({"inputs": {"E": Interval(-1e9, 26e9)}}, "support of E is .*; allowed: positive"),
        ({"inputs": {"E": Interval(24, 26)}}, "give both in SI units"),
        ({"inputs": {"zeta": Interval(0.01, 1.0)}}, "zeta"),
        ({"model": 5}, "model is int; allowed: a StoreyFrame"),
        ({"model": replace(FRAME, q0=(), v0=())}, "a record or a force that moves something"),
    ],
)  # fmt: skip
def test_what_has_no_meaning_is_refused(changes, message):
    call = {**MOTION, "inputs": {"E": Interval(24e9, 26e9)}, "model": FRAME, **changes}
    with pytest.raises((RefusedError, FailedError, ValueError), match=message):
        envelope(call.pop("model"), call.pop("inputs"), **call)


def test_blas_threads_do_not_change_a_bit():
    """Fails without one thread: the fit of the modes has products that BLAS shares out."""
    record = Accelerogram(0.01, np.random.default_rng(1).normal(size=500).cumsum() * 0.01)
    springs = {"stiffness": [6e7] * 8, "rayleigh": (0.5, 2.5e-3), "ground": record}
    building = StoreyFrame(masses=[4e4] * 8, outputs=("q8", "drift1", "base_shear"), **springs)
    inputs = {"k1": Interval(5.5e7, 6.5e7), "m8": Interval(3.6e4, 4.4e4)}
    inputs["rayleigh_mass"] = Interval(0.4, 0.6)
    given = {"duration": 8, "step": 0.1, "alpha": (0,), "progress": False}
    bounds = []
    for threads in (1, 3):
        with threadpool_limits(limits=threads, user_api="blas"):
            bounds.append(envelope(building, inputs, Proof(), **given))
    assert (bounds[0].upper == bounds[1].upper).all()
    assert (bounds[0].lower == bounds[1].lower).all()


def test_the_text_of_an_envelope_has_its_bounds_at_all_times(proofs):
    """What an output may add within a step is part of the extremes that are printed."""
    found = proofs["matrices"]
    wide = replace(found, between=np.full_like(found.between, 0.25))
    line = next(x for x in str(wide).splitlines() if x.startswith("top"))
    low, high = line.partition(": ")[2].partition(",")[0].replace("−", "-").split(" … ")
    assert float(low) == pytest.approx(found.lower[0, :, 0].min() - 0.25, rel=1e-4)
    assert float(high) == pytest.approx(found.upper[0, :, 0].max() + 0.25, rel=1e-4)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_structure_without_uncertainty_is_proved_where_modes_cancel():
    """Far from the lowest storey the modes cancel, and no input adds to the error that is left."""
    line = StoreyFrame(
        masses=[0.1] * 16,
        stiffness=[2500.0] * 16,
        dampers=[1.0] * 15 + [10.0],
        q0=[4e-4] * 16,
        outputs=("shear16", "shear12", "shear9"),
    )
    bounds = envelope(line, {"m1": 0.1}, "proof", duration=0.05, step=0.01, alpha=(0.0,))
    assert bounds.nature == Nature.GUARANTEED
    assert (bounds.upper - bounds.lower).max() < 1e-3 * np.abs(bounds.upper).max()
