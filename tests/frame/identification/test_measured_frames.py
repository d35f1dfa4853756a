"""The tall frame shaken at E-Defense is no shear frame with such stiffnesses: it is refuted.

A steel frame of 18 storeys at a third of its scale, measured at every third floor (Suita, Suzuki and
Takahashi, International Journal of High-Rise Buildings 4, 2015); modes, weights and stiffnesses as
published with the package SMU (github.com/ywang-structures/Structural-Model-Updating, folder
Examples/EighteenStoryStructure). Masses were weighed; stiffnesses may be 30 % off. No scatter was
published: 1 % of a frequency and 2 % of a shape are assumed.
"""

import numpy as np
import pytest

from alphacut.frame import StoreyFrame, identify, measured_mode
from alphacut.fuzzy import Interval

FLOORS = (3, 6, 9, 12, 15, 18)
FREQUENCIES = (0.86517642, 2.68683262, 4.84910401)
SHAPES = (
    (0.19734211, 0.39201274, 0.57866593, 0.75191915, 0.90246834, 1.0),
    (-0.6084212, -0.89503499, -0.7511404, -0.22071769, 0.50537524, 1.0),
    (0.90395832, 0.62024159, -0.46043073, -0.96783845, -0.04978843, 1.0),
)
STIFFNESS = 1e5 * np.array(
    [1155, 1092, 1073, 1028, 1028, 990, 963, 938, 876, 840, 824, 788, 712, 660, 619, 562, 491, 363]
)
WEIGHT = 1e3 * np.array([208] * 11 + [206] * 6 + [202])
COLUMNS = STIFFNESS / 12
FRAME = StoreyFrame([*WEIGHT / 9.8], [1.0] * 18, 1.0, 1.0, columns=[*COLUMNS])


def identified(modes):
    """What is learned from some of the measured modes."""
    measured = [
        measured_mode(
            mode,
            [FREQUENCIES[mode - 1]],
            {floor: [x] for floor, x in zip(FLOORS, SHAPES[mode - 1], strict=True)},
            frequency_deviation=0.01,
            shape_deviation=0.02,
        )
        for mode in modes
    ]
    prior = {f"c{z + 1}": Interval(0.7 * k, 1.3 * k) for z, k in enumerate(COLUMNS)}
    return identify(FRAME, prior, measured, alpha=(0.05,))


@pytest.mark.parametrize("modes", [(1, 2, 3), (1, 3)])
def test_its_three_modes_together_refute_it(modes):
    assert identified(modes).is_refuted


def test_its_third_mode_lies_outside_the_prediction_of_the_others():
    assert FREQUENCIES[2] > identified((1, 2)).predictions().upper[0, 2]
