"""The box of all parameters that agree with natural frequencies alone, by branch and bound.

The eigenvalues of a storey frame rise with each stiffness and fall with each mass. So their ranges
over a box of parameters are attained at two of its corners, and a box is refuted if the range of
one eigenvalue misses the measured one. For each side of the box of the set the sub-box that lies
farthest out is bisected until it is small (Moore, Kearfott and Cloud, Introduction to Interval
Analysis, 2009, chapter 5).
"""

from __future__ import annotations

from collections.abc import Sequence
from heapq import heapify, heappop, heappush

import numpy as np

from alphacut.base.arrays import Array
from alphacut.frame.identification.modes import Chain, ModeCut, eigenvalue_ranges

SMALLEST_SIDE = 0.002
"""Side of a sub-box, as a fraction of that of the first box, that is not bisected any more (tuned:
a smaller one makes the box narrower and takes longer)."""
MAX_BISECTIONS = 5000
"""Most bisections for each side of the box (tuned: some seconds for six parameters)."""
SLACK = 1e-12
"""Relative width by which eigenvalues are widened, above the rounding of the measured ones."""


def contracted(
    chain: Chain, lower: Array, upper: Array, modes: Sequence[ModeCut]
) -> tuple[Array, Array] | None:
    """Return a box that contains all parameters whose frequencies are in the measured ranges.

    That the box contains them is proved, also where the bisections are spent.

    Args:
        chain: The frame as a chain of masses on springs, and its uncertain parameters.
        lower: Lower ends of the first box, shape (parameters,): logarithms of the parameters over
            their nominal values.
        upper: Upper ends of the first box.
        modes: Ranges of the eigenvalue of each mode; shapes are not used.

    Returns:
        Lower and upper ends of the box in the same logarithms, within the first box; or None if no
        parameters agree with the modes.
    """
    lower = lower.copy()
    upper = upper.copy()
    widths = np.where(upper > lower, upper - lower, np.inf)
    for side in range(2 * len(lower)):
        parameter, is_upper = divmod(side, 2)
        # The key of a sub-box is its end on this side, turned so that the farthest out is smallest.
        sign = -1.0 if is_upper else 1.0
        count = 0
        queue = [(sign * (upper if is_upper else lower)[parameter], count, lower, upper)]
        heapify(queue)
        for _ in range(MAX_BISECTIONS):
            if not queue:
                return None
            _, _, low, high = queue[0]
            fractions = (high - low) / widths
            axis = int(fractions.argmax())
            if fractions[axis] <= SMALLEST_SIDE:
                break
            heappop(queue)
            middle = (low[axis] + high[axis]) / 2
            for is_above in (False, True):
                low_half = low.copy()
                high_half = high.copy()
                (low_half if is_above else high_half)[axis] = middle
                if _may_agree(chain, low_half, high_half, modes):
                    count += 1
                    end = (high_half if is_upper else low_half)[parameter]
                    heappush(queue, (sign * end, count, low_half, high_half))
        if not queue:
            return None
        (upper if is_upper else lower)[parameter] = sign * queue[0][0]
    return lower, upper


def _may_agree(chain: Chain, lower: Array, upper: Array, modes: Sequence[ModeCut]) -> bool:
    """Return whether the eigenvalues over a box meet all measured ranges."""
    smallest, largest = eigenvalue_ranges(chain, lower, upper)
    for mode in modes:
        is_below = largest[mode.mode - 1] * (1 + SLACK) < mode.low
        is_above = smallest[mode.mode - 1] * (1 - SLACK) > mode.high
        if is_below or is_above:
            return False
    return True
