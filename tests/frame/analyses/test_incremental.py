"""Exceedance of frames that yield over scales: closed forms, linear frames, dense scales."""

from dataclasses import replace

import numpy as np
import pytest

from alphacut.frame import (
    Accelerogram,
    Limit,
    StoreyFrame,
    decide,
    fragility,
    incremental,
    over_records,
)
from alphacut.frame.analyses.incremental import (
    ALL,
    GRID_RATIO,
    RESOLUTION,
    SOME,
    IncrementalAnalysis,
)
from alphacut.frame.boxes import boxes
from alphacut.fuzzy import Triangular
from tests.refused import refuses

ALPHA = (0.0, 0.5, 1.0)
STEADY = Accelerogram(0.1, np.ones(200))


def of_scales(frame, inputs, ground, limit, **changes):
    """Fragility of one limit over the scale of one record."""
    given = {"duration": 3.0, "step": 0.05, "alpha": ALPHA, "intensity": "scale"}
    found = fragility(frame, inputs, [ground], limit, **(given | changes))
    return found.limits[limit.output]


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_a_steady_push_exceeds_a_ductility_at_the_closed_form(gravity, rng):
    # elastic, perfectly plastic under a step m a: μ = 1 / (2 (1 − m a / fy)); with its weight,
    # x = m g / (k l), energies give 2 m a / fy = 2 − 1/μ − x μ, and at μ = x^-½ it collapses
    limit = rng.uniform(1.2, 6)
    yield_force = Triangular(*rng.uniform([8, 10, 11], [9, 10, 13]))
    spring = {"stiffness": [90.0], "yield_force": [10.0], "lengths": [3.0], "gravity": gravity}
    inputs, of_limit = {"fy1": yield_force}, Limit("ductility1", limit)
    # A little above the push of collapse it takes seconds: the closed form is that of a long push.
    times = {"duration": 20.0, "step": 0.1}
    sets = of_scales(StoreyFrame([2.0], **spring), inputs, STEADY, of_limit, **times).critical
    x = 2 * gravity / 3 / 90
    reached = min(limit, x**-0.5) if x else limit
    factor = 2 - 1 / reached - x * reached
    lowest, highest = np.array([yield_force.cut(x) for x in ALPHA]).T / 4 * factor
    for before, after, exact in (
        (sets.low, sets.low_reached, lowest),
        (sets.high_reached, sets.high, highest),
    ):
        assert (before[:, 0] <= exact * (1 + 1e-9)).all()
        assert (after[:, 0] >= exact * (1 - 1e-9)).all()
        assert (after <= before * (1 + RESOLUTION)).all()


def test_a_frame_that_stays_elastic_has_the_critical_scales_of_the_linear_one(rng):
    ground, limit = Accelerogram(0.05, rng.normal(size=40)), Limit("drift1", 0.05)
    linear = StoreyFrame([2.0, 1.0], stiffness=[90.0, 70.0], damping_ratio=0.05)
    inputs = {"k1": Triangular(80.0, 90.0, 95.0), "m2": Triangular(0.9, 1.0, 1.2)}
    of_linear = of_scales(linear, inputs, ground, limit, alpha=(0, 1))
    yields = replace(linear, yield_drift=[1e-3, 1e-3], hardening=[1.0, 1.0])
    sets = of_scales(yields, inputs, ground, limit, alpha=(0, 1), most=3.0).critical
    exact = of_linear.critical
    assert (sets.low_reached >= exact.low * (1 - 1e-9)).all()
    assert (sets.low <= exact.low_reached * 1.002).all()
    assert (sets.high_reached <= exact.high * (1 + 1e-9)).all()
    assert (sets.high >= exact.high_reached / 1.002).all()
    assert of_linear.dispersion is None  # under a single record


def test_sets_that_are_no_intervals_agree_with_dense_scales(rng):
    ground = Accelerogram(0.05, rng.normal(size=40))
    frame = StoreyFrame([1.0], stiffness=[200.0], yield_force=[1.0], ground=ground)
    inputs = {"fy1": Triangular(0.95, 1.0, 1.05), "k1": Triangular(190.0, 200.0, 210.0)}
    nominal = np.array([[1.0, 200.0]])
    analysis = IncrementalAnalysis(frame, boxes(inputs, (0,)), [("residual1", 1.0)], 3.0, 0.05)

    def residuals(scales, points):
        """Shape (scales, structures)."""
        return np.hstack(
            [analysis._peaks_over_limits(x, points, analysis.limits) for x in scales]
        ).T

    of_nominal = residuals(
        np.geomspace(0.8, 8, 100) * analysis.elastic_scales(nominal)[0, 0], nominal
    )
    limits = np.quantile(of_nominal, np.linspace(0.3, 0.9, 40))
    limit = max(limits, key=lambda x: np.diff(of_nominal > x, axis=0).sum())  # crossed most often
    found = of_scales(frame, inputs, ground, Limit("residual1", limit), alpha=(0, 1), most=1.6)
    scales, (exceeds_by_all, exceeds_by_some) = found.measure, found.band
    points = np.vstack([nominal, rng.uniform((0.95, 190.0), (1.05, 210.0), (30, 2))])
    dense = residuals(scales, points) > limit
    for level, exceeds in enumerate((dense, dense[:, :1])):
        missed = exceeds.any(1) & (exceeds_by_some[level] == 0)
        missed_keeping = ~exceeds.all(1) & (exceeds_by_all[level] > 0)
        for mask in (missed, missed_keeping):  # at most what fits between two scales of the grid
            ends = np.flatnonzero(np.diff(mask, prepend=False, append=False)).reshape(-1, 2)
            assert (scales[ends[:, 1] - 1] < GRID_RATIO * scales[ends[:, 0]]).all()
    # cuts are nested, and so are their sets
    assert (np.diff(exceeds_by_some, axis=0) <= 0).all()
    assert (np.diff(exceeds_by_all, axis=0) >= 0).all()


@pytest.mark.parametrize(("seed", "side"), [(3, SOME), (23, ALL)])
def test_a_search_finds_what_no_structure_of_the_grid_shows(seed, side):
    rng = np.random.default_rng(seed)  # of motions whose extreme drift lies inside the cut
    stiffness = rng.uniform(100, 400, 2).tolist()
    ground = Accelerogram(0.05, rng.normal(size=60))
    spring = {"stiffness": stiffness, "yield_force": [1.0, 0.8], "damping_ratio": 0.02}
    frame = StoreyFrame([1.0, 1.0], **spring, ground=ground)
    inputs = {
        name: Triangular(*(frame.parameters[name] * x for x in (0.85, 1, 1.15)))
        for name in ("fy1", "k1", "k2", "m2")
    }
    cuts = boxes(inputs, (0.0,))
    analysis = IncrementalAnalysis(frame, cuts, [("drift2", 0.00668)], 4.0, 0.05, 2.0)
    scales, demands = analysis.run()
    structures = analysis._spread_structures()
    if side == SOME:
        first = scales[demands[SOME, 0, 0] > 1].min()
        peaks = analysis._peaks_over_limits(1.02 * first, structures, analysis.limits)
        assert peaks.max() < 0.99
    else:
        last = scales[demands[ALL, 0, 0] <= 1].max()
        peaks = analysis._peaks_over_limits(last / 1.02, structures, analysis.limits)
        assert peaks.min() > 1.03


def test_peaks_over_scales_are_proportional_until_a_column_yields(rng, tmp_path):
    suite = [Accelerogram(0.05, rng.normal(size=40), name=name) for name in ("one", "two")]
    frame = StoreyFrame([1.0], stiffness=[200.0], yield_force=[1.0], outputs=("drift1", "a1"))
    inputs, motion = {"k1": Triangular(180.0, 200.0, 220.0)}, {"duration": 3.0, "step": 0.05}
    first = [1e-4, 2e-4, 50.0]
    answer = incremental(frame, inputs, suite, first, **motion, alpha=(0, 1))
    for by_output in answer.peaks.values():
        high, low = by_output["drift1"]
        assert high[:, 1] == pytest.approx(2 * high[:, 0])
        assert (low <= high * (1 + 1e-12)).all()
        assert low[1] == pytest.approx(high[1])  # of the nominal structure alone
        assert (high[0] >= high[1]).all()
        assert high[0, 0] > low[0, 0]
        # what yields has no more acceleration than fy / m and the damping give
        assert by_output["a1"][0][0, 2] < 0.1 * by_output["a1"][0][0, 0] * 50.0 / 1e-4
    rows = answer.records()
    assert len(rows) == 2 * 2 * 2 * 3
    answer.to_csv(tmp_path / "peaks.csv")
    assert len((tmp_path / "peaks.csv").read_text(encoding="utf-8").splitlines()) == 1 + len(rows)
    assert answer.to_dataset()["greatest"].shape == (len(rows),)
    assert "drift1" in str(answer)
    linear = StoreyFrame([1.0], stiffness=[200.0])
    with refuses("incremental"):
        incremental(linear, inputs, suite, first, **motion)


def test_the_worst_and_the_mean_over_records_are_those_of_each(rng):
    suite = [Accelerogram(0.05, x * rng.normal(size=40), name=f"r{x}") for x in (1, 2, 4)]
    frame = StoreyFrame([1.0], stiffness=[200.0], damping_ratio=0.05, outputs=("drift1",))
    motion = {"duration": 3.0, "step": 0.05, "alpha": (0, 1)}
    inputs = {"k1": Triangular(190.0, 200.0, 210.0)}
    answer = over_records(frame, inputs, suite, **motion, measure="PGA", scale=3.0)
    each = [record.peak["drift1"] for record in answer.by_record.values()]
    assert [x.measures["PGA"] for x in answer.by_record.values()] == pytest.approx([3.0] * 3)
    worst, mean = answer.peak["drift1"], answer.peak["mean drift1"]
    assert worst.proved == pytest.approx(np.max([x.proved for x in each], axis=0))
    assert mean.proved == pytest.approx(np.mean([x.proved for x in each], axis=0))
    farthest = answer.by_record[answer.farthest_record["drift1"]]
    assert farthest.peak["drift1"].reached[0] == worst.reached[0]
    verdict = decide(answer, Limit("drift1", 0.9 * float(mean.reached[0]), mean=True))
    assert verdict.limits["mean drift1"].verdict in ("can be exceeded", "exceeded")


@pytest.mark.parametrize("most", [0.0, -1.0, np.nan])
def test_measures_and_scales_that_lead_nowhere_are_refused(most):
    frame = StoreyFrame([1.0], stiffness=[200.0], yield_force=[1.0])
    inputs = {"k1": Triangular(190.0, 200.0, 210.0)}
    times = {"duration": 1.0, "step": 0.1}
    with refuses("most"):
        fragility(frame, inputs, [STEADY], Limit("q1", 1.0), **times, most=most)
    with refuses("scales"):
        incremental(frame, inputs, [STEADY], [], **times)
