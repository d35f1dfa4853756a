"""Packings: what is handed out is what was asked for, and what cannot be is refused with the
numbers.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from scipy import stats
from scipy.spatial.distance import pdist

from alphacut.stochastic.errors import RefusedError
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.packing import Packing, packings
from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.particles.relaxation import Relaxation, close_pairs, relaxed, smallest_gap
from alphacut.stochastic.theta.quadrature import gauss_rule

EQUAL, TENFOLD, HUNDREDFOLD = (
    LogNormalRadii(1e-3, 1e-3),
    LogNormalRadii(1e-3, 1e-2),
    LogNormalRadii(1e-4, 1e-2),
)


def brute_gap(discs: Discs) -> float:
    """Smallest surface distance over all pairs and nine images."""
    best = np.inf
    for shift in ((i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)):
        apart = discs.centres[:, None] - discs.centres[None] + discs.size * shift
        gap = np.hypot(apart[..., 0], apart[..., 1]) - discs.radii[:, None] - discs.radii
        if shift == (0, 0):
            np.fill_diagonal(gap, np.inf)
        best = min(best, gap.min())
    return best


@pytest.mark.parametrize("method", ["auto", "sequential", "relaxed"])
@pytest.mark.parametrize(
    ("law", "fraction", "gap"),
    [
        (EQUAL, 0.2, 0.0),
        (EQUAL, 0.4, 1e-4),
        (TENFOLD, 0.4, 0.0),
        (TENFOLD, 0.2, 1e-3),
        (HUNDREDFOLD, 0.3, 0),
    ],
)
def test_packing_meets_the_wish(law, fraction, gap, method):
    discs = Packing(400, fraction, law, gap, method).make(np.random.default_rng(1))
    assert len(discs) == 400
    assert discs.area_fraction == pytest.approx(fraction, abs=1e-12)
    assert brute_gap(discs) >= gap - 1e-15
    assert (
        stats.kstest(discs.radii, law.cdf).pvalue > 1e-4
        if law is not EQUAL
        else (discs.radii == 1e-3).all()
    )


@pytest.mark.parametrize(
    ("law", "fraction"), [(EQUAL, 0.6), (TENFOLD, 0.6), (EQUAL, 0.72), (TENFOLD, 0.76)]
)
def test_dense_packings_beyond_sequential_addition(law, fraction):
    discs = Packing(500, fraction, law).make(np.random.default_rng(2))
    assert brute_gap(discs) >= 0
    assert discs.area_fraction == pytest.approx(fraction, abs=1e-12)
    with pytest.raises(RefusedError, match=r"found no place for \d+ of"):
        Packing(500, fraction, law, method="sequential").make(np.random.default_rng(2))


@pytest.mark.parametrize("discs", [1, 2, 3, 7])
def test_few_discs(discs):
    packing = Packing(discs, 0.4, EQUAL).make(np.random.default_rng(0))
    assert brute_gap(packing) >= 0
    assert smallest_gap(packing) == pytest.approx(min(brute_gap(packing), packing.size[0] - 2e-3))


def test_one_seed_gives_one_packing_whatever_the_workers():
    wish = Packing(200, 0.3, TENFOLD)
    alone = list(packings(wish, 4, seed=5))
    with ThreadPoolExecutor(3) as pool:
        shared = list(packings(wish, 4, seed=5, executor=pool))
    more = list(packings(wish, 6, seed=5))
    for a, b, c in zip(alone, shared, more[:4], strict=True):
        assert (a.centres == b.centres).all()
        assert (a.centres == c.centres).all()
    assert not np.isclose(alone[0].centres, alone[1].centres).any()


def test_refused_for_another_number_fraction_gap_or_law():
    wish = Packing(300, 0.3, TENFOLD, gap=1e-4)
    good = wish.make(np.random.default_rng(3))
    wish.check(good)
    with pytest.raises(RefusedError, match="299 discs where 300"):
        wish.check(Discs(good.centres[1:], good.radii[1:], good.size))
    with pytest.raises(RefusedError, match=r"area fraction 0\.29"):
        wish.check(Discs(good.centres, good.radii * 0.99, good.size))
    with pytest.raises(RefusedError, match="gap of"):
        wish.check(Discs(good.centres * [1, 0.5], good.radii, good.size))
    with pytest.raises(RefusedError, match="differ from their law"):
        Packing(300, 0.3, LogNormalRadii(1e-3, 2e-2)).check(good)
    with pytest.raises(RefusedError, match="differ from their law"):
        Packing(300, 0.3, EQUAL).check(good)


def test_impossible_wishes_are_refused_with_the_numbers():
    with pytest.raises(RefusedError, match=r"1\.098.* still overlap"):
        relaxed(
            np.ones(100),
            np.sqrt(100 * np.pi / 0.83),
            gap=0.3,
            generator=np.random.default_rng(0),
            rule=Relaxation(steps=200),
        )
    with pytest.raises(RefusedError, match="does not fit"):
        Packing(1, 0.8, EQUAL, gap=1e-3).make(np.random.default_rng(0))


def test_sequential_centres_are_uniform_and_without_direction():
    packing = Packing(2000, 0.2, TENFOLD, method="sequential").make(np.random.default_rng(4))
    assert stats.kstest((packing.centres / packing.size).ravel(), "uniform").pvalue > 1e-4
    first, second = close_pairs(packing, 2e-3)
    apart = packing.separation(first, second)
    assert (
        stats.kstest(np.mod(np.arctan2(apart[:, 1], apart[:, 0]), np.pi) / np.pi, "uniform").pvalue
        > 1e-4
    )


def test_shaking_brings_discs_nearer_than_pushing_left_them():
    still = relaxed(
        np.ones(400),
        np.sqrt(400 * np.pi / 0.6),
        gap=0.0,
        generator=np.random.default_rng(1),
        rule=Relaxation(sweeps=0),
    )
    shaken = relaxed(
        np.ones(400), np.sqrt(400 * np.pi / 0.6), gap=0.0, generator=np.random.default_rng(1)
    )
    nearest = [np.sort(pdist(centres) - 2)[:400] for centres in (still, shaken)]
    assert nearest[1][:40].mean() < 0.5 * nearest[0][:40].mean()


def test_close_pairs_are_all_found():
    discs = Packing(300, 0.3, HUNDREDFOLD).make(np.random.default_rng(6))
    first, second = close_pairs(discs, 1e-3)
    apart = discs.separation(np.arange(300)[:, None], np.arange(300)[None])
    near = np.hypot(apart[..., 0], apart[..., 1]) - discs.radii[:, None] - discs.radii < 1e-3
    assert sorted(map(tuple, np.sort(np.stack([first, second]), axis=0).T)) == list(
        zip(*np.nonzero(np.triu(near, 1)), strict=True)
    )


def test_log_normal_law():
    assert TENFOLD.sigma == pytest.approx(np.log(10) / 6)
    theta = np.linspace(-3, 3, 13)
    assert TENFOLD.cdf(TENFOLD(theta)) == pytest.approx(TENFOLD.distribution.cdf(theta), abs=1e-12)
    assert TENFOLD([-3, 3]) == pytest.approx([1e-3, 1e-2])
    radii = TENFOLD.sample(200_000, np.random.default_rng(0))
    rule = gauss_rule(TENFOLD.distribution, points=40)
    square = rule.mean(TENFOLD(rule.nodes) ** 2)
    assert (radii**2).mean() == pytest.approx(square, rel=0.02)
    assert TENFOLD.cdf([0.0, 5e-4, 2e-2]).tolist() == [0, 0, 1]
    with pytest.raises(ValueError, match="smallest <= largest"):
        LogNormalRadii(2.0, 1.0)


def test_a_gap_wider_than_the_square_is_named_as_the_culprit():
    with pytest.raises(RefusedError, match=r"gap 1 m does not fit.*smaller gap"):
        Packing(50, 0.2, LogNormalRadii(1e-3, 2e-3), gap=1.0).make(np.random.default_rng(1))
