"""Parts of the phases in the strain energy of the cell, and loss factors to first order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array

CONSTANTS = ("E", "G", "K")
"""Effective moduli that loss factors are of; K is the plane-strain bulk modulus."""
STEP = 1e-30  # of complex-step derivatives, which have no cancellation


@dataclass(frozen=True, eq=False)
class PhaseEnergies:
    """Parts of the phases in the strain energy: X ∂c/∂X of the three moduli c.

    Args:
        values: For X = K and G of each phase, of C11 + C12, C11 − C12 and C33, shape
            (phases, 2, 3), in Pa; their sum is the three moduli (nan where not computed).
        errors: Declared absolute errors, same shape; nan where unknown.
    """

    values: Array
    errors: Array

    def shares(self, constants_of: Callable[[Array], Array]) -> tuple[Array, Array]:
        """∂ln c/∂ln X for c = E, G, K, shape (phases, 2, 3), and their declared errors.

        Args:
            constants_of: E and ν from the three moduli.
        """
        moduli = self.values.sum(axis=(0, 1))

        def logarithmic_slopes(change: Array) -> Array:
            moved = moduli + 1j * STEP * change
            young, poisson = constants_of(moved)
            constants = np.array([young, young / (2 * (1 + poisson)), moved[0]])
            return np.asarray(constants.imag / (STEP * constants.real))

        shares = np.apply_along_axis(logarithmic_slopes, -1, self.values)
        unknown = np.isnan(moduli)
        slopes = abs(np.array([logarithmic_slopes(unit) for unit in np.eye(3)]))
        errors, parts = (np.where(unknown, 0, abs(x)) for x in (self.errors, self.values))
        # the slopes themselves are off by as much as the moduli are
        moduli_error = (errors.sum(axis=(0, 1)) / np.where(unknown, 1, moduli)).max()
        return shares, np.asarray((errors + moduli_error * parts) @ slopes)


def first_order(
    energies: PhaseEnergies, losses: Array, constants_of: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Loss factors of E, G, K to first order, and what they are off by the energies, (3,) each."""
    shares, errors = energies.shares(constants_of)
    # equal losses are those of the cell whatever the shares: they add up to 1
    unequal = abs(losses - (losses.max() + losses.min()) / 2)
    values, error = (np.tensordot(*pair) for pair in ((losses, shares), (unequal, errors)))
    return values, error
