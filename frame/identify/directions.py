"""Directions of the parameters along which a measurement narrows them, and those it does not.

In logarithms of the parameters, measured in half widths of the priors, the measured quantities
change by their slopes, measured in half widths of their cuts. Singular values well below 1 belong
to directions in which the measured cuts leave the priors as they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.identify.possibility import Agreement, widest
from alphacut.fuzzy.arrays import Array

TAUGHT = 2.0
"""Least change of a measured quantity over a prior's half width, in half widths of its cut."""
PART = 0.2
"""Share of the largest part of a direction from which on a parameter is named."""


@dataclass(frozen=True)
class Direction:
    """A direction of the log parameters.

    Args:
        parts: Part of each parameter, of length 1 together, largest positive.
        gain: Change of the measured quantities over the priors' half widths, in half widths of
            their cuts.
    """

    parts: dict[str, float]
    gain: float

    @property
    def learned(self) -> bool:
        """True if the measurement narrows it."""
        return self.gain >= TAUGHT

    @property
    def words(self) -> str:
        """Parameters that change together: "larger c1, c2 with smaller E"."""
        least = PART * max(abs(x) for x in self.parts.values())
        up = ", ".join(name for name, x in self.parts.items() if x >= least)
        down = ", ".join(name for name, x in self.parts.items() if -x >= least)
        return f"larger {up}" + (f" with smaller {down}" if down else "")


def directions(agreement: Agreement, at: Array) -> tuple[Direction, ...]:
    """All directions, most learned first, at log parameters (d,)."""
    d = len(at)
    widths = np.array([np.ptp(np.log(widest(x))) / 2 for x in agreement.prior.values()])
    _, size, parts = np.linalg.svd(agreement.slopes(at)[d:] * widths, full_matrices=True)
    gains = np.append(size, np.zeros(max(d - len(size), 0)))[:d]
    result = []
    for gain, row in zip(gains, parts, strict=True):
        moved = row * widths * np.sign(row[int(np.abs(row).argmax())])
        moved = moved / (np.linalg.norm(moved) or 1.0)
        named = dict(zip(agreement.chain.names, map(float, moved), strict=True))
        result.append(Direction(named, float(gain)))
    return tuple(result)
