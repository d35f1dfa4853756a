"""Planar stiffness matrices of the cell on many θ-levels at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from alphacut.rve.mesh.triangulation import Integers
from alphacut.stochastic.theta.truncated_normal import Array

# Strang's rule of degree 2, weights 1/6
_CORNERS = np.array([[1 / 6, 1 / 6], [2 / 3, 1 / 6], [1 / 6, 2 / 3]])


def gradients(points: Array, nodes: int) -> Array:
    """Derivatives of the shape functions of 3 or 6 nodes at points (q, 2), (q, 2, nodes)."""
    x, y = points.T
    barycentric = np.array([1 - x - y, x, y])
    slopes = np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])
    if nodes == 3:
        return np.broadcast_to(slopes.T, (len(points), 2, 3))
    corner = (4 * barycentric.T - 1)[:, None, :] * slopes.T
    middle = [
        4 * (np.outer(barycentric[i], slopes[j]) + np.outer(barycentric[j], slopes[i]))
        for i, j in ((0, 1), (0, 2), (1, 2))
    ]
    return np.concatenate([corner, np.stack(middle, axis=-1)], axis=-1)


def element_stiffness(positions: Array, stiffness: Array) -> Array:
    """Stiffness matrices of triangles, straight or curved.

    Args:
        positions: Nodes of each triangle, shape (m, nodes, 2), nodes 3 or 6.
        stiffness: Voigt stiffness of each, shape (m, 3, 3).

    Returns:
        Shape (m, 2·nodes, 2·nodes), the two components of a node side by side.
    """
    table = gradients(_CORNERS, positions.shape[1])
    jacobian = np.einsum("qan,mnx->mqax", table, positions)
    determinant = (
        jacobian[..., 0, 0] * jacobian[..., 1, 1] - jacobian[..., 0, 1] * jacobian[..., 1, 0]
    )
    cofactor = np.stack(
        [jacobian[..., 1, 1], -jacobian[..., 0, 1], -jacobian[..., 1, 0], jacobian[..., 0, 0]],
        axis=-1,
    )
    inverse = cofactor.reshape(*determinant.shape, 2, 2) / determinant[..., None, None]
    slope = inverse @ table  # (m, q, 2, nodes)
    strain = np.zeros((*determinant.shape, 3, 2 * positions.shape[1]))
    strain[..., 0, 0::2] = strain[..., 2, 1::2] = slope[..., 0, :]
    strain[..., 1, 1::2] = strain[..., 2, 0::2] = slope[..., 1, :]
    stress = (stiffness[:, None] * determinant[..., None, None] / 6) @ strain
    columns = strain.shape[-1]
    return np.asarray(
        strain.reshape(len(strain), -1, columns).transpose(0, 2, 1)
        @ stress.reshape(len(strain), -1, columns)
    )


@dataclass(frozen=True)
class LevelPattern:
    """Lower triangle of a planar matrix: where the entries of every element matrix go.

    Args:
        unknowns: Unknown of every local degree of freedom, −1 where there is none, shape (m, k).
    """

    unknowns: Integers

    @cached_property
    def size(self) -> int:
        """Order of the matrix."""
        return int(self.unknowns.max()) + 1

    @cached_property
    def _targets(self) -> tuple[Integers, Integers, Integers]:
        row, column = np.broadcast_arrays(self.unknowns[:, :, None], self.unknowns[:, None, :])
        kept = np.flatnonzero((column >= 0) & (row >= column))
        keys, target = np.unique(
            column.ravel()[kept] * self.size + row.ravel()[kept], return_inverse=True
        )
        return kept, target, keys

    @property
    def rows_columns(self) -> tuple[Integers, Integers]:
        """Row and column of each stored entry, column by column."""
        column, row = np.divmod(self._targets[2], self.size)
        return row, column

    def values(self, elements: Array) -> Array:
        """Stored entries from the element matrices, shape (m, k, k)."""
        kept, target, keys = self._targets
        return np.bincount(target, weights=elements.ravel()[kept], minlength=len(keys))
