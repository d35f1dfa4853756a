"""Pixels that a particle's outline certainly fills, certainly misses, or cuts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array

OUTSIDE, CUT, INSIDE = -1, 0, 1


@dataclass(frozen=True)
class Grid:
    """Pixels of a periodic cell [0, width] × [0, height].

    Args:
        rows: Pixels along y, row 0 at y = 0.
        columns: Pixels along x.
        width: Length of the cell along x, in the outline's unit.
        height: Length along y.

    Raises:
        ValueError: There are no pixels, or a length is not positive.
    """

    rows: int
    columns: int
    width: float = 1.0
    height: float = 1.0

    def __post_init__(self) -> None:
        if min(self.rows, self.columns) < 1:
            raise ValueError(f"a grid of {self.rows} × {self.columns} pixels is none")
        if not (0 < self.width < np.inf and 0 < self.height < np.inf):
            raise ValueError(
                f"the cell is {self.width:g} × {self.height:g}; its sides must be positive"
            )

    @property
    def aspect(self) -> float:
        """Height of a pixel over its width."""
        return (self.height / self.rows) / (self.width / self.columns)


class Outline(Protocol):
    """A curve that bounds particles."""

    def classify(self, grid: Grid) -> Array:
        """OUTSIDE, CUT or INSIDE for each pixel, shape (rows, columns).

        Of a pixel that is CUT nothing is claimed; the others are certain.
        """


def phase_ranges(classes: Array) -> tuple[Array, Array]:
    """Least and greatest number of the phase of each pixel: 0 the matrix, 1 the particle."""
    return np.asarray(classes == INSIDE, dtype=int), np.asarray(classes != OUTSIDE, dtype=int)
