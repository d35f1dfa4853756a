"""Bulk modulus of coated spheres.

A sphere of radius .2 (G = 5, Lamé's λ = 4) in a spherical shell of radius .4 (G = 3, λ = 2) stands
in a periodic cube of side 1 (G = 1). With λ = 3.63867684478 the cube's own bulk modulus is that of
coated spheres (Hashin 1962): then all around the shell is strained evenly, and the cell has the
same bulk modulus, λ + 2/3 G. It is the lower bound of Hashin and Shtrikman (1963) for a mixture
with one part of the sphere to seven of the shell. The source computes 4.305067 on a grid of 64³.
There are no units.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from alphacut.rve import Phase, reference_bounds
from benchmarks.balls import Moduli, moduli_between, stiffness_between
from benchmarks.public.row import Row

NAME = "Coated sphere (fibergen)"
SOURCE = (
    "F. Ospald, fibergen, `demo/elasticity/hashin/project.xml` in fospald/fibergen at 3e00d85,"
    " lines 12–26 (input) and 30–32 (numbers)"
)
PUBLISHED = "4.305343511446667"
CORE = 5.0, 4.0
SHELL = 3.0, 2.0
CUBE = 1.0, 3.63867684478


def rows() -> Iterator[Row]:
    """The bound of the mixture, and bounds of the cell."""
    unit = 1e9  # a phase is in Pa
    phases = [_phase(*_moduli(*lame), unit=unit) for lame in (SHELL, CORE)]
    mixture = reference_bounds(phases, fractions=[7 / 8, 1 / 8], space=True)
    remark = "Hashin–Shtrikman bound; the input has 12 digits"
    yield Row("K", PUBLISHED, mixture.bulk[0] / unit, digits=12, tolerance=2e-12, remark=remark)
    voxels = 40
    images = moduli_between(
        [voxels] * 3,
        [1.0] * 3,
        np.full((1, 3), 0.5),
        matrix=_moduli(*CUBE),
        balls=[(0.4, _moduli(*SHELL)), (0.2, _moduli(*CORE))],
    )
    cell = stiffness_between(*images).bulk
    yield Row("K of the cell", PUBLISHED, tuple(cell), digits=5, remark=f"{voxels}³ voxels")


def _moduli(shear: float, lame: float) -> Moduli:
    """Bulk and shear modulus from G and λ."""
    return lame + 2 / 3 * shear, shear


def _phase(bulk: float, shear: float, *, unit: float) -> Phase:
    """The phase with a bulk and shear modulus in a unit of Pa."""
    young = 9 * bulk * shear / (3 * bulk + shear)
    return Phase(young * unit, young / (2 * shear) - 1)
