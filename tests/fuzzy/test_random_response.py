"""A response that is random at every fuzzy sample: its p-box holds every distribution of the cut."""

import numpy as np
import pytest
from scipy.stats import norm

from alphacut.fuzzy import RandomResponse, Reduced, RefusedError, Triangular, levels, propagate
from alphacut.fuzzy.sets.boxes import Domain

MEAN, SPREAD = Triangular(9.0, 10.0, 12.0), Triangular(1.0, 2.0, 2.5)
NODES = np.linspace(-4, 4, 41)
CUTS = [(MEAN.cut(level), SPREAD.cut(level)) for level in levels(4)]


@pytest.fixture(scope="module")
def response():
    """A normal response with fuzzy mean and spread."""
    inputs = {"m": MEAN, "s": SPREAD}
    samples = propagate(lambda m, s: m + s * NODES, inputs, Reduced()).samples
    domain, curves = Domain(inputs, levels(4)), samples.values.output("y")
    return RandomResponse.from_curves(
        domain, samples.points, curves, theta=NODES, quantile=norm.ppf
    )


def test_fuzzy_mean_is_the_fuzzy_parameter(response):
    lower, upper = response.mean().bounds("mean[0]")
    np.testing.assert_allclose(lower, [mean.lower for mean, _ in CUTS], rtol=1e-12)
    np.testing.assert_allclose(upper, [mean.upper for mean, _ in CUTS], rtol=1e-12)


@pytest.mark.parametrize("probability", [0.05, 0.5, 0.95])
def test_fuzzy_quantiles(response, probability):
    lower, upper = response.quantile(probability).bounds("quantile[0]")
    z = norm.ppf(probability)
    corners = [[m + s * z for m in mean for s in spread] for mean, spread in CUTS]
    np.testing.assert_allclose(lower, np.min(corners, axis=1), rtol=2e-4)
    np.testing.assert_allclose(upper, np.max(corners, axis=1), rtol=2e-4)


def test_p_box_and_exceedance_hold_every_distribution_of_the_cut(response):
    at = np.array([8.0, 10.0, 13.0])
    box, over = response.p_box(at), response.exceedance(at)
    np.testing.assert_allclose(over.lower, 1 - box.upper, atol=1e-12)
    for level, (mean, spread) in enumerate(CUTS):
        corners = np.array([norm.cdf(at, m, s) for m in mean for s in spread])
        np.testing.assert_allclose(box.lower[level], corners.min(axis=0), atol=1e-3)
        np.testing.assert_allclose(box.upper[level], corners.max(axis=0), atol=1e-3)
    assert response.p_box(-100.0).upper.max() == 0
    assert response.p_box(100.0).lower.min() == 1


def test_probabilities_lie_inside_0_and_1(response):
    with pytest.raises(RefusedError) as refused:
        response.quantile(1.0)
    assert refused.value.key == "probability"
