"""Periodicity by elimination; the corner is fixed (section 4.2).

The four corners are one periodic node; its fluctuation is fixed on the whole line over θ, because a
translation u = c(θ) costs no energy at any θ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from alphacut.fuzzy.arrays import Rows
from alphacut.rve.mesh.triangulation import Triangulation


@dataclass(frozen=True, eq=False)
class Periodicity:
    """Unknowns of a planar mesh after identification, vertices before edge midpoints.

    Args:
        unknown: Unknown of each planar node, −1 at the corners, shape (n,).
        vertices: Number of unknowns on vertices.
        count: Number of unknowns in all.
    """

    unknown: Rows
    vertices: int
    count: int

    def ends(self, plane: Triangulation) -> Rows:
        """Unknowns of the vertices beside each midpoint's, −1 where fixed, shape (midpoints, 2)."""
        first = np.unique(self.unknown[plane.vertices :], return_index=True)[1]
        return np.asarray(self.unknown[plane.ends[first]])


@lru_cache(maxsize=4)
def identify(plane: Triangulation) -> Periodicity:
    """Pair the nodes on opposite sides of the cell.

    Raises:
        RuntimeError: A node has none.
    """
    keys = np.round(plane.points * 1e7).astype(np.int64)
    folded = np.where(keys == 10**7, -(10**7), keys)
    _, first, label = np.unique(folded, axis=0, return_index=True, return_inverse=True)
    label = label.ravel()
    sides = (abs(keys) == 10**7).sum(axis=1)
    if (np.bincount(label)[label] != 2**sides).any():
        raise RuntimeError("a node of a side has no partner on the opposite side: mesh both alike")
    # the corner first, then as numbered
    order = np.argsort(np.where((abs(keys[first]) == 10**7).all(axis=1), -1, first))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order)) - 1
    unknown = rank[label]
    return Periodicity(unknown, int(unknown[: plane.vertices].max()) + 1, len(order) - 1)
