"""Elastic constants of a material of aligned fibres, with their declared errors.

With the in-plane bulk modulus k, l = C13 and n = C33 of `engineering_constants`,

    E_L = n − l²/k,   ν_LT = l/(2 k),   1/E_T = 1/(4 G_T) + 1/(4 K_T) + ν_LT²/E_L.

G_T and K_T are those of the result's average. G_L, the shear modulus along the fibres, is that of
the square array by Rayleigh's harmonic multipoles (1892).
"""

from __future__ import annotations

from functools import cache

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError
from alphacut.rve.cell.cell import Cell, Phase
from alphacut.rve.result.engineering_constants import Mixture
from alphacut.rve.result.result import DeclaredConstants, HomogenisedStiffness
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_images, lattice_sums
from alphacut.rve.series.means import SAFETY, finer_count
from alphacut.stochastic import gauss_rule

CONSTANTS = ("E_T", "E_L", "nu_LT", "G_T", "G_L", "K_T")


def fibre_constants(result: HomogenisedStiffness) -> DeclaredConstants:
    """Return E_T, E_L, ν_LT, G_T, G_L and K_T of a result of round fibres.

    The declared errors are the largest changes of the constants over the corners of the intervals
    of Hill's z̄, of G_T and of G_L, which their own errors give.

    Raises:
        RefusedError: The result does not come from a cell of round particles and two isotropic
            phases.
    """
    cell = result.cell
    if cell is None or not cell.square:
        raise RefusedError("cell", cell, "a result of round particles and two isotropic phases")
    mixture = Mixture.of_cell(cell)
    K_T = result.moduli[0] / 2
    G_T = result.shear
    G_L, G_L_error = _mean_longitudinal_shear(cell)
    G_T_error = float(result.error_of(result.shear_of)) / G_T
    z, lowest_z, highest_z = mixture.z_from_bulk(K_T, result.modulus_errors[0])
    values = _constants(mixture, z, K_T=K_T, G_T=G_T, G_L=G_L)
    corners = []
    for z_end in (lowest_z, highest_z):
        for G_T_end in (G_T / (1 + G_T_error), G_T * (1 + G_T_error)):
            for G_L_end in (G_L / (1 + G_L_error), G_L * (1 + G_L_error)):
                K_T_end = mixture.bulk(z_end)
                corner = _constants(mixture, z_end, K_T=K_T_end, G_T=G_T_end, G_L=G_L_end)
                corners.append(corner)
    rounding = 1e-12 * np.abs(values)
    errors = np.abs(np.array(corners) - values).max(axis=0) + rounding
    return DeclaredConstants.from_arrays(CONSTANTS, values, errors)


def _constants(mixture: Mixture, z: float, *, K_T: float, G_T: float, G_L: float) -> Array:
    """Return E_T, E_L, ν_LT, G_T, G_L and K_T, shape (6,), from Hill's z̄ and the other moduli."""
    lateral, axial = mixture.lateral_and_axial(z)
    nu_LT = lateral / (2 * K_T)
    E_L = axial - lateral**2 / K_T
    E_T = 1 / (1 / (4 * G_T) + 1 / (4 * K_T) + nu_LT**2 / E_L)
    return np.array([E_T, E_L, nu_LT, G_T, G_L, K_T])


def _mean_longitudinal_shear(cell: Cell) -> tuple[float, float]:
    """Return the mean of G_L over θ in Pa, and its declared relative error.

    The mean is by Gauss quadrature with 32 nodes. Its error is the mean of those of G_L plus the
    distance to two finer rules, times a safety factor.
    """
    matrix = cell.matrix
    inclusion = cell.inclusion
    assert isinstance(matrix, Phase)
    assert isinstance(inclusion, Phase)
    points = 32
    rules = []
    for _ in range(3):
        rules.append(gauss_rule(cell.radius_map.distribution, points=points))
        points = finer_count(points)
    # the nodes of all rules at once, since one batch of small systems is faster than three
    nodes = np.concatenate([rule.nodes for rule in rules])
    moduli, relative_errors = longitudinal_shear(cell.radius_map(nodes), matrix, inclusion)
    ends = np.cumsum([rule.nodes.size for rule in rules])[:-1]
    of_rules = zip(rules, np.split(moduli, ends), strict=True)
    mean, finer, finest = [float(rule.weights @ values) for rule, values in of_rules]
    weights = rules[0].weights
    error = float(weights @ (moduli * relative_errors)[: weights.size]) / mean
    return mean, error + SAFETY * max(abs(mean / finer - 1), abs(mean / finest - 1))


def longitudinal_shear(radius: Array, matrix: Phase, inclusion: Phase) -> tuple[Array, Array]:
    """Return the shear modulus G_L along the fibres in Pa, and its declared relative error.

    The number of harmonics is doubled from 4 until no modulus changes by more than 1e-12, or up to
    128; the last change is the error.

    Args:
        radius: Radii over half the cell's side, in [0, 1), shape (n,).
        matrix: Material around the fibres.
        inclusion: Material of the fibres.

    Returns:
        Two arrays of shape (n,).
    """
    tolerance = 1e-12
    matrix_shear = float(matrix.stiffness[2, 2])
    inclusion_shear = float(inclusion.stiffness[2, 2])
    harmonics = 4
    moduli = _rayleigh_moduli(radius, matrix_shear, inclusion_shear, harmonics=harmonics)
    while True:
        harmonics *= 2
        previous = moduli
        moduli = _rayleigh_moduli(radius, matrix_shear, inclusion_shear, harmonics=harmonics)
        change = np.abs(moduli / previous - 1)
        if change.max() <= tolerance or harmonics >= MAX_HARMONICS:
            return moduli, change + tolerance


MAX_HARMONICS = 128
"""Largest number of harmonics for G_L; more would cost their third power."""


def _rayleigh_moduli(radius: Array, matrix: float, inclusion: float, *, harmonics: int) -> Array:
    """Return G_L by so many harmonics (Rayleigh 1892), in Pa, shape (n,).

    The axial displacement outside the fibres is the real part of
    A z + Σ_P Σ_n a_n (z − P)^-n, with odd n, over all fibres P. Its continuity, and that of the
    traction, at the fibre at 0 give a linear system for the a_n.

    Args:
        radius: Radii over half the cell's side, shape (n,).
        matrix: Shear modulus of the matrix, in Pa.
        inclusion: Shear modulus of the fibres, in Pa.
        harmonics: Number of unknown a_n.
    """
    images = _image_couplings(harmonics)
    # with unknowns scaled by r^n / A, so that the system has entries of order one
    scale = radius[:, None] ** (2 * np.arange(harmonics) + 1)
    contrast = (matrix - inclusion) / (matrix + inclusion)
    system = np.eye(harmonics) - contrast * images * scale[:, :, None] * scale[:, None, :]
    source = np.zeros((radius.size, harmonics, 1))
    source[:, 0, 0] = contrast * radius
    dipole = np.linalg.solve(system, source)[:, 0, 0]  # a_1
    # the images' sum jumps across the cell by this; it is part of the mean strain
    jump = ZETA_PERIOD * radius * dipole
    return np.asarray(matrix * (1 - jump) / (1 + jump))


@cache
def _image_couplings(harmonics: int) -> Array:
    """Return what the a_n of all images add to the Taylor coefficients at 0, for odd orders."""
    orders = 2 * np.arange(harmonics) + 1
    return lattice_images(lattice_sums(4 * MAX_HARMONICS).plain, orders, orders)
