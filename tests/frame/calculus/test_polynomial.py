"""Polynomials on as many points as they have terms."""

import numpy as np
import pytest
from numpy.polynomial.chebyshev import chebvander

from alphacut.frame.calculus.polynomial import LowerGrid


@pytest.mark.parametrize(("degrees", "excess"), [((1,), 4), ((1, 0, 2), 3), ((1,) * 6, 4)])
def test_a_lower_set_gives_back_the_coefficients_of_its_polynomials(
    degrees: tuple[int, ...], excess: int
) -> None:
    grid = LowerGrid(degrees, excess)
    over = np.maximum(grid.index - degrees, 0).sum(1)
    assert len(grid) == len(np.unique(grid.index, axis=0)) == len(grid.points)
    assert over.max() == excess
    wanted = np.random.default_rng().standard_normal((len(grid), 2)) * [1, 1j]
    terms = np.ones((len(grid), len(grid)))
    for axis in range(len(degrees)):
        terms *= chebvander(grid.points[:, axis], grid.index.max())[:, grid.index[:, axis]]
    assert grid.coefficients(terms @ wanted) == pytest.approx(wanted, abs=1e-10)
