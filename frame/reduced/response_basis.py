"""Basis from harmonic responses: proper orthogonal decomposition in strain energy.

By Parseval's theorem, responses over frequency hold the same shapes as trajectories over time, at
the price of one sparse factorisation each. Strain energy as the measure favours shapes that matter
for drifts, not only for the roof.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from alphacut.frame.calculus.jet import Array

if TYPE_CHECKING:
    from scipy.sparse import csc_matrix


def energy_basis(
    shapes: Array, M: csc_matrix, K: csc_matrix, *, keep: float, always: Sequence[Array] = ()
) -> Array:
    """M-orthonormal shapes of strain energy above `keep` of the largest, or `always` kept.

    Args:
        shapes: Displacements, shape (N, k).
        M: Mass matrix (N, N).
        K: Stiffness matrix (N, N).
        keep: Share of strain energy.
        always: Further shapes, each (N,).
    """
    energy, vectors = np.linalg.eigh(shapes.T @ (K @ shapes))
    kept = energy > max(keep, 1e-13) * energy.max()
    chosen = np.column_stack([*(shapes @ (vectors[:, kept] / np.sqrt(energy[kept]))).T, *always])
    for _ in range(2):  # the second time takes out what rounding left
        chosen = chosen / np.sqrt(np.einsum("ij,ij->j", chosen, M @ chosen))
        mass, vectors = np.linalg.eigh(chosen.T @ (M @ chosen))
        apart = mass > 1e-12 * mass.max()
        chosen = chosen @ (vectors[:, apart] / np.sqrt(mass[apart]))
    return chosen
