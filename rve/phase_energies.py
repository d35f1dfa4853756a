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

    def energy_fractions(self, constants_of: Callable[[Array], Array]) -> tuple[Array, Array]:
        """Fractions ∂ln c/∂ln X of each phase's moduli X = K, G in the effective c = E, G, K.

        By the chain rule from the energies, which are X ∂/∂X of C11 + C12, C11 − C12 and C33.

        Args:
            constants_of: E and ν from C11 + C12, C11 − C12 and C33.

        Returns:
            The fractions, shape (phases, 2, 3), and their declared errors.
        """
        moduli = self.values.sum(axis=(0, 1))

        def logarithmic_slopes(change: Array) -> Array:
            """Relative changes of E, G, K per change of the three moduli, by a complex step."""
            stepped = moduli + 1j * STEP * change
            young, poisson = constants_of(stepped)
            constants = np.array([young, young / (2 * (1 + poisson)), stepped[0]])
            return np.asarray(constants.imag / (STEP * constants.real))

        fractions = np.apply_along_axis(logarithmic_slopes, -1, self.values)
        unknown = np.isnan(moduli)
        slopes = abs(np.array([logarithmic_slopes(unit) for unit in np.eye(3)]))
        errors, parts = (np.where(unknown, 0, abs(x)) for x in (self.errors, self.values))
        # the slopes themselves are off by as much as the moduli are
        moduli_error = (errors.sum(axis=(0, 1)) / np.where(unknown, 1, moduli)).max()
        return fractions, np.asarray((errors + moduli_error * parts) @ slopes)


def first_order(
    energies: PhaseEnergies, losses: Array, constants_of: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Loss factors of E, G, K to first order, and their errors from those of energies, (3,) each.

    Args:
        energies: Parts of the phases in the strain energy.
        losses: Loss factors of K and G of each phase, shape (phases, 2).
        constants_of: E and ν, from which G and K follow, of C11 + C12, C11 − C12 and C33.
    """
    # by phase, by its K and G, and by E, G and K of the cell: (phases, 2, 3)
    fractions, errors = energies.energy_fractions(constants_of)
    # only differences of losses count in the error, since the fractions add up to 1
    differences = abs(losses - (losses.max() + losses.min()) / 2)
    factors, factor_errors = np.tensordot(losses, fractions), np.tensordot(differences, errors)
    return np.asarray(factors, float), np.asarray(factor_errors, float)
