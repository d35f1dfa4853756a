"""What an input contributes to the width of a sum is its own width."""

import numpy as np

from alphacut.fuzzy import Interval, propagate, width_shares


def test_contributions_to_a_sum_are_the_widths_of_its_terms():
    inputs = {"x": Interval(0.0, 3.0), "y": Interval(1.0, 2.0)}

    def bounds(fuzzy):
        return propagate(lambda x, y: x + y, fuzzy, alpha=[0, 1]).bounds()

    found = width_shares(bounds, inputs)
    np.testing.assert_allclose(found.share[:, 0].ravel(), [0.75, 0.25], atol=1e-9)
