"""Parts of the phases in the strain energy of an image, estimated from the fields of both sides."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array, Rows
from alphacut.rve.image.fields.element import Element, airy_element, displacement_element
from alphacut.rve.image.fields.energy import energies
from alphacut.rve.image.fields.side import UNIT_LOADS, SideSolution, coefficients
from alphacut.rve.image.model import ImageSolution
from alphacut.rve.image.phases import ModuliImages
from alphacut.rve.result.moduli import square_moduli
from alphacut.rve.result.result import PhaseEnergies


def phase_energies(
    solution: ImageSolution, images: ModuliImages, phase: Rows, *, count: int, aspect: float = 1.0
) -> PhaseEnergies:
    """Estimated parts of K and G of each phase in C11 + C12, C11 − C12 and C33; nothing is proved.

    The mean of the values by displacements and by stresses, whose distance is the declared error.

    Args:
        solution: Fields of one image.
        images: Its moduli, the least equal to the greatest.
        phase: Number of the phase of each pixel, shape (rows, columns).
        count: Number of phases.
        aspect: Height of a pixel over its width.
    """
    strain_energies = energy_parts(
        displacement_element(aspect), solution.upper, images, phase, count
    )
    stress_energies = energy_parts(airy_element(aspect), solution.lower, images, phase, count)
    # parts of the compliance S = C⁻¹ become parts of C by ∂S = −S ∂C S
    stiffness = np.linalg.inv(stress_energies.sum(axis=(0, 1)))
    by_strain = square_moduli(strain_energies)
    by_stress = square_moduli(stiffness @ stress_energies @ stiffness)
    return PhaseEnergies((by_strain + by_stress) / 2, abs(by_strain - by_stress))


def energy_parts(
    element: Element, side: SideSolution, images: ModuliImages, phase: Rows, count: int
) -> Array:
    """Energies of unit strains or stresses in K and in G of each phase, shape (count, 2, 3, 3)."""
    bulk, shear = images.bulk[0], images.shear[0]  # bulk is K + G/3, the modulus of the trace
    divisions = side.fields.shape[-2] // len(phase)
    trace, deviator = coefficients(element, bulk, shear)
    shear_fraction = shear / (3 * bulk)  # G/3 over K + G/3
    trace_rows, deviator_rows = element.parts
    weights = []
    for k in range(count):
        for rows, weight in (
            (trace_rows, trace * (1 - shear_fraction)),
            (trace_rows, trace * shear_fraction),
            (deviator_rows, deviator),
        ):
            weights.append((rows, np.kron(weight * (phase == k), np.ones((divisions, divisions)))))
    values = energies(element, side.fields, element.mean_modes(UNIT_LOADS), weights).value
    by_bulk, trace_by_shear, by_deviator = np.moveaxis(values.reshape(count, 3, 3, 3), 1, 0)
    return np.stack([by_bulk, trace_by_shear + by_deviator], axis=1)
