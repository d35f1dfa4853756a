"""The hull of parts holds every motion, refusals are bisected, and no thread changes a bound."""

import re
from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    DualProof,
    Exact,
    LinearFlow,
    MatrixStructure,
    Proof,
    StoreyFrame,
    UnprovedError,
    envelope,
)
from alphacut.frame.bounds.box_proof import BisectionError, BoxBounds
from alphacut.frame.bounds.spatial_branch_and_bound import prove
from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.fuzzy import Interval, Triangular
from tests.frame.motions import exact_motions, random_points, require_inside

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

    def call_kernels(self):
        """No kernel is called."""

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
    found = prove(proof, FLOW)
    for level, alpha in enumerate(found.alpha):
        values = FLOW.flow.values(random_points(FUZZY, 3000, rng, alpha))
        require_inside(values, found, level, slack=1e-12)
    assert (found.upper.max(1) - found.inner.upper.max(1) <= 0.3 * FLOW.peak).all()
    assert (found.inner.lower.min(1) - found.lower.min(1) <= 0.3 * FLOW.peak).all()
    assert len(proof.seen) > 10
    assert proof.seen[-1][1].sum() < 0.5 * proof.seen[0][1].sum()


def test_a_refused_part_is_bisected_along_the_input_named_at_its_geometric_middle():
    proof = Lipschitz(widest=0.03, along=1, gap=9.0)
    prove(proof, FLOW)
    low, high = sorted((cuts for cuts, _ in proof.seen[1:3]), key=lambda cuts: cuts.lower[0, 1])
    assert low.upper[0, 1] == high.lower[0, 1] == pytest.approx(1.0)
    assert (low.upper[0, [0, 2]] == [125, 0.06]).all()
    proof = Lipschitz(widest=15.0, along=0, gap=9.0)
    prove(proof, FLOW)
    assert min(cuts.upper[0, 0] for cuts, _ in proof.seen[1:3]) == pytest.approx(100.0)


def test_what_no_bisection_cures_is_refused():
    with pytest.raises(UnprovedError, match="too wide"):
        prove(Lipschitz(parts=5, widest=0.0, along=2), FLOW)
    proof = Lipschitz()
    proof.bounds = lambda *_: (_ for _ in ()).throw(BisectionError("in vain"))
    with pytest.raises(BisectionError, match="in vain"):
        prove(proof, FLOW)


def test_a_gap_that_falls_too_slowly_is_left_and_its_bounds_stay(rng):
    found = prove(Lipschitz(parts=12, gap=1e-6), FLOW)
    assert found.facts["parts"] < 60
    words = r"gap of q, .* of its peak: \d+% of it by [kmz], which is to be narrowed first"
    assert re.fullmatch(words, found.notes[0])
    require_inside(FLOW.flow.values(random_points(FUZZY, 3000, rng)), found, slack=1e-12)


def spring():
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
        envelope(spring(), fuzzy, replace(method, workers=n), **given) for n in (1, 3)
    )
    assert alone.facts["parts"] > 1
    assert alone.facts["gap_of_peaks"] <= 1.1e-3
    points = np.linspace(0.5, 2.0, 1001)[:, None]
    require_inside(exact_motions(spring(), points, fuzzy, 2.0, 0.1), alone)
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
