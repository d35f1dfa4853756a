"""Polygons from a CSV file: columns x and y, a row ``nan, nan`` between polygons."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from alphacut.rve.image.outlines.polygon import Polygons
from alphacut.stochastic.particles.csv_columns import length_columns


def read_polygons(path: Path) -> Polygons:
    """The polygons of a file, in m: one, or several with a row ``nan, nan`` between them.

    Raises:
        ValueError: The file cannot be read, or a polygon has fewer than three corners.
    """
    corners = length_columns(path, ("x", "y")).values
    gaps = np.flatnonzero(np.isnan(corners).any(axis=1))
    parts = [part[~np.isnan(part).any(axis=1)] for part in np.split(corners, gaps)]
    return Polygons([part for part in parts if len(part)])
