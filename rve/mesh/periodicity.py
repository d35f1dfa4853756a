"""Periodicity by elimination of degrees of freedom; the corner is fixed (section 4.2).

The four corners are one periodic node; its fluctuation is fixed on the whole line over θ, because a
translation u = c(θ) costs no energy at any θ.
"""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import FailedError

SAME_PLACE = 1e-8
"""Distance below which two nodes coincide, in halves of the side: far above the noise of Gmsh's
coordinates (3e-13), far below the shortest edge (1e-4). More would join nodes of tiny elements."""


class MeshError(FailedError):
    """A mesh of the cell is invalid."""


def unknowns(points: Array) -> Ints:
    """Number the unknowns of a periodic field on a square: partners on opposite sides share one.

    Args:
        points: Positions of the nodes in the cell [−1, 1]², shape (n, 2).

    Returns:
        Number of each node's unknown, shape (n,), from 0 without gaps. Nodes with the same
        coordinate on two opposite sides have the same number. The corners, where the field is held
        at zero, have −1.

    Raises:
        MeshError: A node on a side has no partner within 1e-8 on the opposite side.
    """
    on_side = abs(abs(points) - 1) <= SAME_PLACE
    representative: Ints = np.arange(len(points))
    for axis in (0, 1):
        first, second = _partners(points, on_side[:, axis], axis)
        # Only corners lie on both pairs of sides, so all other pairs of the first axis stay as they
        # are when the second axis follows.
        representative[first] = representative[second] = np.minimum(first, second)
    free = ~on_side.all(axis=1)
    unknown: Ints = np.full(len(points), -1)
    unknown[free] = np.unique(representative[free], return_inverse=True)[1]
    return unknown


def _partners(points: Array, on_side: Mask, axis: int) -> tuple[Ints, Ints]:
    """Pair the nodes of two opposite sides of the square [−1, 1]², sorted along the sides.

    Args:
        points: Positions of all nodes, shape (n, 2).
        on_side: Whether a node lies on one of the two sides, shape (n,).
        axis: 0 or 1: the coordinate that is −1 on the first side and 1 on the second.

    Returns:
        Nodes of the first side, and their partners on the second, shape (k,) each; empty if no node
        lies on either side.

    Raises:
        MeshError: The sides have different numbers of nodes, or two nodes of the same rank are more
            than 1e-8 apart along the sides.
    """
    along = points[:, 1 - axis]
    is_first = points[:, axis] < 0
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
        coordinate = along[max(first, second, key=len)[unpaired]]
        side = f"x{axis + 1} = ±1 at x{2 - axis} = {coordinate:.6g}"
        raise MeshError(
            f"a node of the sides {side} has no partner on the opposite side",
            "mesh opposite sides alike",
        )
    return first, second
