"""Packings of discs and spheres: what comes out meets the specification."""

from itertools import product

import numpy as np
import pytest
from scipy import stats

from alphacut.fuzzy import FailedError, RefusedError
from alphacut.stochastic import (
    LogNormalRadii,
    MeasuredRadii,
    Particles,
    fit_radius_map,
    gauss_rule,
    microstructure,
    pack,
)
from alphacut.stochastic.particles.packing import random_sequential, relax_random_centres
from tests.refused import refuses

EQUAL, TENFOLD = LogNormalRadii(1e-3, 1e-3), LogNormalRadii(1e-3, 1e-2)


def brute_gap(particles: Particles) -> float:
    """Smallest surface distance over all pairs and images."""
    best = np.inf
    for shift in product((-1, 0, 1), repeat=len(particles.size)):
        apart = particles.centres[:, None] - particles.centres[None] + particles.size * shift
        gap = np.linalg.norm(apart, axis=-1) - particles.radii[:, None] - particles.radii
        if not any(shift):
            np.fill_diagonal(gap, np.inf)
        best = min(best, gap.min())
    return best


@pytest.mark.parametrize(
    ("law", "fraction", "shape"),
    [
        (EQUAL, 0.4, "discs"),
        (TENFOLD, 0.4, "discs"),
        (LogNormalRadii(1e-4, 1e-2), 0.3, "discs"),
        (LogNormalRadii(1e-3, 2e-3), 0.2, "spheres"),
        (EQUAL, 0.72, "discs"),
        (TENFOLD, 0.76, "discs"),
        (LogNormalRadii(1, 2), 0.5, "spheres"),
    ],
)
def test_a_packing_meets_its_specification(law, fraction, shape):
    (packing,) = pack(300, packings=1, fraction=fraction, radii=law, shape=shape, seed=1)
    assert len(packing) % 300 == 0
    assert packing.fraction == pytest.approx(fraction, abs=1e-12)
    assert brute_gap(packing) >= -1e-15
    if law is not EQUAL:
        assert stats.kstest(packing.radii, law.cdf).pvalue > 1e-4


@pytest.mark.parametrize(("shape", "workers"), [("discs", 2), ("spheres", 1)])
def test_one_seed_gives_one_packing_in_any_process(shape, workers, monkeypatch):
    """Nor does the number of packings change one of them, nor a process its cells."""
    monkeypatch.setattr(microstructure, "RESAMPLES", 20)
    options = {"fraction": 0.2, "radii": (1e-3, 1e-2), "shape": shape, "seed": 5}
    alone, more = pack(60, packings=5, **options), pack(60, packings=6, workers=workers, **options)
    for one, other in zip(alone, more[:5], strict=True):
        assert (one.centres == other.centres).all()
    assert not np.isclose(alone[0].centres, alone[1].centres).any()
    if shape == "discs":
        maps = [fit_radius_map(alone, workers=count) for count in (1, workers)]
        for one, other in zip(*(fitted.sections for fitted in maps), strict=True):
            assert (one.cells == other.cells).all()


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"particles": 0}, "particles"),
        ({"packings": 2.5}, "packings"),
        ({"seed": -1}, "seed"),
        ({"shape": "cubes"}, "shape"),
        ({"radii": [1e-3]}, "radii"),
        ({"radii": "1 mm"}, "radii"),
        ({"radii": (2e-3, 1e-3)}, "largest_radius"),
        ({"fraction": 0.9}, "packing.area_fraction"),
    ],
)
def test_arguments_without_meaning_are_refused(changes, key):
    arguments = {"particles": 10, "fraction": 0.2, "radii": (1e-3, 2e-3), **changes}
    with refuses(key):
        pack(**arguments)


def test_a_list_of_two_radii_is_their_range():
    (packing,) = pack(20, packings=1, fraction=0.2, radii=[1e-3, 2e-3])
    assert 1e-3 <= packing.radii.min() <= packing.radii.max() <= 2e-3


@pytest.mark.parametrize("fraction", [0.9, -0.1, np.nan])
def test_a_fraction_without_meaning_is_refused(fraction):
    with refuses("packing.area_fraction") as refused:
        pack(10, fraction=fraction, radii=EQUAL)
    assert refused.value.value == repr(fraction)


def test_what_finds_no_place_fails_with_the_numbers():
    with pytest.raises(FailedError, match="still overlap"):
        relax_random_centres(np.ones(40), np.full(2, 11.5), np.random.default_rng(0))
    assert random_sequential(np.ones(300), np.full(2, 36.0), np.random.default_rng(0)) is None


def test_log_normal_law():
    assert TENFOLD.sigma == pytest.approx(np.log(10) / 6)
    theta = np.linspace(-3, 3, 13)
    assert TENFOLD.cdf(TENFOLD(theta)) == pytest.approx(TENFOLD.distribution.cdf(theta), abs=1e-12)
    assert TENFOLD([-3, 3]) == pytest.approx([1e-3, 1e-2])
    radii = TENFOLD.sample(200_000, np.random.default_rng(0))
    rule = gauss_rule(TENFOLD.distribution, points=40)
    assert (radii**2).mean() == pytest.approx(rule.mean(TENFOLD(rule.nodes) ** 2), rel=0.02)
    assert TENFOLD.cdf([0.0, 5e-4, 2e-2]).tolist() == [0, 0, 1]


@pytest.mark.parametrize("radii", [(2.0, 1.0), (1e-303, 1.0), (1.0, 1e308), (np.nan, 1.0)])
def test_radii_of_no_particle_are_refused(radii):
    with pytest.raises(RefusedError, match="radii from"):
        LogNormalRadii(*radii)


def test_a_measured_law_takes_its_values_in_equal_shares():
    law = MeasuredRadii((3e-3, 1e-3, 2e-3, 2e-3))
    assert law.cdf([0.5e-3, 1e-3, 1.5e-3, 2e-3, 3e-3]).tolist() == pytest.approx(
        [0, 0, 1 / 6, 2 / 3, 1]
    )
    radii = law.sample(20_000, np.random.default_rng(1))
    assert (radii.min(), radii.max()) == pytest.approx((1e-3, 3e-3), rel=1e-3)
    assert MeasuredRadii((1e-3,)).sample(3, np.random.default_rng(1)).tolist() == [1e-3] * 3
