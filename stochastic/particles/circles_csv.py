"""Measured circles from a CSV file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from alphacut.fuzzy.arrays import Rows
from alphacut.fuzzy.refused import RefusedError
from alphacut.stochastic.particles.csv_columns import length_columns
from alphacut.stochastic.particles.neighbour_search import close_pairs, surface_distance
from alphacut.stochastic.particles.particles import Particles
from alphacut.stochastic.particles.radius_laws import require_radii

ROUNDING = 1e-9  # overlap over the smaller radius that is no overlap


@dataclass(frozen=True)
class CircleFile:
    """Circles of a CSV file with the columns x, y, r and their units: ``x [mm], y [mm], r [mm]``.

    Args:
        path: The file. A column "d" (diameter) may stand in for r.
        size: Width and height of the section, a window with a corner at the origin, in m.
    """

    path: Path
    size: tuple[float, float]

    def read(self) -> Particles:
        """Read the circles of the file, in m, with the origin at the corner of the section.

        Raises:
            RefusedError: The file cannot be read, or a circle lies outside or overlaps another one.
        """
        rows, values = length_columns(self.path, ("x", "y", "r"))
        centres, radii = values[:, :2], values[:, 2]
        for row, centre, radius in zip(rows, centres, radii, strict=True):
            require_radii(f"{self.path.name}, row {row}", radius)
            if not ((centre >= 0) & (centre <= self.size)).all():
                value = f"a centre {(1e3 * centre).round(6).tolist()} mm from the corner"
                width, height = (f"{1e3 * side:g}" for side in self.size)
                allowed = f"places in the section of {width} × {height} mm"
                raise RefusedError(f"{self.path.name}, row {row}", value, allowed)
        discs = Particles(centres, radii, np.array(self.size), periodic=False)
        self._refuse_overlap(discs, rows)
        return discs

    def _refuse_overlap(self, discs: Particles, rows: Rows) -> None:
        """Refuse the file if two circles overlap, with the rows of the worst pair."""
        first, second = close_pairs(discs, 0.0)
        smaller = np.minimum(discs.radii[first], discs.radii[second])
        overlap = -surface_distance(discs, first, second) / smaller
        if overlap.max(initial=0.0) > ROUNDING:
            worst = int(np.argmax(overlap))
            upper, lower = sorted(int(rows[k]) for k in (first[worst], second[worst]))
            raise RefusedError(
                f"{self.path.name}, row {lower}",
                f"a circle that overlaps that of row {upper} by {overlap[worst]:.2g} of its radius",
                "circles that do not overlap",
                "mend the row",
            )
