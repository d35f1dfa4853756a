"""Fragility from intervals of peaks, against closed forms and random structures."""

import numpy as np
import pytest
from scipy.stats import beta

from alphacut.frame import Accelerogram, Limit, StoreyFrame, fragility
from alphacut.frame.analyses.fragility import CriticalMeasures
from alphacut.frame.analyses.probability import clopper_pearson
from alphacut.fuzzy import Nature, RefusedError, Triangular
from alphacut.fuzzy.result import Ends
from alphacut.fuzzy.sets.numbers import Stepwise
from tests.frame.analyses.test_analyses import one_level

LIMIT = 0.02


def peaks(lower, upper, reached):
    """Peak of an output on one level, by what is proved and reached."""
    return one_level(lower, upper, reached, Nature.GUARANTEED)["q1"]


def suite(count=12, seed=4):
    rng = np.random.default_rng(seed)
    middle = 0.01 * rng.lognormal(0, 0.4, count)
    return middle, [peaks(0.8 * x, 1.25 * x, 1.2 * x) for x in middle]


def fractions(critical, measure):
    """Bounds of the fraction of the records under which a structure exceeds the limit."""
    return Ends(*(count / critical.low.shape[1] for count in critical.counts(measure)))


def test_every_structure_of_the_cut_lies_in_the_band():
    middle, each = suite()
    measures = np.full(len(middle), 2.0)
    critical = CriticalMeasures.from_peaks(each, measures, LIMIT)
    assert critical.low[0] == pytest.approx(2 * LIMIT / (1.25 * middle))
    assert critical.high[0] == pytest.approx(2 * LIMIT / (0.8 * middle))
    measure = np.linspace(0.5, 12, 200)
    band = fractions(critical, measure)
    rng = np.random.default_rng(7)
    for _ in range(200):
        exact = 2 * LIMIT / (middle * rng.uniform(0.8, 1.25, len(middle)))
        share = (exact[:, None] < measure).mean(0)
        assert (band.lower[0] <= share).all()
        assert (share <= band.upper[0]).all()
        assert critical.median.lower[0] <= np.median(exact) <= critical.median.upper[0]
        fitted = critical.lognormal_median
        assert fitted.lower[0] <= np.exp(np.log(exact).mean()) <= fitted.upper[0]
        spread = np.log(exact).std(ddof=1)
        assert critical.dispersion.lower[0] <= spread <= critical.dispersion.upper[0]


def test_confidence_limits_are_those_of_clopper_and_pearson():
    middle, each = suite()
    critical = CriticalMeasures.from_peaks(each, np.ones(len(middle)), LIMIT)
    measure = np.linspace(0.5, 6, 23)
    band = fractions(critical, measure)
    limits = clopper_pearson(*critical.counts(measure), 12, 0.025)
    for k in range(len(measure)):
        least, most = (round(12 * end[0, k]) for end in band)
        lower = beta.ppf(0.025, least, 13 - least) if least else 0.0
        upper = beta.ppf(0.975, most + 1, 12 - most) if most < 12 else 1.0
        assert limits.lower[0, k] == pytest.approx(lower)
        assert limits.upper[0, k] == pytest.approx(upper)


def test_any_of_the_limits_is_the_least():
    _, each = suite()
    one = CriticalMeasures.from_peaks(each, np.ones(12), LIMIT)
    two = CriticalMeasures.from_peaks(each, np.linspace(0.5, 2, 12), LIMIT)
    either = CriticalMeasures.of_any([one, two])
    assert either.low == pytest.approx(np.minimum(one.low, two.low))
    assert (either.high >= either.low_reached).all()


def test_a_structure_that_may_stay_at_rest_has_no_upper_end():
    critical = CriticalMeasures.from_peaks([peaks(0.0, 0.01, 0.01)] * 2, [1.0, 1.0], LIMIT)
    assert np.isinf(critical.high).all()
    assert fractions(critical, np.array([5.0])).lower[0, 0] == 0.0
    assert np.isinf(critical.dispersion.upper[0])
    with pytest.raises(RefusedError, match="two records"):
        _ = CriticalMeasures.from_peaks([peaks(0.01, 0.02, 0.015)], [1.0], LIMIT).dispersion


@pytest.fixture(scope="module")
def two_storeys():
    """Fragility of a frame with two limits of all storeys, under five records."""
    rng = np.random.default_rng(3)
    suite = [Accelerogram(0.02, x * rng.normal(size=60), name=f"r{x}") for x in (1, 2, 3, 5, 9)]
    frame = StoreyFrame([2e4, 2e4], stiffness=[8e6, 6e6], damping_ratio=0.05)
    limits = [
        Limit(f"drift{storey}", value, stated=text, event=f"drift <= {text}")
        for text, value in (("0.5 %", 0.015), ("1 %", 0.03))
        for storey in (1, 2)
    ]
    inputs = {"k1": Triangular(7.7e6, 8e6, 8.3e6)}
    times = {"duration": 3.0, "step": 0.02, "alpha": (0, 1)}
    return fragility(frame, inputs, suite, limits, intensity="PGA", **times)


def test_a_limit_of_all_storeys_is_one_event_and_there_is_none_of_all_limits(two_storeys):
    limits = two_storeys.limits
    names = ["drift1 <= 0.5 %", "drift2 <= 0.5 %", "drift1 <= 1 %", "drift2 <= 1 %"]
    assert [*limits] == [*names, "drift <= 0.5 %", "drift <= 1 %"]
    for text in ("0.5 %", "1 %"):
        event = limits[f"drift <= {text}"]
        of_storeys = [limits[f"drift{storey} <= {text}"].critical for storey in (1, 2)]
        assert event.critical.low == pytest.approx(np.minimum(*(x.low for x in of_storeys)))
        assert event.critical.high == pytest.approx(np.minimum(*(x.high for x in of_storeys)))
        assert event.words == f"drift ≤ {text} everywhere"
    assert limits["drift1 <= 1 %"].words == "|drift1| ≤ 1 % (30.00 mm)"


def test_the_median_is_that_of_the_sample_and_the_fit_has_the_geometric_mean(two_storeys):
    for part in two_storeys.limits.values():
        for end, of_sample, of_fit in zip(
            (part.critical.low, part.critical.high), part.median, part.lognormal_median, strict=True
        ):
            assert of_sample == pytest.approx(np.sort(end, axis=1)[:, 2])
            assert of_fit == pytest.approx(end.prod(axis=1) ** 0.2)
        curves = part.lognormal_fit(-1)
        half = [np.interp(0.5, curve, part.measure) for curve in curves]
        ends = [part.lognormal_median.lower[-1], part.lognormal_median.upper[-1]]
        assert [half[0], half[-1]] == pytest.approx(ends, rel=0.02)
    assert "lognormal" in str(two_storeys)


def test_measures_of_a_band_are_finite_where_no_peak_is_known_to_be_reached():
    """A limit on "max q1" under wide inputs of which only an enclosing box is known."""
    frame = StoreyFrame([2e4], stiffness=[4e6], damping_ratio=0.05, outputs=("q1",))
    # A push to one side: when q1 comes back, and how far, depends on the stiffness.
    record = Accelerogram(0.05, np.append(np.ones(8), np.zeros(12)), name="push")
    enclosing = Stepwise((0.0,), (1e6,), (9e6,), encloses="the learned set")
    found = fragility(
        frame,
        {"k1": enclosing},
        [record],
        Limit("q1", 0.02, largest=True),
        duration=2.0,
        step=0.05,
        alpha=[0],
    )
    critical = found.limits["max q1"].critical
    assert np.isinf([critical.low_reached, critical.high]).all()
    measure = found.limits["max q1"].measure
    assert np.isfinite(measure).all()
    assert measure[0] < critical.low[0, 0] < measure[-1]
