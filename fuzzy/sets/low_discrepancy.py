"""Points that fill the unit box evenly, for tests that draw nothing."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count

import numpy as np

from alphacut.fuzzy.arrays import Array


def low_discrepancy(dimension: int) -> Iterator[Array]:
    """Yield an infinite sequence of points (d,) that fill the unit box [0, 1]^d evenly.

    It is the additive recurrence x_k = 1/2 + k s mod 1 of Roberts (2018), with s_j = g^(−j) and g
    the positive root of g^(d + 1) = g + 1.
    """
    root = 2.0
    for _ in range(64):  # root^(d + 1) = root + 1
        root = (1 + root) ** (1 / (dimension + 1))
    step = root ** -np.arange(1.0, dimension + 1)
    for k in count(1):
        yield (0.5 + k * step) % 1.0
