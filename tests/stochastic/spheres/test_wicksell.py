import numpy as np
import pytest

from alphacut.stochastic.particles.radius_laws import LogNormalRadii
from alphacut.stochastic.spheres.wicksell import radii_pbox, unfolded
from benchmarks.stochastic.sphere_statistics import circles_of, covered

LIMITS = {"visible": 5e-4, "smallest": 1e-3, "largest": 1.2e-2}


def test_the_pbox_covers_the_truth_and_says_something():
    shares, width = covered(6, 3, bins=12)
    assert min(shares.values()) == 1
    assert width < 0.5


@pytest.mark.slow
def test_the_pbox_covers_in_95_of_100_specimens():
    shares, width = covered(200, 1, bins=16)
    assert min(shares.values()) >= 0.95
    assert width < 0.5


def test_more_circles_narrow_the_pbox():
    law = LogNormalRadii(1e-3, 1e-2)
    generator = np.random.default_rng(4)
    widths = [
        (found.upper - found.lower).mean()
        for found in (
            radii_pbox(circles_of(law, n, generator, 5e-4), **LIMITS, weight="hit", bins=16)
            for n in (100, 1000, 10000)
        )
    ]
    assert widths[0] > 1.4 * widths[1] > 1.7 * widths[2]


def test_circles_of_no_spheres_are_refused():
    """Equal circles come from no spheres: these would show smaller circles as well."""
    from alphacut.stochastic.errors import RefusedError

    with pytest.raises(RefusedError, match="no law of spheres makes these circles"):
        radii_pbox(np.full(2000, 5e-3), **LIMITS)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"weight": "area"}, "the weight is 'area'"),
        ({"level": 1.0}, "the level is 1"),
        ({"visible": 3e-3}, "all greater than 0.003 m"),
        ({"largest": 5e-3}, "the largest 0.005 m"),
        ({"smallest": 4e-4}, "the smallest sphere is 0.0004 m"),
    ],
)
def test_bad_values_are_refused(changed, words):
    with pytest.raises(ValueError, match=words):
        radii_pbox(np.linspace(1e-3, 8e-3, 50), **{**LIMITS, **changed})


def test_it_says_what_is_not_known():
    found = radii_pbox(np.linspace(1e-3, 8e-3, 50), **LIMITS, bins=4)
    assert "what smaller ones there are the section does not tell" in found.unknown


def test_unfolded_circles_give_the_moments_of_the_spheres():
    law, generator = LogNormalRadii(1e-3, 1e-2), np.random.default_rng(6)
    circles = circles_of(law, 20000, generator, 1e-3)
    found = np.array(unfolded(circles, visible=1e-3, largest=1.2e-2).values)
    radii = law.sample(200000, generator)
    for power in (1, 2, 3):
        assert (found**power).mean() == pytest.approx((radii**power).mean(), rel=0.04 * power)
