"""Shear modulus along the fibres of the square array, by Rayleigh's harmonic multipoles (1892)."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_images, lattice_sums

_FEWEST, _MOST, _CONVERGED = 4, 128, 1e-12


def longitudinal_shear(radius: Array, matrix: Phase, inclusion: Phase) -> tuple[Array, Array]:
    """G_L in Pa of n cells and its declared relative error, both of shape (n,).

    Args:
        radius: Radii over half the cell's side, shape (n,), each in [0, 1).
        matrix: Material outside the particle.
        inclusion: Material of the particle.
    """
    shears = float(matrix.stiffness[2, 2]), float(inclusion.stiffness[2, 2])
    count, value = _FEWEST, _moduli(radius, *shears, _FEWEST)
    while True:
        count, before = 2 * count, value
        value = _moduli(radius, *shears, count)
        change = np.abs(value / before - 1)
        if change.max() <= _CONVERGED or count >= _MOST:
            return value, change + _CONVERGED


def _moduli(radius: Array, matrix: float, inclusion: float, count: int) -> Array:
    """G_L of n cells by so many harmonics, shape (n,)."""
    orders = 2 * np.arange(count) + 1
    scale = radius[:, None] ** orders
    images = lattice_images(lattice_sums(4 * _MOST), orders, orders)
    factor = (matrix - inclusion) / (matrix + inclusion)
    system = np.eye(count) - factor * images * scale[:, :, None] * scale[:, None, :]
    source = np.zeros((radius.size, count, 1))
    source[:, 0, 0] = factor * radius
    turn = ZETA_PERIOD * radius * np.linalg.solve(system, source)[:, 0, 0]
    return np.asarray(matrix * (1 - turn) / (1 + turn))
