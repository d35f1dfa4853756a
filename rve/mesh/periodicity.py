"""Periodicity by elimination; the corner is fixed (section 4.2).

The four corners are one periodic node; its fluctuation is fixed on the whole line over θ, because a
translation u = c(θ) costs no energy at any θ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
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
    """Pair the nodes on opposite sides of the cell."""
    unknown = unknowns(plane.points)
    return Periodicity(unknown, int(unknown[: plane.vertices].max()) + 1, int(unknown.max()) + 1)


def unknowns(points: Array) -> Rows:
    """Unknown of each node of the cell, in the order of the nodes, −1 at the corners, shape (n,).

    Args:
        points: Positions, shape (n, 2).

    Raises:
        RuntimeError: A node of a side has no partner.
    """
    side = 10**8
    keys = np.round(points * side).astype(np.int64)
    folded = np.where(keys == side, -side, keys)
    _, first, label = np.unique(folded, axis=0, return_index=True, return_inverse=True)
    label = label.ravel()
    sides = (abs(keys) == side).sum(axis=1)
    if (np.bincount(label)[label] != 2**sides).any():
        raise RuntimeError("a node of a side has no partner on the opposite side: mesh both alike")
    corner = (abs(keys[first]) == side).all(axis=1)
    order = np.argsort(np.where(corner, -1, first))
    return np.asarray(np.argsort(order)[label] - 1)
