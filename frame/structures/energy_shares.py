"""Shares of terms of the stiffness in the strain energy of modes, by which materials damp them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.linalg import eigh

from alphacut.frame.structures.matrix import MatrixStructure, value_of
from alphacut.fuzzy.arrays import Array, Rows


def modal_energy_shares(system: MatrixStructure, terms: Sequence[int] | Rows) -> Array:
    """Return the fraction of each mode's strain energy in some terms of K = Σ K_i, shape (modes,).

    It is Σ φᵀK_i φ / φᵀK φ over these terms, for the modes φ by rising frequency. The loss factor
    of a mode is to first order the mean of those of its parts by these shares (Johnson and
    Kienholz, AIAA Journal 20, 1284, 1982), with modes at nominal values.

    Args:
        system: The structure.
        terms: Indices of the terms in the structure's stiffness.
    """
    p = system.parameters
    mass = np.sum([float(value_of(factor, p)) * array for factor, array in system.mass], axis=0)
    parts = np.array([float(value_of(factor, p)) * array for factor, array in system.stiffness])
    stiffness, a, b = parts.sum(axis=0), system.massive, system.massless
    shapes = np.zeros((system.size, len(a)))
    # static condensation: q_b = follow q_a
    follow = -np.linalg.solve(stiffness[np.ix_(b, b)], stiffness[np.ix_(b, a)])
    condensed = stiffness[np.ix_(a, a)] + stiffness[np.ix_(a, b)] @ follow
    shapes[a] = eigh(condensed, mass[np.ix_(a, a)])[1]
    shapes[b] = follow @ shapes[a]
    energies = np.einsum("ik,tij,jk->tk", shapes, parts, shapes)
    return np.asarray(energies[terms].sum(axis=0) / energies.sum(axis=0))
