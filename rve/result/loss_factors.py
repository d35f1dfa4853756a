"""Loss factors of the cell from those of its phases.

A phase with losses has the moduli K (1 + i η_K) and G (1 + i η_G), and the cell has the elastic
stiffness at these (correspondence principle: Hashin, J. Appl. Mech. 32, 630, 1965). To first order
the loss factor of an effective modulus c is Σ η ∂ln c/∂ln X over all K and G of the phases. By Hill
and Mandel's lemma X ∂C/∂X is the part of X in the strain energy (Ungar and Kerwin, J. Acoust. Soc.
Am. 34, 954, 1962).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import Phase
from alphacut.rve.result.result import (
    DeclaredConstants,
    HomogenisedStiffness,
    PhaseEnergies,
    young_shear_bulk,
)

CONSTANTS = ("E", "G", "K")
"""Effective moduli that loss factors are of; K is the plane-strain bulk modulus."""
MAX_FIRST_ORDER = 0.1
"""Loss factor of a phase above which series take complex moduli."""
ROUND_OFF = 1e-12


def loss_factors(result: HomogenisedStiffness, losses: Array | None = None) -> DeclaredConstants:
    """Effective loss factors of E, G and K, to first order or by complex moduli, with errors.

    Complex moduli where a phase has more than `MAX_FIRST_ORDER` and the model takes them (series).

    Args:
        result: Of any model, with the energies of its phases, else it is refused.
        losses: Loss factors of K and G of each phase, shape (phases, 2); those that the phases of
            the cell state if not given, 0 where one states none.
    """
    energies = result.energies
    if energies is None:
        allowed = "a model with energies=True, or phases with a loss factor"
        raise RefusedError("energies", None, allowed)
    if losses is None:
        if result.cell is None:
            raise RefusedError("losses", None, "loss factors of K and G of each phase")
        losses = np.array([[phase.loss or 0.0] * 2 for phase in result.cell.phases])
    values, errors = first_order(energies, losses, result.constants_of)
    if losses.max() > MAX_FIRST_ORDER and energies.moduli_at is not None:
        assert result.cell is not None
        phases = [phase for phase in result.cell.phases if isinstance(phase, Phase)]
        moduli = np.array([phase.bulk_and_shear for phase in phases]) * (1 + 1j * losses)
        constants = young_shear_bulk(energies.moduli_at(*moduli.T), result.constants_of)
        values = constants.imag / constants.real
    else:
        errors = errors + np.ptp(losses) ** 2 * values  # second order; 0 where losses are equal
    errors = errors + ROUND_OFF * abs(values)
    return DeclaredConstants.from_arrays(CONSTANTS, values, errors)


def first_order(
    energies: PhaseEnergies, losses: Array, constants_of: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Loss factors of E, G, K to first order, and their errors from those of energies, (3,) each.

    Args:
        energies: Parts of the phases in the strain energy.
        losses: Loss factors of K and G of each phase, shape (phases, 2).
        constants_of: E and ν, from which G and K follow, from the three moduli.
    """
    # by phase, by its K and G, and by E, G and K of the cell: (phases, 2, 3)
    fractions, errors = energies.energy_fractions(constants_of)
    # only differences of losses count in the error, since the fractions add up to 1
    differences = abs(losses - (losses.max() + losses.min()) / 2)
    factors, factor_errors = np.tensordot(losses, fractions), np.tensordot(differences, errors)
    return np.asarray(factors, float), np.asarray(factor_errors, float)
