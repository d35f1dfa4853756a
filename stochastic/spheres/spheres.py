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
        first, second, apart = close_pairs(self.centres, self.radii, self.side, reach=0.0)
        gaps = apart - self.radii[first] - self.radii[second]
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
    """Pairs whose surfaces may be nearer than `reach`, and the distances of their centres.

    Returns:
        First and second index, and the periodic distance, shape (pairs,) each; at least every pair
        nearer than the two largest radii and `reach` together, and each sphere's nearest.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(np.mod(centres, side), boxsize=side)
    nearest = tree.query(np.mod(centres, side), k=min(2, len(radii)))[0].max()
    limit = min(max(2 * radii.max() + reach, float(nearest)), 0.49 * side)
    pairs = tree.query_pairs(limit, output_type="ndarray")
    apart = centres[pairs[:, 0]] - centres[pairs[:, 1]]
    apart -= side * np.round(apart / side)
    return pairs[:, 0], pairs[:, 1], np.linalg.norm(apart, axis=1)
