"""Exceedance of frames that yield over scales: closed forms, linear frames, dense scales."""

from dataclasses import replace

import numpy as np

from alphacut.frame import Accelerogram, StoreyFrame, envelope
from alphacut.frame.questions.fragility import CriticalMeasures, ExceedanceSets
from alphacut.frame.questions.incremental import RESOLUTION, IncrementalAnalysis
from alphacut.frame.questions.peaks import peaks
from alphacut.fuzzy import Triangular

ALPHA = (0.0, 0.5, 1.0)
STEADY = Accelerogram(0.1, np.ones(60))


def sets_of(analysis, greatest):
    found = analysis.run(greatest)
    return found, ExceedanceSets.from_demands([(found.scales, found.demands[::-1, :, 0])])


def test_a_steady_push_exceeds_a_ductility_at_the_closed_form(rng):
    # elastic, perfectly plastic under a step m a: μ = 1 / (2 (1 − m a / fy))
    limit, yield_force = (
        rng.uniform(1.2, 6),
        Triangular(*(10 * rng.uniform([0.8, 1, 1.1], [0.9, 1, 1.3]))),
    )
    frame = StoreyFrame([2.0], stiffness=[90.0], yield_force=[10.0], ground=STEADY)
    analysis = IncrementalAnalysis(
        frame, {"fy1": yield_force}, [("ductility1", limit)], 6.0, 0.1, ALPHA
    )
    _, sets = sets_of(analysis, 20.0)
    exact = np.array([yield_force.cut(x) for x in ALPHA]).T / 2 * (1 - 1 / (2 * limit))
    for ends, value in (
        ((sets.low, sets.low_reached), exact[0]),
        ((sets.high_reached, sets.high), exact[1]),
    ):
        assert (ends[0][0] <= value * (1 + 1e-9)).all()
        assert (ends[1][0] >= value * (1 - 1e-9)).all()
        assert (ends[1] <= ends[0] * (1 + RESOLUTION)).all()


def test_a_frame_that_stays_elastic_has_the_critical_scales_of_the_linear_one(rng):
    ground = Accelerogram(0.05, rng.normal(size=60))
    linear = StoreyFrame(
        [2.0, 1.0], stiffness=[90.0, 70.0], damping_ratio=0.05, ground=ground, outputs=["drift1"]
    )
    inputs, limit = {"k1": Triangular(80.0, 90.0, 95.0), "m2": Triangular(0.9, 1.0, 1.2)}, 0.05
    motion = {"duration": 4.0, "step": 0.01, "alpha": ALPHA}
    proved = peaks(envelope(linear, inputs, **motion))["drift1"]
    exact = CriticalMeasures.from_peaks([proved], [1.0], limit)
    yields = replace(linear, yield_drift=[1e-3, 1e-3], hardening=[1.0, 1.0])
    _, sets = sets_of(
        IncrementalAnalysis(yields, inputs, [("drift1", limit)], *motion.values()),
        2 * exact.high.max(),
    )
    assert (sets.low_reached >= exact.low * (1 - 1e-9)).all()
    assert (sets.low <= exact.low_reached * 1.002).all()
    assert (sets.high_reached <= exact.high * (1 + 1e-9)).all()
    assert (sets.high >= exact.high_reached / 1.002).all()


def test_sets_that_are_no_intervals_agree_with_dense_scales(rng):
    ground = Accelerogram(0.05, rng.normal(size=60))
    frame = StoreyFrame(
        [1.0], stiffness=[200.0], yield_force=[1.0], damping_ratio=0.02, ground=ground
    )
    inputs = {"fy1": Triangular(0.95, 1.0, 1.05), "k1": Triangular(190.0, 200.0, 210.0)}
    analysis = IncrementalAnalysis(frame, inputs, [("residual1", 1.0)], 4.0, 0.05, (0.0, 1.0))
    nominal = np.array([[1.0, 200.0]])
    scales = np.geomspace(0.8, 8, 160) * analysis.elastic_scales(nominal)[0, 0]
    points = np.vstack([nominal, rng.uniform((0.95, 190.0), (1.05, 210.0), (60, 2))])
    dense = np.array(
        [analysis._peaks_over_limits(s, points, analysis.limits)[:, 0] for s in scales]
    )
    limits = np.quantile(dense[:, 0], np.linspace(0.3, 0.9, 40))
    limit = max(limits, key=lambda x: np.diff(dense[:, 0] > x).sum())  # crossed most often
    found, sets = sets_of(replace(analysis, limits=[("residual1", limit)]), scales[-1])
    assert (np.diff(found.demands, axis=1)[0] <= 0).all()  # cuts are nested
    at_least, at_most = sets.counts(scales)
    for level, some in enumerate((dense, dense[:, :1])):
        exceeds = some > limit
        assert (exceeds.any(1) & ~at_most[level].astype(bool)).mean() <= 0.03
        assert (~exceeds.all(1) & at_least[level].astype(bool)).mean() <= 0.03
