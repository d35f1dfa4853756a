"""Peaks of one output over parts of the box, where models of the whole box are too wide.

Remainders fall with the fourth power of the inputs' widths, and modes part. So a few nodes, those
whose bounds lie above the peak, are bounded over less:

1. Of one input after the other, the half or quarter of its range that lies away from the best
   inputs known is bounded by the models at hand. Where no bound lies above the peak it is taken
   away.
2. What is left is expanded anew. Where that is nearly all, it is first halved, along the input
   whose far quarter came nearest to be taken away.

A node's bound is the largest over all parts, those taken away included. The part with the largest
bound comes first.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.frame.dual.level import Level, Problem
from alphacut.fuzzy.arrays import Array

PIECES = (0.5, 0.25)
"""Shares of an input's range that are tried to be taken away."""
EFFORTS = (1, 24)
"""Slabs of a bound over what may be taken away."""
HOPE = 0.8
"""The effort ends where the gap has fallen by less than this share of an even fall."""
LITTLE = 0.5
"""Shares taken away of all inputs, in sum, below which a part is halved besides."""
SLABS, STEPS = 240, 40
"""Most slabs of a bound over a part, and evaluations for each."""


@dataclass(eq=False)
class Part:
    """A part of the box and the bounds over it.

    Args:
        low: Its lower ends, in unit coordinates of the whole box, shape (d,).
        high: Its upper ends.
        level: Models over the part.
        problem: Bounds and the model's values at J nodes.
    """

    low: Array
    high: Array
    level: Level
    problem: Problem

    @property
    def bound(self) -> Array:
        """Bounds over the part, shape (J,)."""
        return np.asarray(self.problem.out[0])

    @property
    def worst(self) -> float:
        """The largest of them."""
        return float(self.bound.max())

    def whole(self, unit: Array) -> Array:
        """Coordinates of the whole box for those of the part."""
        return np.asarray((self.low + self.high) / 2 + (self.high - self.low) / 2 * unit)


@dataclass(eq=False)
class Peak:
    """Nodes of one output and side whose bounds lie above the peak.

    Args:
        expanded: Models of the output at these nodes over a part of the box, named by its ends.
        motion: Exact values at these nodes for unit coordinates (J, d), on the side, shape (J,).
        inputs: Number of inputs d.
        side: 0 for upper bounds of −output, 1 for those of the output.
        outer: Bounds that are known, shape (J,).
        top: The largest value that is attained.
        enough: Gap above it at which bounds are left.
    """

    expanded: Callable[[Array, Array], Level]
    motion: Callable[[Array], Array]
    inputs: int
    side: int
    outer: Array
    top: float
    enough: float

    def __post_init__(self) -> None:
        self.value = np.full(len(self.outer), -np.inf)
        self.at: Array = np.zeros((len(self.outer), self.inputs))

    def bounds(self, most: int) -> Array:
        """Bounds at the nodes, shape (J,), from `most` parts at most.

        What is attained there is left in `value`, its unit coordinates in `at`.
        """
        gone: Array = np.full(len(self.outer), -np.inf)
        whole = -np.ones(self.inputs), np.ones(self.inputs), self.outer
        ends: list[tuple[Array, Array, Array]] = [whole]
        parts, begun = list[Part](), 0.0
        for count in range(most):
            parts.append(self._part(*ends.pop()))
            if ends:
                continue
            first = max(parts, key=lambda part: part.worst)
            gap = first.worst - self.top
            begun = gap if count == 0 else begun
            even = (begun - self.enough) * count / most
            if gap <= self.enough or gap > begun - HOPE * even:
                break
            parts.remove(first)
            ends, lost = self._shaved(first)
            gone = np.maximum(gone, lost)
        left = [part.bound for part in parts] + [bound for _, _, bound in ends]
        return np.minimum(np.max([gone, *left], axis=0), self.outer)

    def _part(self, low: Array, high: Array, known: Array) -> Part:
        """A part expanded, with bounds at nodes whose bounds known are above the peak."""
        level = self.expanded(low, high)
        part = Part(low, high, level, self._problem(level))
        part.problem.out[0] = known
        part.problem.run(np.flatnonzero(known > self.top + self.enough), SLABS, STEPS, 1.0, 0.0)
        at = part.whole(part.problem.at)
        value = self.motion(at)
        better = value > self.value
        self.value[better], self.at[better] = value[better], at[better]
        self.top = max(self.top, float(self.value.max()))
        return part

    def _problem(self, level: Level) -> Problem:
        return Problem.of(level, 0, self.side, self.enough, self.top)

    def _of_piece(self, part: Part, piece: tuple[Array, Array], slabs: int) -> Array:
        """Bounds over a piece of a part, shape (J,), until one is above the peak."""
        problem = self._problem(part.level.within(*piece))
        problem.out[0] = part.bound
        for node in np.argsort(-part.bound):
            if part.bound[node] > self.top + self.enough:
                problem.run(np.array([node]), slabs, STEPS, 1.0, 0.0)
            if problem.out[0, node] > self.top + self.enough:
                break
        return np.asarray(problem.out[0])

    def _shaved(self, part: Part) -> tuple[list[tuple[Array, Array, Array]], Array]:
        """Boxes left of a part with the bounds known, and bounds over all that is taken away."""
        u = part.problem.at[part.problem.out[1].argmax()]
        low, high, lost = -np.ones_like(u), np.ones_like(u), np.full(len(self.outer), -np.inf)
        nearest = np.full(len(u), np.inf)
        for slabs in EFFORTS:
            for i in range(len(u)):
                for share in PIECES:
                    if high[i] - low[i] < 2.0:
                        break
                    end = (1 - 2 * share) * (-1 if u[i] > 0 else 1)
                    piece = (low.copy(), high.copy())
                    piece[1 if u[i] > 0 else 0][i] = end
                    bound = self._of_piece(part, piece, slabs)
                    nearest[i] = float(bound.max())
                    if nearest[i] <= self.top + self.enough:
                        lost = np.maximum(lost, bound)
                        (low if u[i] > 0 else high)[i] = end
        boxes = [(low, high)]
        if (2 - (high - low)).sum() / 2 < LITTLE:
            boxes = _halves(low, high, int(np.where(high - low < 2, np.inf, nearest).argmin()))
        return [(part.whole(a), part.whole(b), part.bound) for a, b in boxes], lost


def _halves(low: Array, high: Array, i: int) -> list[tuple[Array, Array]]:
    """Both halves of a box along input i."""
    upper, lower = low.copy(), high.copy()
    upper[i] = lower[i] = (low[i] + high[i]) / 2
    return [(low, lower), (upper, high)]
