"""Conductivity of the simple cubic array of spheres, by multipoles at all of them.

The temperature about a sphere is Σ (A r^n + B r^(−n−1)) C_n^m with Racah's spherical harmonics; the
sphere makes B = T A, and the B of all images make A (Rayleigh 1892; McPhedran and McKenzie 1978).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import checked_number
from alphacut.rve.result.result import DeclaredConstants
from alphacut.rve.series.fibre_constants import remainder_factor, theta_mean
from alphacut.rve.spheres.multipoles import VOLUME, harmonic_couplings
from alphacut.stochastic import RadiusMap
from alphacut.stochastic.radius_map import require_map


def sphere_conductivity(
    radius_map: RadiusMap, matrix: float, inclusion: float
) -> DeclaredConstants:
    """Return the conductivity of a simple cubic array of spheres of random radius, with its error.

    It is the mean over θ, as that of the stiffness.

    Args:
        radius_map: Function of θ: the radius over half the cell's side.
        matrix: Conductivity around the spheres (of heat, electricity, or a diffusivity), positive.
        inclusion: Conductivity of the spheres, positive, in the same unit.

    Returns:
        "k" in that unit, with its absolute error.

    Raises:
        RefusedError: A conductivity is not positive and finite, or the radius map is not one.
    """
    require_map(radius_map)
    checked_number("matrix", matrix, positive=True)
    checked_number("inclusion", inclusion, positive=True)
    ratio = inclusion / matrix
    value, error = theta_mean(radius_map, lambda radius: cubic_conductivity(radius, ratio))
    return DeclaredConstants({"k": matrix * value}, {"k": matrix * value * error})


def cubic_conductivity(radius: Array, ratio: float) -> tuple[Array, Array]:
    """Return the conductivity over that of the matrix, and its relative error, at each radius.

    The highest degree of the multipoles rises until no value changes by more than 1e-11, or to 47;
    the error is the last change, plus 1e-11, times `remainder_factor` where spheres nearly touch.

    Args:
        radius: Radii over half the cell's side, in [0, 1), shape (n,).
        ratio: Conductivity of the spheres over that of the matrix, positive.
    """
    tolerance = 1e-11
    degrees = (5, 9, 15, 23, 33, 47)  # the last one takes 150 unknowns
    values = _conductivity(radius, ratio, degrees[0])
    for previous_degree, degree in pairwise(degrees):
        last_orders = degree - previous_degree
        previous = values
        values = _conductivity(radius, ratio, degree)
        change = np.abs(values / previous - 1)
        if change.max() <= tolerance:
            break
    return values, (change + tolerance) * remainder_factor(radius, last_orders)


def _conductivity(radius: Array, ratio: float, degree: int) -> Array:
    """Return the relative conductivity at each radius, shape (n,), by multipoles up to a degree."""
    poles = harmonic_couplings(degree)
    n = poles.n
    # Continuity of the temperature and of the flux, at unit radius.
    sphere = n * (1 - ratio) / (n * ratio + n + 1)
    # With amplitudes A r^n and B r^(−n−1) at the surface the system has entries of order one.
    powers = radius[:, np.newaxis] ** n
    singular_powers = powers * radius[:, np.newaxis]
    of_images = powers[:, :, np.newaxis] * poles.coupling * singular_powers[:, np.newaxis]
    system = np.eye(n.size) - sphere[:, np.newaxis] * of_images
    far_field = np.zeros((radius.size, n.size, 1))
    far_field[:, 0, 0] = sphere[0] * radius  # a unit gradient along z
    dipole = np.linalg.solve(system, far_field)[:, 0, 0] * radius**2
    # The sum of dipoles over a large ball of lattice points is not periodic: it leaves the field of
    # a ball with their polarisation, which belongs to the mean gradient.
    mean_gradient = 1 + 4 * np.pi / (3 * VOLUME) * dipole
    return np.asarray(1 - 4 * np.pi / VOLUME * dipole / mean_gradient)
