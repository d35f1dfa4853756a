"""The tall frame shaken at E-Defense is no shear frame with such stiffnesses: it is refuted."""

import pytest

from alphacut.frame.identify import RefutedError, identify
from alphacut.fuzzy import Interval
from benchmarks.frame.measured_frames import STIFFNESS, tall_frame, tall_modes, tall_rows


@pytest.mark.parametrize("modes", [(1, 2, 3), (1, 3)])
def test_its_three_modes_together_refute_it(modes):
    prior = {f"c{z + 1}": Interval(0.7 * k, 1.3 * k) for z, k in enumerate(STIFFNESS / 12)}
    with pytest.raises(RefutedError, match="refuted"):
        identify(tall_frame(), prior, tall_modes(modes), alpha=(0.05,))


def test_its_third_mode_lies_outside_the_prediction_of_the_others():
    (row,) = tall_rows()
    assert not row["inside"]
    assert row["measured"] > row["high"]
