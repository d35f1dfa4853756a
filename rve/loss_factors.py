"""Loss factors of the cell from those of its phases.

A phase with losses has the moduli K (1 + i η_K) and G (1 + i η_G), and the cell has the elastic
stiffness at these (correspondence principle: Hashin, J. Appl. Mech. 32, 630, 1965). To first order
the loss factor of an effective modulus c is Σ η ∂ln c/∂ln X over all K and G of the phases. By Hill
and Mandel's lemma X ∂C/∂X is the part of X in the strain energy (Ungar and Kerwin, J. Acoust. Soc.
Am. 34, 954, 1962).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.rve.cell import AnyPhase, Phase
from alphacut.rve.phase_energies import CONSTANTS, first_order
from alphacut.rve.result import HomogenisedStiffness
from alphacut.rve.series.energies import complex_moduli
from alphacut.rve.spheres.result import HomogenisedSpheres

MAX_FIRST_ORDER = 0.1
"""Loss factor of a phase above which the series takes complex moduli."""
ROUND_OFF = 1e-12


@dataclass(frozen=True)
class LossFactors:
    """Effective loss factors by the names of `CONSTANTS`, and their declared absolute errors."""

    values: dict[str, float]
    errors: dict[str, float]


def bulk_and_shear_losses(phase: AnyPhase | None, has_bulk: bool) -> Array:
    """Matrix (2, 2) from loss factors (η_E, η_K) of a phase to (η_K, η_G).

    1/E = 1/(9 K) + 1/(3 G) gives η_E/E = η_K/(9 K) + η_G/(3 G).

    Args:
        phase: The material.
        has_bulk: Whether η_K is given; else both factors are η_E.

    Raises:
        RefusedError: η_K is given for a phase that is not isotropic.
    """
    if not has_bulk:
        return np.array([[1.0, 0.0], [1.0, 0.0]])
    if not isinstance(phase, Phase):
        raise RefusedError("loss of the bulk modulus", "there", "none beside a stiffness")
    nu = phase.poisson
    return np.array([[0.0, 1.0], [1.5 / (1 + nu), (nu - 0.5) / (1 + nu)]])


def loss_factors(result: HomogenisedStiffness, losses: Array) -> LossFactors:
    """Effective loss factors of E, G and K with declared errors.

    They are of first order; where a phase has more than `MAX_FIRST_ORDER`, those of the plane
    series are computed with complex moduli.

    Args:
        result: Of any model, with the energies of its phases.
        losses: Loss factors of K and G of each phase, shape (phases, 2).

    Raises:
        RefusedError: The model was not asked for the energies.
    """
    if result.energies is None:
        raise RefusedError("energies", None, "a model with energies=True")
    values, errors = first_order(result.energies, losses, result.constants_of)
    second_order = np.ptp(losses) ** 2 * values  # zero where all losses are equal
    if losses.max() > MAX_FIRST_ORDER and _is_plane_series(result):
        values, second_order = _by_complex_moduli(result, losses), np.zeros(3)
    errors = errors + second_order + ROUND_OFF * abs(values)
    return LossFactors(
        dict(zip(CONSTANTS, map(float, values), strict=True)),
        dict(zip(CONSTANTS, map(float, errors), strict=True)),
    )


def _is_plane_series(result: HomogenisedStiffness) -> bool:
    return result.method == "series" and not isinstance(result, HomogenisedSpheres)


def _by_complex_moduli(result: HomogenisedStiffness, losses: Array) -> Array:
    """Loss factors Im/Re of E, G, K by the series with complex K and G of the phases, (3,)."""
    cell, curve = result.cell, result.curve
    assert cell is not None
    elastic = [phase.bulk_and_shear for phase in cell.phases if isinstance(phase, Phase)]
    bulk, shear = (np.array(elastic) * (1 + 1j * losses)).T  # complex, (phases,) each
    radii = cell.radius(curve.theta)
    moduli = complex_moduli(radii, bulk, shear, harmonics=result.unknowns)[:, 0]
    mean = curve.weights @ moduli
    young, poisson = result.constants_of(mean)
    constants = np.array([young, young / (2 * (1 + poisson)), mean[0]])
    return np.asarray(constants.imag / constants.real)
