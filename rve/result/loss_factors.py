"""Loss factors of the cell from those of its phases.

A phase with losses has the moduli K (1 + i η_K) and G (1 + i η_G), and the cell has the elastic
stiffness at these (correspondence principle: Hashin, J. Appl. Mech. 32, 630, 1965). To first order
the loss factor of an effective modulus c is Σ η ∂ln c/∂ln X over all K and G of the phases. By Hill
and Mandel's lemma X ∂C/∂X is the part of X in the strain energy (Ungar and Kerwin, J. Acoust. Soc.
Am. 34, 954, 1962).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.fuzzy import FuzzyNumber
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

    They are Σ η ∂ln c/∂ln X over the moduli X = K, G of the phases, to first order in the loss
    factors η of the phases. Where one of these exceeds 0.1, and the model takes complex moduli
    (series), the loss factors are Im c/Re c at the complex moduli X (1 + iη), without that
    approximation.

    Args:
        result: Result of any model, with the strain energies of its phases; K is that of plane
            strain, of spheres that of space.
        losses: Loss factors of K and G of each phase, shape (phases, 2), matrix first. By default
            both are the loss factor of the phase in the result's cell, or 0 if it has none.

    Returns:
        Values and absolute errors by "E", "G" and "K". The errors follow from those of the
        energies; where the first-order formula is used, a term of second order is added. NaN where
        the model declares none.

    Raises:
        RefusedError: The result has no energies, or `losses` is not given and the result has no
            cell whose phases could state them.
        ValueError: `losses` is of another number of phases.

    Example:
        >>> from alphacut.rve import Phase, SeriesModel
        >>> from alphacut.stochastic import HermiteMap
        >>> phases = Phase(20e9, loss=0.04), Phase(80e9, 0.2, loss=0.01)
        >>> [cell] = SeriesModel().solve(HermiteMap(0.2, 0.1, 0.6, 0.1), phases[0], [phases[1]])
        >>> f"{loss_factors(cell).values['E']:.4f}"
        '0.0383'
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
        # Correspondence principle (Hashin, J. Appl. Mech. 32, 630, 1965): the cell has the elastic
        # moduli at the complex moduli of its phases.
        phases = [phase for phase in result.cell.phases if isinstance(phase, Phase)]
        moduli = np.array([phase.bulk_and_shear for phase in phases]) * (1 + 1j * losses)
        cell_moduli = energies.moduli_at(moduli[:, 0], moduli[:, 1])
        constants = young_shear_bulk(cell_moduli, result.constants_of)
        values = constants.imag / constants.real
    else:
        # Declared, not proved: terms of second order vanish where all phases have equal losses, and
        # are of the size of the squared differences.
        errors = errors + np.ptp(losses) ** 2 * values
    # Rounding of the energies, which no model declares.
    round_off = 1e-12 * abs(values)
    return DeclaredConstants.from_arrays(CONSTANTS, values, errors + round_off)


def first_order(
    energies: PhaseEnergies, losses: Array, *, constants_of: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Return the effective loss factors of E, G and K to first order, and their errors.

    The loss factor of an effective modulus c is Σ_X f η_X with f = ∂ln c/∂ln X, where X runs over
    the bulk and the shear modulus of each phase and η_X is the loss factor of X. The f are
    fractions of the strain energy (Ungar and Kerwin, J. Acoust. Soc. Am. 34, 954, 1962).

    Args:
        energies: Parts of the strain energy of the cell that belong to the moduli X, with their
            errors.
        losses: Loss factors η of K and G of each phase, shape (phases, 2).
        constants_of: Function that returns E and ν, shape (2,), for the three moduli of the cell
            that `energies` belong to, shape (3,): in the plane C11 + C12, C11 − C12 and C33.

    Returns:
        Loss factors of E, G and K, shape (3,), and their absolute errors by the errors of the
        energies, shape (3,), NaN where unknown. The error of the first-order formula is not added.
    """
    fractions, fraction_errors = energies.energy_fractions(constants_of)  # (phases, 2, 3)
    # The sum is over the phases and over their bulk and shear modulus, the first two axes.
    factors = np.tensordot(losses, fractions)

    # The fractions of each modulus add up to 1, and their errors δf to 0, so that
    #     |Σ δf η| = |Σ δf (η − m)| ≤ Σ |δf| |η − m|
    # for any m. The midpoint of the range of η makes the largest |η − m| smallest.
    midrange = (losses.max() + losses.min()) / 2
    factor_errors = np.tensordot(abs(losses - midrange), fraction_errors)
    return np.asarray(factors, float), np.asarray(factor_errors, float)


def phase_loss_cuts(losses: Sequence[FuzzyNumber], alpha: Sequence[float]) -> Array:
    """Return α-cuts of the loss factor of each phase, shape (levels, 2, phases)."""
    return np.array([np.transpose([loss.cut(level) for loss in losses]) for level in alpha])
