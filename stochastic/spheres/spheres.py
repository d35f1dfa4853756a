"""Spheres in a periodic cube, their gaps and the circles of their plane sections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True, eq=False)
class Spheres:
    """Spheres in a periodic cube.

    Args:
        centres: Shape (n, 3), in m, inside the cube.
        radii: Shape (n,), in m.
        side: Side of the cube, in m.
    """

    centres: Array
    radii: Array
    side: float

    @property
    def volume_fraction(self) -> float:
        """Share of the cube that they fill if none overlap."""
        return float(4 / 3 * np.pi * (self.radii**3).sum() / self.side**3)

    def smallest_gap(self) -> float:
        """Least distance between surfaces, in m; negative where two overlap, ∞ with one sphere."""
        first, second, way = close_pairs(self.centres, self.radii, self.side, reach=0.0)
        gaps = np.linalg.norm(way, axis=1) - self.radii[first] - self.radii[second]
        return float(gaps.min(initial=np.inf))

    def section(self, axis: int, height: float) -> Array:
        """Radii of the circles in which the plane x_axis = height cuts them, in m."""
        above = self.centres[:, axis] - height
        above -= self.side * np.round(above / self.side)
        square = self.radii**2 - above**2
        return np.asarray(np.sqrt(square[square > 0]))


def close_pairs(
    centres: Array, radii: Array, side: float, *, reach: float
) -> tuple[Array, Array, Array]:
    """Pairs whose surfaces may be nearer than `reach`: balls of twice each radius, not the largest.

    Returns:
        Indices of the larger and the smaller one, shape (pairs,), and the way from the latter's
        centre, shape (pairs, 3); at least every pair of a gap up to `reach` or the least there is.
    """
    from scipy.spatial import cKDTree

    inside, rank = np.mod(centres, side), np.argsort(np.argsort(-radii, kind="stable"))
    tree = cKDTree(inside, boxsize=side)
    apart, near = tree.query(inside, k=[min(2, len(radii))])
    least = float((apart[:, 0] - radii - radii[near[:, 0]]).min())
    found = tree.query_ball_point(inside, 2 * radii + max(reach, least))
    pairs = np.repeat(np.arange(len(radii)), [*map(len, found)]), np.concatenate(found).astype(int)
    first, second = (one[rank[pairs[0]] < rank[pairs[1]]] for one in pairs)
    way = centres[first] - centres[second]
    return first, second, way - side * np.round(way / side)
