"""Measured circles from a CSV file."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from alphacut.stochastic.particles.csv_columns import length_columns
from alphacut.stochastic.particles.discs import Discs
from alphacut.stochastic.particles.relaxation import close_pairs, surface_distance
from alphacut.stochastic.theta.truncated_normal import Array

COLUMNS = ("x", "y", "r")
Told = Callable[..., str]  # a length in m, in words of the file


@dataclass(frozen=True)
class CircleFile:
    """Circles of a CSV file with the columns x, y, r and their units: ``x [mm], y [mm], r [mm]``.

    Args:
        path: The file. A column "d" (diameter) may stand in for r.
        size: Width and height of the box or window, in m.
        origin: Its lower left corner in the file's coordinates, in m.
        periodic: Whether the section repeats itself; otherwise the rectangle is a window, and only
            cells that no disc beyond its edge can change are counted (see `open_window`).
        unit: Unit of columns whose header names none; empty if each does.
        drop: Leave out rows that make no sense and list them, instead of refusing the file.
        overlap: Overlap of two circles that is taken for an error of measurement, as a share of the
            smaller radius, below 1.
    """

    path: Path
    size: tuple[float, float]
    origin: tuple[float, float] = (0.0, 0.0)
    periodic: bool = False
    unit: str = ""
    drop: bool = False
    overlap: float = 0.0

    def read(self) -> MeasuredCircles:
        """The circles.

        Raises:
            ValueError: The file cannot be read, or a row makes no sense (row and reason; all of
                them, the first ten in words).
        """
        found = length_columns(self.path, COLUMNS, self.unit)
        rows, table = found.rows, found.values - (*self.origin, 0.0)
        reasons = self._nonsense(rows, table, found.told)
        good = np.array([row not in reasons for row in rows], bool)
        overlaps, needed = self._overlaps(rows[good], table[good], found.told)
        reasons |= overlaps
        if reasons and not self.drop:
            told = "; ".join(f"row {row} {reason}" for row, reason in sorted(reasons.items())[:10])
            cure = "mend them, or drop them: [microstructure.circles] drop = true"
            if overlaps and len(overlaps) == len(reasons) and needed < 1:
                cure += f", or take overlaps for errors of measurement: overlap = {needed:g}"
            make = "1 row makes" if len(reasons) == 1 else f"{len(reasons)} rows make"
            raise ValueError(f"{self.path}: {make} no sense: {told}; {cure}")
        good = np.array([row not in reasons for row in rows], bool)
        if not good.any():
            raise ValueError(f"{self.path}: no row holds a circle; it takes at least one")
        return MeasuredCircles(
            Discs(table[good, :2], table[good, 2], np.array(self.size), self.periodic),
            dict(sorted(reasons.items())),
        )

    def _nonsense(self, rows: Array, table: Array, told: Told) -> dict[int, str]:
        reasons: dict[int, str] = {}
        for row, circle in zip(rows, table, strict=True):
            row, (x, y, r) = int(row), (float(value) for value in circle)
            if not np.isfinite([x, y, r]).all():
                reasons[row] = "lacks a finite number"
            elif r <= 0:
                reasons[row] = f"has the radius {told(r)}, which must be positive"
            elif not (0 <= x <= self.size[0] and 0 <= y <= self.size[1]):
                section = f"the section of {told(self.size[0])} × {told(self.size[1])}"
                reasons[row] = (
                    f"has its centre ({told(x)}, {told(y)} from the corner) outside {section}"
                )
            elif self.periodic and 2 * r > min(self.size):
                reasons[row] = f"has the radius {told(r)} and overlaps its own periodic image"
        return reasons

    def _overlaps(self, rows: Array, table: Array, told: Told) -> tuple[dict[int, str], float]:
        """The later row of every pair that overlaps, and the `overlap` that allows them all."""
        if len(table) < 2:
            return {}, 0.0
        discs = Discs(table[:, :2], table[:, 2], np.array(self.size), self.periodic)
        first, second = np.sort(np.stack(close_pairs(discs, 0.0)), axis=0)
        depth = -surface_distance(discs, first, second)
        share = depth / np.minimum(discs.radii[first], discs.radii[second])
        wrong = share > max(self.overlap, 1e-9)
        needed = math.ceil(100 * share.max(initial=0.0) + 1e-9) / 100
        first, second, depth = first[wrong], second[wrong], depth[wrong]
        distance = np.hypot(*(table[first, :2] - table[second, :2]).T)
        across = distance >= discs.radii[first] + discs.radii[second]
        edge = np.where(across, " across the periodic edge (is the section periodic?)", "")
        pairs = zip(
            rows[first].tolist(), rows[second].tolist(), depth.tolist(), edge.tolist(), strict=True
        )
        return {
            late: f"overlaps the circle of row {early} by {told(by, 3)}{where}"
            for early, late, by, where in sorted(pairs, reverse=True)
        }, needed


@dataclass(frozen=True, eq=False)
class MeasuredCircles:
    """Circles of one section.

    Args:
        discs: The circles, origin at the corner of the section.
        rejected: What was left out: row (or label) to reason.
        phase_fraction: Area fraction of the particles in the whole image; None without an image.
        lost: Share of that area which lies in particles left out inside the image.
        misfit: Share of the particles' pixels outside the circle of their own piece.
        unevenness: Difference of the matrix's brightness over the image, a share of the contrast.
        light: Slow light that was taken out before, a share of the contrast too.
        strange: Share of the pixels that are much brighter or darker than both phases.
        unsure: Places of clusters that were parted uncertainly, shape (n, 2), in m.
    """

    discs: Discs
    rejected: dict[int, str] = field(default_factory=dict)
    phase_fraction: float | None = None
    lost: float = 0.0
    misfit: float = 0.0
    unevenness: float = 0.0
    light: float = 0.0
    strange: float = 0.0
    unsure: Array = field(default_factory=lambda: np.zeros((0, 2)))
