"""From a sample of r_n to the fuzzy radius map: exact fits, bootstrap bands, the p-box and its
refusals.
"""

from itertools import product

import numpy as np
import pytest
from scipy import integrate

from alphacut.fuzzy import FailedError
from alphacut.stochastic import DISCS, SPHERES, HermiteMap, TruncatedNormal, microstructure
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit, PBox, SlopeEnds, least_pbox, slope_band
from alphacut.stochastic.microstructure import RadiusLimits, fit_map
from tests.refused import refuses

LAW = TruncatedNormal()
TRUE = HermiteMap(0.13, 0.3, 0.87, 0.5)
FIT = HermiteFit(0.13, 0.87)


def drawn(radius: HermiteMap, number: int, seed: int) -> AreaWeighted:
    return AreaWeighted.from_values(radius(LAW.sample(number, np.random.default_rng(seed))))


def staircase_fit(sample: AreaWeighted) -> np.ndarray:
    """Slopes by brute force: least squares over a fine grid of shares."""
    share = (np.arange(400_000) + 0.5) / 400_000
    xi = (LAW.quantile(share) + 3) / 6
    h2, h4 = xi * (1 - xi) ** 2, xi**2 * (xi - 1)
    ends = 0.13 * (1 + 2 * xi) * (1 - xi) ** 2 + 0.87 * xi**2 * (3 - 2 * xi)
    rest = sample.quantile(share) - ends
    return np.linalg.lstsq(np.stack([h2, h4], axis=1), rest, rcond=None)[0]


def test_weighted_distribution_by_hand():
    sample = AreaWeighted.from_values([0.5, 0.2, 0.8], [1, 2, 1])
    assert sample.cdf([0.1, 0.2, 0.5, 0.79, 0.8]).tolist() == [0, 0.5, 0.75, 0.75, 1]
    assert sample.quantile([0.1, 0.5, 0.6, 1]).tolist() == [0.2, 0.2, 0.5, 0.8]
    assert sample.mean == pytest.approx(0.425)
    assert sample.fraction_within(0.3, 0.9) == pytest.approx(0.5)
    many = drawn(TRUE, 50_000, 1)
    assert many.fraction_within(*many.limits(0.99)) == pytest.approx(0.99, abs=1e-4)


@pytest.mark.parametrize("weighted", [False, True])
def test_fit_equals_brute_force_least_squares(weighted):
    rng = np.random.default_rng(2)
    sample = AreaWeighted.from_values(
        TRUE(LAW.sample(50, rng)), rng.random(50) if weighted else None
    )
    assert FIT.slopes(sample) == pytest.approx(staircase_fit(sample), abs=1e-4)


def rises(radius):
    """Whether a cubic map never falls: the least of its slope at the ends and where it turns."""
    slope = np.polynomial.Polynomial(radius.monomials).deriv()
    turning = slope.deriv().roots().real
    return bool(min(slope(x) for x in (0, 1, *turning[(turning > 0) & (turning < 1)])) >= 0)


def test_fit_stays_monotone_and_nearest():
    rng = np.random.default_rng(3)
    steep = 0.13 + 0.74 * rng.random(400) ** 6
    for values in (rng.choice([0.14, 0.86], 400), np.full(400, 0.5), steep):
        sample = AreaWeighted.from_values(values)
        slopes = FIT.slopes(sample)
        fitted = FIT.map(slopes)
        assert rises(fitted)
        for nudge in ((0.05, 0), (-0.05, 0), (0, 0.05), (0, -0.05)):
            other = np.array(slopes) + nudge
            if (other >= 0).all() and rises(HermiteMap(0.13, other[0], 0.87, other[1])):
                assert FIT.misfit(sample, slopes) <= FIT.misfit(sample, (other[0], other[1])) + 1e-5


@pytest.mark.parametrize("slopes", [(0.01, 0.5), (2.15, 0.3), (0.3, 2.1)])
def test_supports_hold_the_true_slopes_and_only_monotone_maps(slopes):
    """Near the edge of what is monotone, where a band around the fitted slopes leaves it."""
    true, held, cut = HermiteMap(0.13, slopes[0], 0.87, slopes[1]), 0, 0
    for seed in range(8):
        sample = drawn(true, 150, seed)
        generator = np.random.default_rng(seed)
        band = slope_band(FIT, sample, level=0.95, resamples=60, generator=generator)
        box = least_pbox(FIT, sample, sample.band_half_width(0.95, 60, generator), required=band)
        assert all(rises(FIT.map((a2, a4))) for a2 in box.a2 for a4 in box.a4), seed
        held += all(
            low - 1e-9 <= slope <= high + 1e-9
            for slope, (low, _, high) in zip(slopes, (box.a2, box.a4), strict=True)
        )
        cut += band.monotone_part(FIT) != band
    assert held >= 0.95 * 8 - 3 * np.sqrt(8 * 0.95 * 0.05)
    assert cut > 2


def contained(box: PBox, sample: AreaWeighted, band: float) -> bool:
    """Whether the sample's distribution lies within the p-box, within a band."""
    return box.excess(sample) <= band + 1e-6


def two_sorts(number: int, seed: int) -> AreaWeighted:
    """A sample that no cubic fits: a mixture of two maps."""
    rng = np.random.default_rng(seed)
    theta = LAW.sample(number, rng)
    return AreaWeighted.from_values(
        np.where(rng.random(number) < 0.5, TRUE(theta), HermiteMap(0.13, 0.1, 0.87, 1.2)(theta))
    )


@pytest.mark.parametrize(
    "sample", [two_sorts(3000, 1), drawn(TRUE, 3000, 2)], ids=["mixture", "cubic"]
)
@pytest.mark.parametrize("band", [0.0, 0.01, 0.05])
def test_pbox_contains_the_sample_but_for_the_band(sample, band):
    try:
        box = least_pbox(FIT, sample, band)
    except FailedError:
        assert band == 0.0  # the staircase itself may need steeper ends than a monotone cubic has
        return
    assert contained(box, sample, band)
    exact, _ = integrate.quad(lambda t: np.ptp(box.bounds(np.asarray(t))) * LAW.pdf(t), -3, 3)
    assert box.area == pytest.approx(exact, rel=1e-9, abs=1e-12)
    theta = np.linspace(-3, 3, 301)
    low, high = box.bounds(theta)
    for a2 in box.a2:
        for a4 in box.a4:
            radius = FIT.map((a2, a4))
            assert rises(radius)
            assert (radius(theta) >= low - 1e-12).all()
            assert (radius(theta) <= high + 1e-12).all()


def test_no_smaller_pbox_and_no_shrunken_support_contains_the_sample():
    sample, band = two_sorts(2000, 3), 0.005
    box = least_pbox(FIT, sample, band)
    assert contained(box, sample, band)
    ends = np.array([box.a2, box.a4])
    for slope, end in product((0, 1), (0, 2)):
        shrunken = ends.copy()
        shrunken[slope, end] += 0.2 * (ends[slope, 1] - ends[slope, end])
        if abs(ends[slope, end] - ends[slope, 1]) >= 1e-3:
            assert not contained(PBox(FIT, *(SlopeEnds(*x) for x in shrunken)), sample, band), (
                slope,
                end,
            )
    rng = np.random.default_rng(0)
    reach = np.maximum(np.abs(ends - ends[:, 1:2]), [0, 0, 0.02]) * [-1, 0, 1]
    for _ in range(150):
        other = PBox(FIT, *(SlopeEnds(*x) for x in ends[:, 1:2] + 2 * rng.random((2, 3)) * reach))
        if other.area < box.area * 0.999:
            assert not contained(other, sample, band)


def test_hopeless_samples_are_refused():
    half = np.concatenate([np.full(500, 0.14), np.full(500, 0.86)])
    with pytest.raises(FailedError, match=r"no p-box of monotone cubics from 0\.13 to 0\.87"):
        least_pbox(FIT, AreaWeighted.from_values(half), 0.01)
    alike = AreaWeighted.from_values([0.2, 0.3], groups=[0, 0])
    with refuses("groups of the bootstrap"):
        alike.band_half_width(0.9, 10, np.random.default_rng(0))
    with refuses("limits"):
        drawn(TRUE, 100, 0).truncated(0.5, 0.5001)


@pytest.mark.parametrize(("level", "limit"), [(0.5, 0.828), (0.95, 1.358)])
def test_the_bootstrap_band_has_kolmogorovs_quantile(level, limit):
    """√n sup |F* − F| tends to Kolmogorov's law, n the number of groups of like values."""
    count = 900
    for repeats in (1, 4):
        values, groups = np.repeat(
            [np.linspace(0.1, 0.9, count), np.arange(count)], repeats, axis=1
        )
        sample = AreaWeighted.from_values(values, groups=groups)
        band = sample.band_half_width(level, 2000, np.random.default_rng(7))
        assert np.sqrt(count) * band == pytest.approx(limit, rel=0.06)


def test_few_data_leave_the_slopes_as_fuzzy_as_their_bootstrap_band(rng, monkeypatch):
    """Samples of 60 r_n of a map: the fuzzy slopes contain the map's own, of which they know."""
    monkeypatch.setattr(microstructure, "RESAMPLES", 100)
    truth, count = HermiteMap(0.15, 0.3, 0.85, 0.4), 0
    for seed in range(10):
        values = truth(truth.distribution.quantile(rng.random(60)))
        sample = AreaWeighted.from_values(values, groups=np.arange(60) % 6)
        pbox = fit_map(RadiusLimits(DISCS, (0.15, 0.85)), sample, seed=seed).pbox
        count += pbox.a2[0] <= truth.a2 <= pbox.a2[2] and pbox.a4[0] <= truth.a4 <= pbox.a4[2]
    # The band's confidence is 99 % with many groups. Of 1,000 samples with six groups 3 % are
    # missed, hence six of ten in one of 7 million draws.
    assert count >= 5


def test_discs_tighter_than_their_cells_count_as_touching_them():
    """A tenth of the area lies in cells of r_n = 1.05: it is taken at 0.99."""
    radii = np.r_[np.linspace(0.4, 0.9, 90), np.full(10, 1.05)]
    sample = AreaWeighted.from_values(radii, np.ones(100), np.arange(100) % 5)
    rule = RadiusLimits(DISCS)
    capped = rule.capped(sample)
    assert capped.values.max() == DISCS.reach == 0.99
    assert capped.mean == pytest.approx(0.9 * 0.65 + 0.1 * 0.99, rel=1e-12)
    assert capped.fraction_within(0.95, 0.99) == pytest.approx(0.1, rel=1e-12)
    assert RadiusLimits(DISCS, (0.2, 0.9)).capped(sample) is sample


def test_spheres_that_lose_more_than_15_percent_of_their_cells_are_refused():
    rule = RadiusLimits(SPHERES, packed_fraction=0.4)
    groups = np.arange(100) % 5
    for tight, allowed in ((15, True), (16, False)):
        radii = np.r_[np.linspace(0.4, 0.9, 100 - tight), np.full(tight, 1.05)]
        sample = AreaWeighted.from_values(radii, np.ones(100), groups)
        if allowed:
            assert rule.capped(sample) is sample
        else:
            with refuses("particles"):
                rule.capped(sample)
