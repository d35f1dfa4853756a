"""Fragility from intervals of peaks, against exact motions of random structures."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import beta

from alphacut.frame import Accelerogram, Limit, StoreyFrame, fragility
from alphacut.fuzzy import Triangular
from alphacut.fuzzy.sets.numbers import Stepwise
from tests.frame.motions import exact_motions, random_points

NOISE = np.random.default_rng(3).normal(size=(3, 60))
SUITE = [Accelerogram(0.02, x * row, name=f"r{x}") for x, row in zip((1, 3, 9), NOISE, strict=True)]
FRAME = StoreyFrame([2e4, 2e4], stiffness=[8e6, 6e6], damping_ratio=0.05)
INPUTS = {"k1": Triangular(7.2e6, 8e6, 8.8e6)}


@pytest.fixture(scope="module")
def two_storeys():
    """Fragility of a frame with two limits of all storeys, under three records."""
    limits = [
        Limit(f"drift{storey}", value, stated=text, event=f"drift <= {text}")
        for text, value in (("0.5 %", 0.015), ("1 %", 0.03))
        for storey in (1, 2)
    ]
    times = {"duration": 2.0, "step": 0.01, "alpha": (0, 1)}
    return fragility(FRAME, INPUTS, SUITE, limits, intensity="PGA", independent=True, **times)


def test_every_structure_of_the_cut_lies_in_the_band(two_storeys, rng):
    points = random_points(INPUTS, 60, rng)
    peaks = []  # a little below those between the nodes
    for record in SUITE:
        frame = replace(FRAME, ground=record, outputs=("drift1", "drift2"))
        peaks.append(np.abs(exact_motions(frame, points, INPUTS, 2.0, 0.002)).max(1))
    measures = np.array([np.abs(record.samples).max() for record in SUITE])
    for storey, of_storey in enumerate(np.moveaxis(peaks, -1, 0), 1):
        part = two_storeys.limits[f"drift{storey} <= 1 %"]
        exact = measures * 0.03 / of_storey.T  # (S, records)
        low, high, rounding = part.critical.low[0], part.critical.high[0], 1 + 1e-3
        assert (low <= exact).all()
        assert (exact <= high * rounding).all()
        assert (exact.min(0) <= 1.02 * low).all()
        assert (high <= 1.2 * exact.max(0)).all()
        share = (exact[..., None] < part.measure).mean(1)
        assert (share <= part.band.upper[0]).all()
        at_least = (exact[..., None] / rounding < part.measure).mean(1)
        assert (part.band.lower[0] <= at_least).all()
        for ends, own in (
            (part.median, np.median(exact, axis=1)),
            (part.lognormal_median, np.exp(np.log(exact).mean(1))),
            (part.dispersion, np.log(exact).std(1, ddof=1)),
        ):
            assert (ends.lower[0] <= own).all()
            assert (own <= ends.upper[0] * rounding).all()


def test_confidence_limits_are_those_of_clopper_and_pearson(two_storeys):
    for part in two_storeys.limits.values():
        for k in range(len(part.measure)):
            least, most = (round(3 * end[0, k]) for end in part.band)
            lower = beta.ppf(0.025, least, 4 - least) if least else 0.0
            upper = beta.ppf(0.975, most + 1, 3 - most) if most < 3 else 1.0
            assert part.confidence.lower[0, k] == pytest.approx(lower)
            assert part.confidence.upper[0, k] == pytest.approx(upper)


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
            assert of_sample == pytest.approx(np.sort(end, axis=1)[:, 1])
            assert of_fit == pytest.approx(np.cbrt(end.prod(axis=1)))
        curves = part.lognormal_fit(-1)
        half = [np.interp(0.5, curve, part.measure) for curve in curves]
        ends = [part.lognormal_median.lower[-1], part.lognormal_median.upper[-1]]
        assert [half[0], half[-1]] == pytest.approx(ends, rel=0.02)
    assert "lognormal" in str(two_storeys)


def test_measures_of_a_band_are_finite_where_no_peak_is_known_to_be_reached():
    """A limit on "max q1" under wide inputs of which only an enclosing box is known."""
    frame = StoreyFrame([2e4], stiffness=[4e6], damping_ratio=0.05, outputs=("q1",))
    # A push to one side: when q1 comes back, and how far, depends on the stiffness.
    push = np.append(np.ones(8), np.zeros(12))
    records = [Accelerogram(0.05, x * push, name=f"push {x}") for x in (1, 2)]
    enclosing = Stepwise((0.0,), (1e6,), (9e6,), encloses="the learned set")
    found = fragility(
        frame,
        {"k1": enclosing},
        records,
        Limit("q1", 0.02, largest=True),
        duration=1.0,
        step=0.1,
        alpha=[0],
    )
    part = found.limits["max q1"]
    assert np.isinf([part.critical.low_reached, part.critical.high]).all()
    assert np.isinf(part.dispersion.upper).all()
    assert (part.band.lower == 0).all()
    assert np.isfinite(part.measure).all()
    assert part.measure[0] < part.critical.low[0, 0] < part.measure[-1]
