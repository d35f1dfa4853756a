"""Measured circles from a CSV file."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from stochastic.contacts import close_pairs, surface_distance
from stochastic.discs import Discs
from stochastic.length_columns import length_columns
from stochastic.truncated_normal import Array

COLUMNS = ("x", "y", "r")


@dataclass(frozen=True)
class CircleFile:
    """Circles listed in a CSV file with the columns x, y, r, their units in the header: ``x [mm], y [mm], r [mm]``.

    Args:
        path: The file. A column "d" (diameter) may stand in for r.
        size: Width and height of the box or window, in m.
        origin: Its lower left corner in the file's coordinates, in m.
        periodic: Whether the section repeats itself; otherwise the rectangle is a window, and only cells that no disc beyond its
            edge can change are counted (see `open_window`).
        unit: Unit of columns whose header names none; empty if each does.
        drop: Leave out rows that make no sense and list them, instead of refusing the file.
        overlap: Overlap of two circles that is taken for an error of measurement, as a share of the smaller radius.

    Raises:
        ValueError: The rectangle has no area, or the allowed overlap lies outside [0, 1).
    """

    path: Path
    size: tuple[float, float]
    origin: tuple[float, float] = (0.0, 0.0)
    periodic: bool = False
    unit: str = ""
    drop: bool = False
    overlap: float = 0.0

    def __post_init__(self) -> None:
        if not all(np.isfinite(side) and side > 0 for side in self.size):
            raise ValueError(f"the section is {self.size[0]:g} × {self.size[1]:g} m; both sides must be positive and finite")
        if not 0 <= self.overlap < 1:
            raise ValueError(f"the allowed overlap is {self.overlap:g} of the smaller radius; it must lie in [0, 1)")

    def read(self) -> MeasuredCircles:
        """The circles.

        Raises:
            ValueError: The file cannot be read, or a row makes no sense (row and reason; all of them, the first ten in words).
        """
        rows, table = self._table()
        reasons = self._nonsense(rows, table)
        good = np.array([row not in reasons for row in rows], bool)
        reasons |= self._overlaps(rows[good], table[good])
        if reasons and not self.drop:
            told = "; ".join(f"row {row} {reason}" for row, reason in sorted(reasons.items())[:10])
            raise ValueError(f"{self.path}: {len(reasons)} rows make no sense: {told}; mend them, or drop them (drop = true)")
        good = np.array([row not in reasons for row in rows], bool)
        if not good.any():
            raise ValueError(f"{self.path}: no row holds a circle; it takes at least one")
        return MeasuredCircles(Discs(table[good, :2], table[good, 2], np.array(self.size), self.periodic), dict(sorted(reasons.items())))

    def _table(self) -> tuple[Array, Array]:
        """Row numbers as an editor shows them, shape (n,), and x, y, r in m with the origin at the corner, shape (n, 3)."""
        rows, table = length_columns(self.path, COLUMNS, self.unit)
        return rows, table - (*self.origin, 0.0)

    def _nonsense(self, rows: Array, table: Array) -> dict[int, str]:
        reasons: dict[int, str] = {}
        for row, circle in zip(rows, table, strict=True):
            row, (x, y, r) = int(row), (float(value) for value in circle)
            if not np.isfinite([x, y, r]).all():
                reasons[row] = "lacks a finite number"
            elif r <= 0:
                reasons[row] = f"has the radius {r:g} m, which must be positive"
            elif not (0 <= x <= self.size[0] and 0 <= y <= self.size[1]):
                reasons[row] = f"has its centre ({x:g}, {y:g}) m outside the section of {self.size[0]:g} × {self.size[1]:g} m"
            elif self.periodic and 2 * r > min(self.size):
                reasons[row] = f"has the radius {r:g} m and overlaps its own periodic image"
        return reasons

    def _overlaps(self, rows: Array, table: Array) -> dict[int, str]:
        """The later row of every pair that overlaps."""
        if len(table) < 2:
            return {}
        discs = Discs(table[:, :2], table[:, 2], np.array(self.size), self.periodic)
        first, second = np.sort(np.stack(close_pairs(discs, 0.0)), axis=0)
        depth = -surface_distance(discs, first, second)
        wrong = depth > np.maximum(self.overlap, 1e-9) * np.minimum(discs.radii[first], discs.radii[second])
        pairs = zip(rows[first[wrong]].tolist(), rows[second[wrong]].tolist(), depth[wrong].tolist(), strict=True)
        return {late: f"overlaps the circle of row {early} by {by:.3g} m" for early, late, by in sorted(pairs, reverse=True)}


@dataclass(frozen=True, eq=False)
class MeasuredCircles:
    """Circles of one section.

    Args:
        discs: The circles, origin at the corner of the section.
        rejected: What was left out: row (or label) to reason.
    """

    discs: Discs
    rejected: dict[int, str] = field(default_factory=dict)
