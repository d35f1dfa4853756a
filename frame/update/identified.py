"""Directions of the parameters along which a measurement teaches something, and those it does not.

In logarithms of the parameters, measured in half widths of the priors, the measured quantities
change by their slopes, measured in half widths of their cuts. Singular values well below 1 belong
to directions in which the measured cuts leave the priors as they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from alphacut.frame.calculus.jet import Array

if TYPE_CHECKING:
    from alphacut.frame.update.agreement import Agreement

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
        """Whether the measurement narrows it."""
        return self.gain >= TAUGHT

    @property
    def words(self) -> str:
        """The parameters that change together."""
        largest = max(abs(x) for x in self.parts.values())
        named = {k: x for k, x in self.parts.items() if abs(x) >= PART * largest}
        up = ", ".join(name for name, x in named.items() if x > 0)
        down = ", ".join(name for name, x in named.items() if x < 0)
        alike = max(map(abs, named.values())) < 1.2 * min(map(abs, named.values()))
        if len(named) == 1:
            return up
        if not down:
            return f"{'the common factor of' if alike else 'larger together'} {up}"
        return f"larger {up} with smaller {down}"


def directions(agreement: Agreement, at: Array) -> tuple[Direction, ...]:
    """All directions, most learned first, at log parameters (d,)."""
    d = len(at)
    from alphacut.frame.update.agreement import widest

    widths = np.array([np.ptp(np.log(np.array(widest(x)))) / 2 for x in agreement.prior.values()])
    slopes = agreement.slopes(at)[d:] * widths
    _, size, parts = np.linalg.svd(slopes, full_matrices=True)
    gains = np.append(size, np.zeros(max(d - len(size), 0)))[:d]
    found = []
    for gain, row in zip(gains, parts, strict=True):
        moved = row * widths
        length = float(np.linalg.norm(moved))
        moved = moved / (length or 1.0) * np.sign(row[int(np.abs(row).argmax())])
        found.append(
            Direction(dict(zip(agreement.chain.names, map(float, moved), strict=True)), float(gain))
        )
    return tuple(found)
