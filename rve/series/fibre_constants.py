"""Constants of the cell as a material of aligned fibres, with their declared errors.

With the in-plane bulk modulus k, l = C13 and n = C33 of `engineering_constants`

    E_L = n − l²/k,   ν_LT = l/(2 k),   1/E_T = 1/(4 G_T) + 1/(4 K_T) + ν_LT²/E_L

G_T and K_T are those of the result's average, G_L is the shear modulus along the fibres, of the
square array by Rayleigh's harmonic multipoles (1892).
"""

from __future__ import annotations

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import Cell, Phase
from alphacut.rve.result.engineering_constants import Mixture
from alphacut.rve.result.result import DeclaredConstants, HomogenisedStiffness
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_images, lattice_sums
from alphacut.rve.series.means import SAFETY, finer_count
from alphacut.stochastic import ThetaRule, gauss_rule

CONSTANTS = ("E_T", "E_L", "nu_LT", "G_T", "G_L", "K_T")
NODES = 32  # in θ
_ROUND_OFF = 1e-12


def fibre_constants(result: HomogenisedStiffness) -> DeclaredConstants:
    """E_T, E_L, ν_LT, G_T, G_L and K_T of a result of round fibres, with declared errors.

    Errors are the largest changes over the corners of the intervals of z̄, G_T and G_L.

    Raises:
        RefusedError: The result has no cell, or not of round particles and two isotropic phases.
    """
    cell = result.cell
    if cell is None or not cell.square:
        raise RefusedError("cell", cell, "a result of round particles and two isotropic phases")
    mixture, bulk = Mixture.of_cell(cell), result.moduli[0] / 2
    G_T, (G_L, G_L_error) = result.shear, _mean_longitudinal_shear(cell)
    G_T_error = float(result.error_of(result.shear_of)) / G_T
    z, *z_bounds = mixture.z_from_bulk(bulk, result.modulus_errors[0])
    values = _constants(mixture, z, bulk, G_T, G_L)
    corners = [
        _constants(mixture, z_bound, mixture.bulk(z_bound), transverse, longitudinal)
        for z_bound in z_bounds
        for transverse in (G_T / (1 + G_T_error), G_T * (1 + G_T_error))
        for longitudinal in (G_L / (1 + G_L_error), G_L * (1 + G_L_error))
    ]
    errors = np.abs(np.array(corners) - values).max(axis=0) + _ROUND_OFF * np.abs(values)
    return DeclaredConstants.from_arrays(CONSTANTS, values, errors)


def _constants(mixture: Mixture, z: float, K_T: float, G_T: float, G_L: float) -> Array:
    """E_T, E_L, ν_LT, G_T, G_L and K_T, shape (6,), from Hill's z̄ and the other moduli."""
    lateral, axial = mixture.lateral_and_axial(z)
    nu_LT, E_L = lateral / (2 * K_T), axial - lateral**2 / K_T
    E_T = 1 / (1 / (4 * G_T) + 1 / (4 * K_T) + nu_LT**2 / E_L)
    return np.array([E_T, E_L, nu_LT, G_T, G_L, K_T])


def _mean_longitudinal_shear(cell: Cell) -> tuple[float, float]:
    """Mean shear modulus G_L along the fibres over θ in Pa, and its declared relative error."""
    matrix, inclusion = cell.matrix, cell.inclusion
    assert isinstance(matrix, Phase)
    assert isinstance(inclusion, Phase)

    def mean(rule: ThetaRule) -> tuple[float, float]:
        values, relative_errors = longitudinal_shear(cell.radius_map(rule.nodes), matrix, inclusion)
        total = float(rule.weights @ values)
        return total, float(rule.weights @ (values * relative_errors)) / total

    counts = NODES, finer_count(NODES), finer_count(finer_count(NODES))
    rules = (gauss_rule(cell.radius_map.distribution, points=count) for count in counts)
    (value, error), (finer, _), (finest, _) = map(mean, rules)
    return value, error + SAFETY * max(abs(value / finer - 1), abs(value / finest - 1))


_FEWEST, _MOST, _CONVERGED = 4, 128, 1e-12


def longitudinal_shear(radius: Array, matrix: Phase, inclusion: Phase) -> tuple[Array, Array]:
    """Shear modulus G_L along the fibres in Pa and its relative error, at radii in [0, 1), (n,)."""
    shears = float(matrix.stiffness[2, 2]), float(inclusion.stiffness[2, 2])
    harmonics, moduli = _FEWEST, _rayleigh_moduli(radius, *shears, _FEWEST)
    while True:
        harmonics, last_moduli = 2 * harmonics, moduli
        moduli = _rayleigh_moduli(radius, *shears, harmonics)
        change = np.abs(moduli / last_moduli - 1)
        if change.max() <= _CONVERGED or harmonics >= _MOST:
            return moduli, change + _CONVERGED


def _rayleigh_moduli(radius: Array, matrix: float, inclusion: float, harmonics: int) -> Array:
    """G_L by the potential A z + Σ_P Σ_n a_n (z − P)^-n over all particles P, odd n, shape (n,)."""
    orders = 2 * np.arange(harmonics) + 1
    scale = radius[:, None] ** orders
    images = lattice_images(lattice_sums(4 * _MOST).plain, orders, orders)
    contrast = (matrix - inclusion) / (matrix + inclusion)
    system = np.eye(harmonics) - contrast * images * scale[:, :, None] * scale[:, None, :]
    source = np.zeros((radius.size, harmonics, 1))
    source[:, 0, 0] = contrast * radius
    dipole = np.linalg.solve(system, source)[:, 0, 0]  # a_1 over A, scaled by r
    jump = ZETA_PERIOD * radius * dipole  # of the potential across the cell, by the images
    return np.asarray(matrix * (1 - jump) / (1 + jump))
