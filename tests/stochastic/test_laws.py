"""Laws of θ and maps of one's own: integrated to the last digits, refused where they are none."""

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from alphacut.stochastic import TruncatedNormal, gauss_rule, require_map


@dataclass(frozen=True)
class Own:
    """A law of SciPy as a user writes it; `off` scales its density wrongly."""

    kind: str = "triang"
    shape: tuple = (0.3,)
    lower: float = 0.0
    upper: float = 1.0
    off: float = 1.0

    def pdf(self, theta):
        return self.off * getattr(stats, self.kind).pdf(theta, *self.shape)

    def cdf(self, theta):
        return getattr(stats, self.kind).cdf(theta, *self.shape)

    def quantile(self, probability):
        return getattr(stats, self.kind).ppf(probability, *self.shape)


EXPONENTS = [(1, 1), (2, 5), (1.3, 1.7), (60, 40), (600, 600), (1000, 1000), (1000, 1), (2, 1000)]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("points", [5, 120])
@pytest.mark.parametrize("exponents", EXPONENTS)
def test_gauss_rule_has_the_moments_of_the_law(exponents, points):
    rule, (p, q), exact = gauss_rule(Own("beta", exponents), points=points), exponents, 1.0
    for power in range(10):
        assert rule.weights @ rule.nodes**power == pytest.approx(exact, rel=1e-11)
        exact *= (p + power) / (p + q + power)


def test_a_support_is_no_narrower_than_its_rounding_allows():
    """Beside 10 a width of 1e-6 keeps nine digits: too few for the integral of the density."""
    ends = 9.999, 10.0
    rule = gauss_rule(TruncatedNormal(*ends), points=5)
    assert rule.weights.sum() == pytest.approx(1, abs=1e-12)
    assert ends[0] < rule.mean(rule.nodes) < ends[1]
    with pytest.raises(ValueError, match=r"two finite ends, rising, 0\.001 or more apart"):
        TruncatedNormal(9.999999, 10.0)
    with pytest.raises(ValueError, match=r"0\.0001 or more apart"):  # standard deviations
        TruncatedNormal(0.0, 1e-6)


@pytest.mark.parametrize("law", [Own(), Own("rv_histogram"), Own("beta", (3.5, 1.2))], ids=str)
def test_corners_and_jumps_of_a_density_are_integrated(law):
    if law.kind == "rv_histogram":  # density 1.6 below 1/4 and 0.8 above: a jump
        law = Step()
    rule, theta = gauss_rule(law, points=12), (np.arange(200_000) + 0.5) / 200_000
    by_quantiles = np.mean(np.exp(2 * law.quantile(theta)))
    assert rule.mean(np.exp(2 * rule.nodes)) == pytest.approx(by_quantiles, rel=1e-8)
    assert rule.weights.sum() == pytest.approx(1, abs=1e-12)


class Step:
    """Density 1.6 on [0, 1/4] and 0.8 on [1/4, 1]."""

    lower, upper = 0.0, 1.0

    def pdf(self, theta):
        return np.where(np.asarray(theta) < 0.25, 1.6, 0.8)

    def cdf(self, theta):
        return np.interp(theta, [0, 0.25, 1], [0, 0.4, 1])

    def quantile(self, probability):
        return np.interp(probability, [0, 0.4, 1], [0, 0.25, 1])


def test_density_that_is_not_of_its_distribution_is_refused():
    with pytest.raises(ValueError, match="pdf must be the derivative of cdf"):
        gauss_rule(Own(off=1.01), points=4)


class Wide:
    """A radius map of a user that leaves the cell."""

    def __init__(self, law=None, rise=0.5):
        self.distribution, self.rise = law or TruncatedNormal(), rise

    def __call__(self, theta):
        return 0.5 + self.rise * np.asarray(theta)


@pytest.mark.parametrize(
    ("radius", "words"),
    [
        (Wide(), r"r at θ = -3 is -1; allowed: radii inside \(0, 1\)"),
        (Wide(Own(upper=np.inf)), "two finite ends"),
        (Wide(rise=np.zeros((1, 1))), r"is \(1, 65\); allowed: the shape of θ"),
        (0.5, "radius map is float; allowed: functions of θ"),
    ],
)
def test_maps_that_are_none_are_refused(radius, words):
    with pytest.raises(ValueError, match=words):
        require_map(radius)
