"""Classical bounds of isotropic composites, to be set beside a homogenised Young's modulus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from alphacut.base.arrays import Array
from alphacut.rve.cell.cell import Phase
from alphacut.rve.result.moduli import AXES, hashin_shtrikman, plane_constants


@dataclass(frozen=True)
class ReferenceBounds:
    """Hashin–Shtrikman bounds of an isotropic composite, each (lower, upper) in Pa.

    Args:
        bulk: Of the bulk modulus K: of three dimensions, or of plane strain.
        shear: Of the shear modulus G.
        young: Young's modulus at the lower, and at the upper bounds of K and G.
    """

    bulk: tuple[float, float]
    shear: tuple[float, float]
    young: tuple[float, float]


def reference_bounds(
    phases: Sequence[Phase], *, fractions: Sequence[float] | Array, space: bool = False
) -> ReferenceBounds:
    """Return the Hashin–Shtrikman bounds of a composite of isotropic phases.

    Args:
        phases: The materials, one at least.
        fractions: Volume fraction of each phase; their sum is 1, which is not checked.
        space: Whether the composite is isotropic in space, and K that of three dimensions; else in
            the plane across fibres, and K that of plane strain.

    Returns:
        Lower and upper bound in Pa of K (`bulk`), G (`shear`) and E (`young`). The bounds of E are
        E with both lower and E with both upper bounds of K and G.

    Raises:
        ValueError: The numbers of phases and fractions differ.

    Example:
        >>> bounds = reference_bounds([Phase(20e9), Phase(80e9)], fractions=[0.8, 0.2])
        >>> [f"{end / 1e9:.2f}" for end in bounds.young]
        ['24.67', '26.78']
    """
    bulk, shear = hashin_shtrikman(np.asarray(fractions, float), phases, space=space)
    if space:
        # E rises with K and with G, so that its bounds are at those of both.
        young = 9 * bulk * shear / (3 * bulk + shear)
    else:
        # C11 + C12 = 2 K and C11 − C12 = 2 G of an isotropic material in plane strain.
        moduli = np.stack([2 * bulk, 2 * shear, shear], axis=-1)
        young = plane_constants(moduli, AXES)[:, 0]
    return ReferenceBounds(_ends(bulk), _ends(shear), _ends(young))


def _ends(values: Array) -> tuple[float, float]:
    """Return the lower and the upper bound of an array of both as numbers of Python."""
    lower, upper = map(float, values)
    return lower, upper
