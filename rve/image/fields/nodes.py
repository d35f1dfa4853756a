"""Nodes of a periodic grid between solids that share no face around them: each gets its own copy.

Around a node 4 pixels or 8 voxels meet. Those that are connected there through common faces move
with one copy of the node; solids that share an edge or a corner alone have copies of their own.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Self

import numpy as np

from alphacut.base.arrays import Ints, Mask
from alphacut.rve.image.fields.macro_element import corners


@dataclass(frozen=True, eq=False)
class NodeCopies:
    """Copies of the nodes of a grid with pores.

    Args:
        cells: Numbers of the voxels outside pores, in C order of the grid, shape (S,).
        copies: Number of the copy at each corner of these voxels, shape (S, corners).
        places: Number of the node of each copy, which is that of the voxel on its upper side along
            all axes, shape (copies,). It rises.
        patterns: For each node of the grid the sum of 2^k over the voxels outside pores around it,
            where k numbers the corner of the voxel that the node is, shape (voxels,).
    """

    cells: Ints
    copies: Ints
    places: Ints
    patterns: Ints

    @classmethod
    def of_mask(cls, is_solid: Mask) -> Self:
        """Return the copies for a mask of shape (y, x) or (z, y, x), true outside pores."""
        axes = tuple(range(is_solid.ndim))
        points = corners(is_solid.ndim)
        numbers = np.arange(is_solid.size).reshape(is_solid.shape)
        patterns = np.zeros(is_solid.shape, int)
        for k, point in enumerate(points):
            patterns += np.roll(is_solid, point, axes).astype(int) << k
        groups = corner_groups(is_solid.ndim)
        counts = groups.max(axis=1)[patterns.ravel()] + 1
        first = np.cumsum(counts) - counts
        cells = np.flatnonzero(is_solid)
        copies = np.empty((len(cells), len(points)), int)
        for k, point in enumerate(points):
            node = np.roll(numbers, -point, axes).ravel()[cells]
            copies[:, k] = first[node] + groups[patterns.ravel()[node], k]
        return cls(cells, copies, np.repeat(numbers.ravel(), counts), patterns.ravel())

    @property
    def is_split(self) -> Mask:
        """Whether each copy is one of several of its node."""
        counts: Ints = np.bincount(self.places)
        return counts[self.places] > 1


@cache
def corner_groups(dimension: int) -> Ints:
    """Return the groups into which the voxels around a node fall, for every pattern of solids.

    Returns:
        For each sum of 2^k over the voxels outside pores, the number of the group of the voxel
        whose corner k the node is, and −1 for a voxel in a pore, shape (patterns, corners).
    """
    points = corners(dimension)
    shares_face = abs(points[:, np.newaxis] - points).sum(axis=2) == 1
    groups = np.full((1 << len(points), len(points)), -1)
    for pattern in range(len(groups)):
        count = 0
        for start in range(len(points)):
            if not pattern >> start & 1 or groups[pattern, start] >= 0:
                continue
            waiting = [start]
            while waiting:
                k = waiting.pop()
                groups[pattern, k] = count
                near = np.flatnonzero(shares_face[k] & (groups[pattern] < 0))
                waiting += [int(other) for other in near if pattern >> other & 1]
            count += 1
    return groups
