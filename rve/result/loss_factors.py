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
"""Loss factor of a phase above which series take complex moduli. Tuned: below, what is of
second order, which is declared, is small."""


def loss_factors(result: HomogenisedStiffness, losses: Array | None = None) -> DeclaredConstants:
    """Return the effective loss factors of E, G and K with their declared errors.

    They are of first order in the loss factors of the phases. Where a phase has more than
    `MAX_FIRST_ORDER`, and the model takes complex moduli (series), they come from these.

    Args:
        result: Result of any model, with the energies of its phases.
        losses: Loss factors of K and G of each phase, shape (phases, 2); those that the phases of
            the cell state if not given, 0 where one states none.

    Raises:
        RefusedError: The result has no energies, or neither it nor the arguments have losses.
    """
    energies = result.energies
    if energies is None:
        allowed = "a model with energies=True, or phases with a loss factor"
        raise RefusedError("energies", None, allowed)
    if losses is None:
        if result.cell is None:
            raise RefusedError("losses", None, "loss factors of K and G of each phase")
        losses = np.array([[phase.loss or 0.0] * 2 for phase in result.cell.phases])
    values, errors = first_order(energies, losses, constants_of=result.constants_of)
    if losses.max() > MAX_FIRST_ORDER and energies.moduli_at is not None:
        assert result.cell is not None
        phases = [phase for phase in result.cell.phases if isinstance(phase, Phase)]
        moduli = np.array([phase.bulk_and_shear for phase in phases]) * (1 + 1j * losses)
        cell_moduli = energies.moduli_at(moduli[:, 0], moduli[:, 1])
        constants = young_shear_bulk(cell_moduli, result.constants_of)
        values = constants.imag / constants.real
    else:
        # Terms of second order vanish where all phases have equal losses.
        errors = errors + np.ptp(losses) ** 2 * values
    round_off = 1e-12 * abs(values)
    return DeclaredConstants.from_arrays(CONSTANTS, values, errors + round_off)


def first_order(
    energies: PhaseEnergies, losses: Array, *, constants_of: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Return the loss factors of E, G and K to first order, and their errors, shape (3,) each.

    The errors are those of the energies, not that of the first-order formula.

    Args:
        energies: Parts of the phases in the strain energy.
        losses: Loss factors η of K and G of each phase, shape (phases, 2).
        constants_of: Function that returns E and ν for the three moduli.
    """
    fractions, fraction_errors = energies.energy_fractions(constants_of)  # (phases, 2, 3)
    factors = np.tensordot(losses, fractions)

    # The fractions of each modulus add up to 1, and their errors δf to 0, so that
    #     |Σ δf η| = |Σ δf (η − m)| ≤ Σ |δf| |η − m|
    # for any m. The midpoint of the range of η makes the largest |η − m| smallest.
    midrange = (losses.max() + losses.min()) / 2
    factor_errors = np.tensordot(abs(losses - midrange), fraction_errors)
    return np.asarray(factors, float), np.asarray(factor_errors, float)
