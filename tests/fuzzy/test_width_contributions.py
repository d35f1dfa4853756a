"""What an input contributes to the width of a sum is its own width."""

from dataclasses import replace

import numpy as np

from alphacut.fuzzy import Interval, propagate, width_shares


def test_contributions_to_a_sum_are_the_widths_of_its_terms():
    inputs = {"x": Interval(0.0, 3.0), "y": Interval(1.0, 2.0)}

    def bounds(fuzzy):
        return propagate(lambda x, y: x + y, fuzzy, alpha=[0, 1]).bounds()

    found = width_shares(bounds, inputs)
    np.testing.assert_allclose(found.share[:, 0].ravel(), [0.75, 0.25], atol=1e-9)
    said = (
        "share of the width lost where the input is fixed at the middle of its cut at α = 1;"
        " smallest … largest over the levels"
    )
    assert str(found).startswith(f"{said}:")
    assert said in found._repr_html_()
    over_time = replace(found, width=np.ones((2, 3, 1)), lost=np.ones((2, 2, 3, 1)))
    assert "over the levels and times:" in str(over_time)
