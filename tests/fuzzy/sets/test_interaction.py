"""An ellipsoid has in each cut the half axes of the cut's own interval."""

import numpy as np
import pytest

from alphacut.fuzzy import Ellipsoidal, Triangular


@pytest.mark.parametrize("alpha", [0.0, 0.25, 0.5, 0.75])
def test_the_ends_of_every_cut_lie_on_the_ellipsoid(alpha):
    inputs = {"x": Triangular(0.0, 1.0, 3.0), "y": Triangular(-2.0, 0.0, 1.0)}
    lower, upper = inputs["x"].cut(alpha)
    on = np.array([[lower, 0.0], [upper, 0.0], [1.0, inputs["y"].cut(alpha).upper]])
    slack = Ellipsoidal({("x", "y"): 0.0}).slack(on, inputs, alpha)
    np.testing.assert_allclose(slack, 0.0, atol=1e-12)
