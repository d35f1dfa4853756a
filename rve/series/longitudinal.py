"""Shear modulus along the fibres of the square array, by Rayleigh's harmonic multipoles (1892)."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_images, lattice_sums

_FEWEST, _MOST, _CONVERGED = 4, 128, 1e-12


def longitudinal_shear(radius: Array, matrix: Phase, inclusion: Phase) -> tuple[Array, Array]:
    """Shear modulus G_L along the fibres of n cells in Pa, and its relative error, (n,) each.

    Args:
        radius: Radii over half the cell's side, shape (n,), each in [0, 1).
        matrix: Material outside the particle.
        inclusion: Material of the particle.
    """
    shears = float(matrix.stiffness[2, 2]), float(inclusion.stiffness[2, 2])
    harmonics, moduli = _FEWEST, _rayleigh_moduli(radius, *shears, _FEWEST)
    while True:
        harmonics, last_moduli = 2 * harmonics, moduli
        moduli = _rayleigh_moduli(radius, *shears, harmonics)
        change = np.abs(moduli / last_moduli - 1)
        if change.max() <= _CONVERGED or harmonics >= _MOST:
            return moduli, change + _CONVERGED


def _rayleigh_moduli(radius: Array, matrix: float, inclusion: float, harmonics: int) -> Array:
    """G_L of n cells by Rayleigh's multipoles, shape (n,), in the unit of both shear moduli.

    The potential is A z + Σ_P Σ_n a_n (z − P)^-n over all particles P, odd n.
    """
    orders = 2 * np.arange(harmonics) + 1
    scale = radius[:, None] ** orders
    images = lattice_images(lattice_sums(4 * _MOST), orders, orders)
    contrast = (matrix - inclusion) / (matrix + inclusion)
    system = np.eye(harmonics) - contrast * images * scale[:, :, None] * scale[:, None, :]
    source = np.zeros((radius.size, harmonics, 1))
    source[:, 0, 0] = contrast * radius
    dipole = np.linalg.solve(system, source)[:, 0, 0]  # a_1 over A, scaled by r
    jump = ZETA_PERIOD * radius * dipole  # of the potential across the cell, by the images
    return np.asarray(matrix * (1 - jump) / (1 + jump))
