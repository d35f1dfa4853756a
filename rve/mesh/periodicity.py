"""Periodicity by elimination of degrees of freedom; the corner is fixed (section 4.2).

The four corners are one periodic node; its fluctuation is fixed on the whole line over θ, because a
translation u = c(θ) costs no energy at any θ. A hexagon has two such nodes, of which one is fixed.
"""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import FailedError
from alphacut.rve.cell.lattice import SQUARE, Lattice

SAME_PLACE = 1e-8
"""Distance below which two nodes coincide, in halves of the side: far above the noise of Gmsh's
coordinates (3e-13), far below the shortest edge (1e-4). More would join nodes of tiny elements."""


class MeshError(FailedError):
    """A mesh of the cell is invalid."""


def unknowns(points: Array, lattice: Lattice = SQUARE) -> Ints:
    """Number the unknowns of a periodic field on a cell: partners on opposite sides share one.

    Args:
        points: Positions of the nodes in the cell, shape (n, 2).
        lattice: The cell and its pairs of opposite sides.

    Returns:
        Number of each node's unknown, shape (n,), from 0 without gaps. Nodes of opposite sides that
        differ by the vector of the lattice have the same number. Corners that the lattice leads
        from one to the other share one too; those of the first corner, where the field is held at
        zero, have −1. These are all corners of a parallelogram, and every second one of a hexagon.

    Raises:
        MeshError: A node on a side has no partner within 1e-8 on the opposite side.
    """
    on_side = abs(abs(lattice.side_coordinates(points)) - 1) <= SAME_PLACE
    pairs = range(len(lattice.half_vectors))
    partners = [_partners(points, on_side[:, pair], lattice, pair) for pair in pairs]
    representative: Ints = np.arange(len(points))
    # All other nodes have one partner. A corner has two, and the second round reaches the partner
    # of its partner.
    for first, second in partners + partners:
        smaller = np.minimum(representative[first], representative[second])
        representative[first] = representative[second] = smaller
    corners = np.flatnonzero(on_side.sum(axis=1) > 1)
    free = ~np.isin(representative, representative[corners[:1]])
    unknown: Ints = np.full(len(points), -1)
    unknown[free] = np.unique(representative[free], return_inverse=True)[1]
    return unknown


def _partners(points: Array, on_side: Mask, lattice: Lattice, pair: int) -> tuple[Ints, Ints]:
    """Pair the nodes of two opposite sides of a cell, sorted along the sides.

    Args:
        points: Positions of all nodes, shape (n, 2).
        on_side: Whether a node lies on one of the two sides, shape (n,).
        lattice: The cell.
        pair: Number of the pair of sides.

    Returns:
        Nodes of the first side, and their partners on the second, shape (k,) each; empty if no node
        lies on either side.

    Raises:
        MeshError: The sides have different numbers of nodes, or two nodes of the same rank are more
            than 1e-8 apart along the sides.
    """
    along = lattice.along_sides(points, pair)
    is_first = lattice.side_coordinates(points)[:, pair] < 0
    first = np.flatnonzero(on_side & is_first)
    second = np.flatnonzero(on_side & ~is_first)
    first = first[np.argsort(along[first])]
    second = second[np.argsort(along[second])]
    count = min(len(first), len(second))
    is_apart = abs(along[first[:count]] - along[second[:count]]) > SAME_PLACE
    if len(first) != len(second) or is_apart.any():
        # The first node that is apart from its partner, or else the first extra node of the longer
        # side.
        unpaired = int(np.argmax(np.append(is_apart, True)))
        x, y = points[max(first, second, key=len)[unpaired]]
        raise MeshError(
            f"the node at ({x:.6g}, {y:.6g}) of a side has no partner on the opposite side",
            "mesh opposite sides alike",
        )
    return first, second
