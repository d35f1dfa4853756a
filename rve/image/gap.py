"""Constitutive error of the two fields, pixel by pixel.

For a load the energy of the strains plus the complementary energy of the stresses minus their work
is nowhere negative, zero where one is the other's by Hooke's law, and its mean is the distance of
the bounds (Prager and Synge 1947; Ladevèze and Leguillon 1983).
"""

from __future__ import annotations

import numpy as np

from alphacut.rve.image.fields.element import Element
from alphacut.rve.image.fields.energy import modes_of
from alphacut.rve.image.fields.side import UNIT_LOADS
from alphacut.rve.image.solve import CrispBounds
from alphacut.stochastic.theta.truncated_normal import Array


def constitutive_gap(found: CrispBounds, strain: Array) -> Array:
    """Error of each pixel under a mean strain, shape (rows, columns), in Pa.

    Args:
        found: Bounds of one crisp image, solved with ``pixels=True``.
        strain: Mean strain (ε11, ε22, 2 ε12), shape (3,).

    Raises:
        ValueError: The energies of the pixels were not kept.
    """
    if found.upper.energy.pixels is None or found.lower.energy.pixels is None:
        raise ValueError("the energies of the pixels were not kept; solve with pixels=True")
    stress = found.bounds.lower @ strain
    strains = _modes(found.upper.side.element(found.upper.aspect), found.upper.fields, strain)
    stresses = _modes(found.lower.side.element(found.lower.aspect), found.lower.fields, stress)
    work = sum(values * stresses[key] for key, values in strains.items() if key in stresses) / 2
    first = np.einsum("jkyx,j,k->yx", found.upper.energy.pixels[0], strain, strain)
    second = np.einsum("jkyx,j,k->yx", found.lower.energy.pixels[0], stress, stress)
    return np.asarray(first + second - 2 * work)


def _modes(element: Element, fields: Array, mean: Array) -> dict[tuple[int, int, int], Array]:
    """Modes under the load, by (trace, difference or shear; order along y; along x)."""
    combined = np.einsum("tlkyx,l->tkyx", fields, mean)[:, None]
    means = element.mean_modes(UNIT_LOADS) @ mean
    whole = np.empty((len(element.modes), *fields.shape[-2:]))
    for _, lines, modes, _ in modes_of(element, combined, means[:, None]):
        whole[:, lines] = modes[:, 0, 0]
    return dict(zip(element.orders, whole, strict=True))
