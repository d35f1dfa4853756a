"""A cell with a particle that is not round: its error is estimated by two orders and two meshes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.result.moduli import axial_moduli

ACCURATE_ORDER, REFERENCE_ORDER = 4, 5
"""Order of the elements whose error is estimated, and the next, which estimates it."""
LIMIT = 0.7
"""Mesh size up to which the second mesh is twice as coarse, in halves of the cell's side: there
size ends to matter. Where it would lie above, the second mesh is twice as fine."""
ORDER_SAFETY = 1.6
"""True error of order 4 over its distance from order 5: 1.02 … 1.59 of 216 moduli (ellipses and
stars, contrasts 1e-3 … 1e3, mesh sizes 0.15, 0.3, 0.6)."""
NOISE = 1e-12  # of an energy, over the modulus
MESH_SAFETY = 1.1
"""The same over the distance from order 5 on the finer mesh: 1.00 … 1.07."""


def second_size(mesh_size: float) -> float:
    """Edge length of the second mesh."""
    return 2 * mesh_size if 2 * mesh_size <= LIMIT else mesh_size / 2


@dataclass(frozen=True)
class OutlineSlice:
    """A two-dimensional cell solved for m inclusions by several orders, the highest on two meshes.

    Args:
        by_order: Stiffness in Pa, (m, 3, 3), by order; orders 4 and 5 are among them.
        on_second_mesh: Stiffness by order 5 on the second mesh, shape (m, 3, 3), in Pa.
        unknowns: Number of unknowns of the linear system, by order.
        round_off: Relative error by rounding of each inclusion, shape (m, 1).
        energies: Parts of the phases in the three moduli by order, shape (m, 2, 2, 3), in Pa; empty
            where they were not asked for.
    """

    by_order: Mapping[int, Array]
    on_second_mesh: Array
    unknowns: Mapping[int, int]
    round_off: Array
    energies: Mapping[int, Array] = field(default_factory=dict)

    def stiffness(self, order: int) -> Array:
        """Stiffness by elements of one order, shape (m, 3, 3), in Pa."""
        return self.by_order[order]

    def error(self, order: int, *, square: bool) -> Array:
        """Declared relative errors of C11 + C12, C11 − C12 and C33, shape (m, 3).

        The error of order 4 is the larger of its distances from order 5 on the same mesh and on
        the second one, each with a safety factor; other orders add their distance from order 4.

        Args:
            order: Order of the elements of the result.
            square: Whether the stiffness has the symmetry of the square.
        """
        accurate, higher = self.by_order[ACCURATE_ORDER], self.by_order[REFERENCE_ORDER]
        by_order = ORDER_SAFETY * _distance(accurate, higher, square=square)
        by_mesh = MESH_SAFETY * _distance(accurate, self.on_second_mesh, square=square)
        error = np.maximum(by_order, by_mesh)
        distance = _distance(self.by_order[order], accurate, square=square)
        return np.asarray((1 + distance) * (1 + error + self.round_off) - 1)


def _distance(first: Array, second: Array, *, square: bool) -> Array:
    """Largest relative distance of each modulus along either axis, shape (m, 3)."""
    ratio = axial_moduli(first, square=square) / axial_moduli(second, square=square)
    return np.asarray((np.maximum(ratio, 1 / ratio) - 1).max(axis=1))


def energies_with_errors(energies: Mapping[int, Array], order: int) -> tuple[Array, Array]:
    """Energies by elements of `order` and their declared errors, shape (m, phases, 2, 3) each.

    The error is the distance from the highest other order, times a safety factor.
    """
    values, reference = energies[order], energies[max(set(energies) - {order})]
    error = ORDER_SAFETY * abs(values - reference)
    return values, error + NOISE * values.sum(axis=(1, 2), keepdims=True)
