"""Shear modulus along the fibres of the square array, by Rayleigh's harmonic multipoles (1892)."""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.rve.cell import Phase
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_images, lattice_sums

_FEWEST, _MOST, _SETTLED = 4, 128, 1e-12


def longitudinal_shear(radius: Array, matrix: Phase, inclusion: Phase) -> tuple[Array, Array]:
    """G13 in Pa of n cells and its declared relative error, both of shape (n,).

    Args:
        radius: Radii over half the cell's side, shape (n,), each in [0, 1).
        matrix: Material outside the particle.
        inclusion: Material of the particle.
    """
    shears = [float(phase.stiffness[2, 2]) for phase in (matrix, inclusion)]
    values = np.array([_converged(float(r), *shears) for r in radius])
    return values[:, 0], values[:, 1]


def _converged(radius: float, matrix: float, inclusion: float) -> tuple[float, float]:
    """Modulus and its change by the last harmonics."""
    count, value = _FEWEST, _modulus(radius, matrix, inclusion, _FEWEST)
    while True:
        count, before = 2 * count, value
        value = _modulus(radius, matrix, inclusion, count)
        change = abs(value / before - 1)
        if change <= _SETTLED or count >= _MOST:
            return value, change + _SETTLED


def _modulus(radius: float, matrix: float, inclusion: float, count: int) -> float:
    orders = 2 * np.arange(count) + 1
    scale = radius**orders
    coupling = lattice_images(lattice_sums(4 * _MOST), orders, orders) * scale[:, None] * scale
    factor = (matrix - inclusion) / (matrix + inclusion)
    source = np.zeros(count)
    source[0] = factor * radius
    first = np.linalg.solve(np.eye(count) - factor * coupling, source)[0]
    turn = ZETA_PERIOD * radius * first
    return float(matrix * (1 - turn) / (1 + turn))
