"""Parts of the phases in the strain energy of an image, estimated from the fields of both sides."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.rve.cell import square_moduli
from alphacut.rve.image.fields.element import Element, airy_element, displacement_element
from alphacut.rve.image.fields.energy import energies
from alphacut.rve.image.fields.side import UNIT_LOADS, SideSolution, coefficients
from alphacut.rve.image.phase_images import ModuliImages
from alphacut.rve.image.solve import ImageSolution
from alphacut.rve.phase_energies import PhaseEnergies


def phase_energies(
    solution: ImageSolution, images: ModuliImages, phase: Rows, *, count: int, aspect: float = 1.0
) -> PhaseEnergies:
    """Parts of K and G of each phase in the three moduli, of which nothing is proved.

    Strains and stresses are two approximations: the mean of both, whose distance is the error. The
    parts of either add up to the work of its loads to rounding.

    Args:
        solution: Of one image.
        images: Its moduli; the least are the greatest.
        phase: Number of the phase of each pixel, shape (rows, columns).
        count: Number of phases.
        aspect: Height of a pixel over its width.
    """
    by_strain = energy_parts(displacement_element(aspect), solution.upper, images, phase, count)
    by_stress = energy_parts(airy_element(aspect), solution.lower, images, phase, count)
    # the compliance S = C⁻¹ has ∂S = −S ∂C S
    stiffness = np.linalg.inv(by_stress.sum(axis=(0, 1)))
    moduli = [square_moduli(x) for x in (by_strain, stiffness @ by_stress @ stiffness)]
    return PhaseEnergies((moduli[0] + moduli[1]) / 2, abs(moduli[0] - moduli[1]))


def energy_parts(
    element: Element, side: SideSolution, images: ModuliImages, phase: Rows, count: int
) -> Array:
    """Energies of unit strains or stresses by K and G of each phase, shape (count, 2, 3, 3)."""
    bulk, shear = images.bulk[0], images.shear[0]
    division = np.ones((side.fields.shape[-2] // len(phase),) * 2)
    trace, deviator = coefficients(element, bulk, shear)
    of_shear = shear / (3 * bulk)  # of K + G/3, the modulus of the trace
    traces, deviators = element.parts
    weights = [
        (rows, np.kron(weight * (phase == k), division))
        for k in range(count)
        for rows, weight in (
            (traces, trace * (1 - of_shear)),
            (traces, trace * of_shear),
            (deviators, deviator),
        )
    ]
    values = energies(element, side.fields, element.mean_modes(UNIT_LOADS), weights).value
    by_bulk, mixed, by_deviator = np.moveaxis(values.reshape(count, 3, 3, 3), 1, 0)
    return np.stack([by_bulk, mixed + by_deviator], axis=1)
