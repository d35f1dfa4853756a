"""The product-space model is refined until its own estimate is below the tolerance, and the
estimate covers the true error.
"""

import pytest

from alphacut.rve import Phase
from alphacut.rve.auto.refinement import refined_prism
from alphacut.rve.series.model import SeriesModel
from alphacut.stochastic import HermiteMap

PAPER, MATRIX, INCLUSION = (
    HermiteMap(0.1337, 0.1, 0.8663, 0.1692),
    Phase(20e9, 0.3),
    Phase(80e9, 0.3),
)


@pytest.mark.parametrize("tolerance", [2e-2, 1e-3])
def test_the_estimate_is_below_the_tolerance_and_above_the_error(tolerance):
    (found,) = refined_prism(PAPER, MATRIX, [INCLUSION], tolerance=tolerance)
    (exact,) = SeriesModel().solve(PAPER, MATRIX, [INCLUSION])
    assert abs(found.modulus / exact.modulus - 1) <= found.estimated_error <= tolerance
    assert "mesh size" in found.reason


def test_a_tolerance_out_of_reach_is_said_to_be(monkeypatch):
    monkeypatch.setattr("alphacut.rve.auto.refinement._FINEST", 0.25)
    with pytest.raises(
        RuntimeError, match=r"mesh size 0\.25 with 6 layers leaves a relative error of"
    ):
        refined_prism(PAPER, MATRIX, [INCLUSION], tolerance=1e-9)
