"""The product space under another law of θ: against the exact series of the same law."""

import numpy as np
import pytest

pytest.importorskip("alphacut.rve.fenicsx")

from alphacut.rve.cell.cell import Phase
from alphacut.rve.prism.model import PrismModel
from alphacut.rve.series.model import SeriesModel
from alphacut.stochastic import HermiteMap
from tests.stochastic.test_laws import Own

MATRIX, PARTICLE = Phase(20e9), Phase(80e9)


def test_prisms_take_the_law_of_the_series():
    radius = HermiteMap(0.2, 0.1, 0.8, 0.2, Own("beta", (2, 4)))
    exact = SeriesModel().solve(radius, MATRIX, [PARTICLE])[0].modulus
    found = PrismModel(0.3, 6).solve(radius, MATRIX, [PARTICLE])[0].modulus
    assert found == pytest.approx(exact, rel=2e-3)
    plain = HermiteMap(0.2, 0.1, 0.8, 0.2)
    assert SeriesModel().solve(plain, MATRIX, [PARTICLE])[0].modulus != pytest.approx(
        exact, rel=6e-3
    )


class Empty(Own):
    """A law without density in the lower half."""

    def pdf(self, theta):
        return np.where(np.asarray(theta) < 0.5, 0.0, 2.0)


def test_layers_without_probability_are_refused():
    with pytest.raises(ValueError, match=r"density of θ at .* is 0; allowed: positive densities"):
        PrismModel(0.3, 4).solve(HermiteMap(0.2, 0.1, 0.8, 0.2, Empty()), MATRIX, [PARTICLE])
