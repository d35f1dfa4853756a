"""Periodicity by elimination; the corner is fixed (section 4.2).

The four corners are one periodic node; its fluctuation is fixed on the whole line over θ, because a
translation u = c(θ) costs no energy at any θ.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from alphacut.rve.mesh.triangulation import Integers, Triangulation
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True, eq=False)
class Periodicity:
    """Unknowns of a planar mesh after identification, vertices before edge midpoints.

    Args:
        unknown: Unknown of each planar node, −1 at the corners, shape (n,).
        vertices: Number of unknowns on vertices.
        count: Number of unknowns in all.
    """

    unknown: Integers
    vertices: int
    count: int

    def ends(self, plane: Triangulation) -> NDArray[np.int32]:
        """Unknowns of the vertices beside each midpoint's, −1 where fixed, shape (midpoints, 2)."""
        first = np.unique(self.unknown[plane.vertices :], return_index=True)[1]
        return np.ascontiguousarray(self.unknown[plane.ends[first]], np.int32)


@lru_cache(maxsize=4)
def identify(plane: Triangulation) -> Periodicity:
    """Pair the nodes on opposite sides of the cell.

    Raises:
        RuntimeError: A node on one side has no partner on the other.
    """
    keys = np.round(plane.points * 1e7).astype(np.int64)
    folded = np.where(keys == 10**7, -(10**7), keys)
    _, first, label = np.unique(folded, axis=0, return_index=True, return_inverse=True)
    label = label.ravel()
    partners = np.bincount(label)
    sides = (abs(keys) == 10**7).sum(axis=1)
    if (partners[label] != 2**sides).any():
        raise RuntimeError(
            "the mesh is not periodic: a node on one side of the cell has no partner on the"
            " opposite side"
        )
    # the corner first, then as numbered
    order = np.argsort(np.where((abs(keys[first]) == 10**7).all(axis=1), -1, first))
    rank = np.empty_like(order)
    rank[order] = np.arange(len(order)) - 1
    unknown = rank[label]
    return Periodicity(unknown, int(unknown[: plane.vertices].max()) + 1, len(order) - 1)


def mismatch(positions: Array, fluctuation: Array) -> float:
    """Largest difference of the fluctuation between opposite nodes, relative to its largest value.

    It pairs the nodes by position on its own, so that it can find a wrong identification.

    Args:
        positions: Nodes (x1, x2, θ) of the cell, shape (n, 3).
        fluctuation: Displacements less ε̄x, shape (n, 2, loads).
    """
    worst = 0.0
    for axis in (0, 1):
        order = [_along_side(positions, axis, end) for end in (-1.0, 1.0)]
        if len(order[0]) != len(order[1]):
            return float("inf")
        worst = max(worst, float(abs(fluctuation[order[0]] - fluctuation[order[1]]).max()))
    return worst / max(float(abs(fluctuation).max()), np.finfo(float).tiny)


def _along_side(positions: Array, axis: int, end: float) -> Integers:
    """Nodes of one side, in the order of their other coordinates."""
    side = np.flatnonzero(abs(positions[:, axis] - end) < 1e-9)
    return np.asarray(side[np.lexsort(np.round(positions[side][:, [1 - axis, 2]], 7).T)])
