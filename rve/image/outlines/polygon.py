"""Particles whose outlines are polygons; what leaves the cell comes back in on the other side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.rve.image.outlines.outline import CUT, INSIDE, OUTSIDE, Grid
from alphacut.stochastic.particles.csv_columns import length_columns
from alphacut.stochastic.theta.truncated_normal import Array

MARGIN = (
    1e-9  # pixels by which an edge reaches farther than it does, above the rounding of its place
)


@dataclass(frozen=True)
class Polygons:
    """Closed polygons, each without crossings of its own edges.

    Args:
        polygons: Corners (x, y) of each, shape (n, 2), three or more; the last joins the first.

    Raises:
        ValueError: There is no polygon, or one has fewer than three corners or a corner that is no
            number.
    """

    polygons: Sequence[Array]

    def __post_init__(self) -> None:
        if not self.polygons:
            raise ValueError("there is no polygon")
        for number, corners in enumerate(self.polygons, 1):
            if np.ndim(corners) != 2 or np.shape(corners)[1] != 2 or len(corners) < 3:
                raise ValueError(
                    f"polygon {number} has the shape {np.shape(corners)}; "
                    "it takes three corners (x, y) or more"
                )
            if not np.isfinite(corners).all():
                raise ValueError(f"polygon {number} has a corner that is not finite")

    def classify(self, grid: Grid) -> Array:
        """OUTSIDE, CUT or INSIDE for each pixel, shape (rows, columns)."""
        scale = np.array([grid.columns / grid.width, grid.rows / grid.height])
        inside, cut = (np.zeros((grid.rows, grid.columns), bool) for _ in range(2))
        for corners in self.polygons:
            places = np.asarray(corners, float) * scale
            start = np.floor(places.min(axis=0) - 1).astype(int)
            classes = _classified(places - start, np.ceil(np.ptp(places, axis=0) + 3).astype(int))
            rows = (np.arange(classes.shape[0]) + start[1]) % grid.rows
            columns = (np.arange(classes.shape[1]) + start[0]) % grid.columns
            for mask, which in ((inside, INSIDE), (cut, CUT)):
                here = np.nonzero(classes == which)
                mask[rows[here[0]], columns[here[1]]] = True
        return np.where(inside, INSIDE, np.where(cut, CUT, OUTSIDE))


def _classified(corners: Array, size: Array) -> Array:
    """Classes of unit pixels, shape (rows, columns), for corners (x, y) inside them."""
    columns, rows = size
    after = np.roll(corners, -1, axis=0)
    cut = np.zeros((rows, columns), bool)
    inside = np.zeros((rows, columns), bool)
    for (x0, y0), (x1, y1) in zip(corners, after, strict=True):
        first, last = int(np.floor(min(y0, y1) - MARGIN)), int(np.floor(max(y0, y1) + MARGIN))
        for row in range(first, last + 1):
            low, high = _reach(x0, y0, x1, y1, row)
            cut[row, int(np.floor(low)) : int(np.floor(high)) + 1] = True
            if (y0 <= row + 0.5) != (y1 <= row + 0.5):  # the edge crosses the middle of the row
                crossing = x0 + (row + 0.5 - y0) * (x1 - x0) / (y1 - y0)
                inside[row, max(0, int(np.ceil(crossing - 0.5))) :] ^= True
    return np.where(cut, CUT, np.where(inside, INSIDE, OUTSIDE))


def _reach(x0: float, y0: float, x1: float, y1: float, row: int) -> tuple[float, float]:
    """Least and greatest x of an edge within a row of pixels, with the margin."""
    if abs(y1 - y0) <= MARGIN:
        ends = np.array([x0, x1])
    else:
        shares = np.clip((np.array([row - MARGIN, row + 1 + MARGIN]) - y0) / (y1 - y0), 0, 1)
        ends = x0 + shares * (x1 - x0)
    slack = MARGIN * (1 + abs(x1 - x0))
    return float(ends.min()) - slack, float(ends.max()) + slack


def read_polygons(path: Path) -> Polygons:
    """The polygons of a file, in m: one, or several with a row ``nan, nan`` between them.

    Raises:
        ValueError: The file cannot be read, or a polygon has fewer than three corners.
    """
    corners = length_columns(path, ("x", "y")).values
    gaps = np.flatnonzero(np.isnan(corners).any(axis=1))
    parts = [part[~np.isnan(part).any(axis=1)] for part in np.split(corners, gaps)]
    return Polygons([part for part in parts if len(part)])
