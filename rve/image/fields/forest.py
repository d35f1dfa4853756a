"""Spanning trees of the voxels between pores, and which of them meet their own periodic image.

Voxels are neighbours where they share a face, also through the sides of the grid. An edge or a
corner alone carries no flux and no force.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from alphacut.base.arrays import Ints, Mask
from alphacut.base.kernels import compiled

VOID = -2
"""Label of a voxel in a pore."""
_WAITING = -1  # label of a voxel that no tree has reached yet


@dataclass(frozen=True, eq=False)
class Forest:
    """Breadth-first trees of all voxels outside pores, one for each connected piece.

    Voxels are numbered in C order of the grid.

    Args:
        shape: Shape of the grid.
        order: The voxels outside pores in the order in which they were reached, tree by tree.
        parents: For each voxel the direction of its parent: 2 · axis, or 2 · axis + 1 where the
            parent lies on the upper side. −1 at roots and in pores.
        labels: Number of the tree of each voxel, −2 in pores.
        positions: Coordinates of each voxel along the axes, not wrapped at the sides of the grid,
            so that each lies beside its parent, shape (voxels, axes).
    """

    shape: Ints
    order: Ints
    parents: Ints
    labels: Ints
    positions: Ints

    @classmethod
    def of_mask(cls, is_solid: Mask) -> Self:
        """Return the trees of the voxels where a mask of shape (y, x) or (z, y, x) is true."""
        shape = np.array(is_solid.shape)
        labels = np.where(is_solid.ravel(), _WAITING, VOID)
        order = np.empty(np.count_nonzero(is_solid), int)
        parents = np.full(labels.size, -1)
        positions = np.stack(np.unravel_index(np.arange(labels.size), is_solid.shape), axis=1)
        _grow(shape, labels, order, parents, positions)
        return cls(shape, order, parents, labels, positions)

    def windings(self) -> tuple[Ints, Ints, Ints, Ints]:
        """Return the faces that lead from a tree into one of its periodic images.

        Returns:
            Of each such face its axis, shape (F,), and the voxel on its lower side, shape (F,);
            the voxel on its upper side; and by how many periods of the grid along each axis the
            path through the face and back along the tree moves, shape (F, axes). It is not zero.
        """
        numbers = np.arange(self.labels.size).reshape(self.shape)
        found: list[tuple[Ints, ...]] = []
        for axis in range(len(self.shape)):
            above = np.roll(numbers, -1, axis).ravel()
            step = self.positions - self.positions[above]
            step[:, axis] += 1
            is_face = (self.labels == self.labels[above]) & (self.labels >= 0)
            below = np.flatnonzero(is_face & step.any(axis=1))
            periods = step[below] // self.shape
            found.append((np.full(len(below), axis), below, above[below], periods))
        axes, below, above, periods = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return axes, below, above, periods


class Percolation(NamedTuple):
    """What the voxels outside pores connect.

    Args:
        axes: Whether they lead from a side of the grid to the opposite one, and on through all
            periodic images, along each axis of the grid.
        isolated: Fraction of them that belongs to pieces which meet none of their own images, and
            so carry nothing.
        thickness: Mean thickness of their walls in voxels: twice their number over that of their
            faces at pores; infinite without pores.
    """

    axes: tuple[bool, ...]
    isolated: float
    thickness: float

    @classmethod
    def of_mask(cls, is_solid: Mask) -> Self:
        """Return that of the voxels where a mask of shape (y, x) or (z, y, x) is true."""
        forest = Forest.of_mask(is_solid)
        _, below, _, periods = forest.windings()
        # A flux along an axis needs a path that comes back displaced along it, whatever else.
        axes = tuple(bool(along) for along in (periods != 0).any(axis=0))
        carrying = np.isin(forest.labels, np.unique(forest.labels[below]))
        count = len(forest.order)
        isolated = 1 - np.count_nonzero(carrying) / count if count else 0.0
        faces = sum(
            np.count_nonzero(is_solid != np.roll(is_solid, 1, axis))
            for axis in range(is_solid.ndim)
        )
        return cls(axes, isolated, 2 * count / faces if faces else np.inf)


@compiled
def neighbour(voxel: int, stride: int, size: int, side: int) -> int:
    """Return the number of the next voxel along an axis of a periodic grid.

    Args:
        voxel: Number of a voxel.
        stride: Difference of the numbers of neighbours along the axis.
        size: Number of voxels along it.
        side: 0 for the lower neighbour, 1 for the upper one.
    """
    place = voxel // stride % size
    if side == 1:
        return voxel + stride if place < size - 1 else voxel - (size - 1) * stride
    return voxel - stride if place > 0 else voxel + (size - 1) * stride


@compiled
def _grow(shape: Ints, labels: Ints, order: Ints, parents: Ints, positions: Ints) -> None:
    """Fill `order`, `parents`, `labels` and `positions` of a forest; see `Forest`.

    Args:
        shape: Shape of the grid.
        labels: −1 at voxels outside pores, −2 in pores; changed.
        order: As many entries as voxels outside pores; overwritten.
        parents: −1 everywhere; changed.
        positions: Coordinates of the voxels in the grid; changed.
    """
    end = 0
    tree = 0
    for root in range(labels.size):
        if labels[root] != _WAITING:
            continue
        labels[root] = tree
        order[end] = root
        first = end
        end += 1
        while first < end:
            voxel = order[first]
            first += 1
            stride = 1
            for axis in range(len(shape) - 1, -1, -1):
                for side in range(2):
                    other = neighbour(voxel, stride, shape[axis], side)
                    if labels[other] == _WAITING:
                        labels[other] = tree
                        parents[other] = 2 * axis + 1 - side
                        for a in range(len(shape)):
                            positions[other, a] = positions[voxel, a]
                        positions[other, axis] += 2 * side - 1
                        order[end] = other
                        end += 1
                stride *= shape[axis]
        tree += 1


@compiled
def sweep_fluxes(shape: Ints, order: Ints, parents: Ints, fluxes: Ints) -> None:
    """Make whole fluxes balance in every voxel, in place, from the leaves of trees to their roots.

    What flows out of a voxel too much is taken from the face to its parent. The sum of what flows
    out of the voxels of a piece is zero whatever the fluxes are, since each face has a voxel on
    either side: so its root, which comes last, is balanced too.

    Args:
        shape: Shape of the grid.
        order: Voxels outside pores, each after its parent.
        parents: Direction of the parent of each voxel; see `Forest`.
        fluxes: Flux through the upper face of each voxel along each axis, shape (axes, voxels); 0
            at faces of pores. Changed.
    """
    for number in range(len(order) - 1, -1, -1):
        voxel = order[number]
        if parents[voxel] < 0:
            continue
        excess = 0
        to_parent = voxel  # the voxel whose upper face leads to the parent
        stride = 1
        for axis in range(len(shape) - 1, -1, -1):
            below = neighbour(voxel, stride, shape[axis], 0)
            excess += fluxes[axis, voxel] - fluxes[axis, below]
            if parents[voxel] == 2 * axis:
                to_parent = below
            stride *= shape[axis]
        sign = 2 * (parents[voxel] % 2) - 1
        fluxes[parents[voxel] // 2, to_parent] -= sign * excess


def unit_of(largest: float) -> float:
    """Return a power of two whose multiples up to `largest`, positive, are at most 2⁵⁰ of it."""
    return float(np.exp2(np.ceil(np.log2(largest)) - 50))
