"""The law of θ, the radius map and the θ-rules: against independent integrals, with measured
degrees and orders.
"""

import numpy as np
import pytest
from scipy import stats

from alphacut.stochastic import HermiteMap, TruncatedNormal, gauss_rule
from alphacut.stochastic.theta.quadrature import between_nodes, level_rule

PAPER = dict(a1=0.1337, a2=0.1, a3=0.8663, a4=0.1692)
SUPPORTS = [(-3.0, 3.0), (-1.0, 4.0), (5.0, 8.0), (-9.0, -6.5)]


@pytest.mark.parametrize("support", SUPPORTS)
def test_law_is_scipys_truncated_normal(support):
    law, reference = TruncatedNormal(*support), stats.truncnorm(*support)
    theta = np.linspace(*support, 31)
    assert law.pdf(theta) == pytest.approx(reference.pdf(theta), rel=1e-10)
    assert law.cdf(theta) == pytest.approx(reference.cdf(theta), rel=1e-10, abs=1e-15)
    assert law.quantile(law.cdf(theta)) == pytest.approx(theta, abs=1e-8)
    assert law.pdf([support[0] - 1e-9, support[1] + 1e-9]).tolist() == [0, 0]


@pytest.mark.parametrize("support", [(3, -3), (0, 0), (np.nan, 1), (0, np.inf)])
def test_bad_support_is_refused(support):
    with pytest.raises(ValueError, match="two finite ends"):
        TruncatedNormal(*support)


def test_what_the_law_gives_no_probability_is_refused():
    with pytest.raises(ValueError, match="no probability"):
        TruncatedNormal(50, 51)
    with pytest.raises(ValueError, match=r"1\.5; allowed: values in"):
        TruncatedNormal().quantile([0.5, 1.5])
    with pytest.raises(ValueError, match="from 1 on"):
        gauss_rule(TruncatedNormal(), points=0)


def test_map_takes_its_ends_and_slopes():
    radius, step = HermiteMap(**PAPER), 1e-6
    assert radius([-3, 3]).tolist() == [pytest.approx(0.1337), pytest.approx(0.8663)]
    differences = [6 * (radius(-3 + step) - radius(-3)), 6 * (radius(3) - radius(3 - step))]
    assert np.array(differences) / step == pytest.approx([0.1, 0.1692], rel=1e-5)
    xi = np.linspace(0, 1, 11)  # eq. 12 as printed
    h1, h2 = (1 + 2 * xi) * (1 - xi) ** 2, xi * (1 - xi) ** 2
    printed = np.dot(list(PAPER.values()), [h1, h2, 1 - h1, xi**2 * (xi - 1)])
    assert radius(6 * xi - 3) == pytest.approx(printed, abs=1e-15)


@pytest.mark.parametrize(
    "case", [PAPER, dict(a1=0.5, a2=1.2, a3=0.5, a4=1.2), dict(a1=0.3, a2=0.0, a3=0.4, a4=2.0)]
)
def test_extremes_against_dense_sampling(case):
    radius = HermiteMap(**case)
    dense = radius(np.linspace(-3, 3, 200_001))
    assert radius.extremes() == pytest.approx((dense.min(), dense.max()), abs=1e-10)


@pytest.mark.parametrize(
    "change",
    [dict(a1=0.0), dict(a3=1.0), dict(a2=9.0), dict(a4=9.0), dict(a2=np.nan), dict(a1=np.inf)],
)
def test_radius_outside_the_cell_is_refused(change):
    with pytest.raises(ValueError, match=r"inside \(0, 1\)"):
        HermiteMap(**(PAPER | change))


@pytest.mark.parametrize("support", SUPPORTS)
@pytest.mark.parametrize("points", [1, 2, 5, 12])
def test_gauss_rule_has_its_degree_and_no_more(support, points):
    law = TruncatedNormal(*support)
    middle, half = sum(support) / 2, (support[1] - support[0]) / 2
    rules = gauss_rule(law, points=points), level_rule(law, np.linspace(*support, 41), points=20)

    def error(degree: int) -> float:
        first, second = (x.mean(((x.nodes - middle) / half) ** degree) for x in rules)
        return abs(first - second)

    assert max(error(k) for k in range(2 * points)) < 1e-13
    assert error(2 * points) > 1e-10


@pytest.mark.parametrize("points", [1, 2, 3])
def test_a_rule_between_levels_has_order_twice_its_points(points):
    law, exact = TruncatedNormal(), gauss_rule(TruncatedNormal(), points=30)
    truth = exact.mean(np.exp(exact.nodes / 2))
    errors = []
    for layers in (24, 48):
        rule = level_rule(law, np.linspace(-3, 3, layers + 1), points=points)
        errors.append(abs(rule.mean(np.exp(rule.nodes / 2)) - truth))
    assert errors[1] > 1e-14
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2 * points, abs=0.15)


AT = np.linspace(-3, 3, 61)


def wave(theta):
    return 1 / (1 + np.exp(-theta))


@pytest.mark.parametrize(("points", "error"), [(10, 3e-3), (14, 4e-4), (20, 3e-5)])
def test_the_error_falls_with_the_nodes_of_a_gauss_rule(points, error):
    nodes = gauss_rule(TruncatedNormal(), points=points).nodes
    assert np.abs(between_nodes(nodes, wave(nodes), AT) - wave(AT)).max() < error


def test_other_nodes_are_joined_without_overshoot():
    nodes = level_rule(TruncatedNormal(), np.linspace(-3, 3, 13), points=3).nodes
    curve = between_nodes(nodes, np.sign(nodes), AT)
    assert np.abs(curve[(nodes[0] <= AT) & (nodes[-1] >= AT)]).max() <= 1 + 1e-12
