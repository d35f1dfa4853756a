"""The exact cell under other laws of θ and other maps, against a quadrature in probability."""

import numpy as np
import pytest
from scipy import stats
from scipy.interpolate import make_interp_spline

from alphacut.rve.cell.cell import Phase
from alphacut.rve.result.moduli import square_moduli
from alphacut.rve.series.model import SeriesModel, square_stiffness
from alphacut.stochastic import HermiteMap
from tests.stochastic.test_laws import Own

MATRIX, PARTICLE = Phase(20e9), Phase(80e9)


class Cornered:
    """A map of a user, under a law with a corner."""

    class distribution:  # noqa: N801 - an instance is not needed
        lower, upper = 0.0, 1.0
        pdf = staticmethod(stats.triang(0.3).pdf)
        cdf = staticmethod(stats.triang(0.3).cdf)
        quantile = staticmethod(stats.triang(0.3).ppf)

    def __call__(self, theta):
        return 0.3 + 0.5 * np.asarray(theta, float)


MAPS = {
    "uniform": HermiteMap(0.1337, 0.1, 0.8663, 0.1692, Own("uniform", ())),
    "beta": HermiteMap(0.1337, 0.1, 0.8663, 0.1692, Own("beta", (2, 5))),
    "user": Cornered(),
}


def mean_moduli(radius, shares):
    """Mean C11 + C12 and C33 over shares of probability, from a spline over the radius."""
    radii = radius(radius.distribution.quantile(shares))
    grid = np.linspace(radii.min() - 1e-9, radii.max() + 1e-9, 40)
    exact = square_moduli(square_stiffness(grid, MATRIX, [PARTICLE], tolerance=1e-9).matrix[:, 0])
    return make_interp_spline(grid, exact[:, [0, 2]], k=7)(radii)


@pytest.mark.parametrize("name", MAPS)
def test_mean_is_that_over_quantiles(name):
    found = SeriesModel().solve(MAPS[name], MATRIX, [PARTICLE])[0]
    even = mean_moduli(MAPS[name], (np.arange(200_000) + 0.5) / 200_000).mean(axis=0)
    assert found.moduli[[0, 2]] == pytest.approx(even, rel=2e-6)
    other = SeriesModel().solve(HermiteMap(0.1337, 0.1, 0.8663, 0.1692), MATRIX, [PARTICLE])[0]
    assert (abs(other.moduli[[0, 2]] / even - 1) > 1e-3).any()  # the law is seen
