"""Elastic constants and conductivities of a material of aligned fibres, with declared errors.

With the in-plane bulk modulus k, l = C13 and n = C33 of `engineering_constants`,

    E_L = n − l²/k,   ν_LT = l/(2 k),   1/E_T = 1/(4 G_T) + 1/(4 K_T) + ν_LT²/E_L.

G_T and K_T are those of the result's average. G_L, the shear modulus along the fibres, is that of
the array by Rayleigh's harmonic multipoles (1892). The conductivity across the fibres is
found by the same equation: shear moduli are conductivities there, and axial displacements
temperatures.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import RefusedError, checked_number
from alphacut.rve.cell.lattice import SQUARE, Arrangement, Lattice, lattice_of
from alphacut.rve.result.engineering_constants import Mixture
from alphacut.rve.result.result import DeclaredConstants, HomogenisedStiffness
from alphacut.rve.series.lattice_sums import lattice_images, lattice_sums
from alphacut.rve.series.means import SAFETY, finer_count
from alphacut.stochastic import RadiusMap, gauss_rule
from alphacut.stochastic.radius_map import require_map


def fibre_constants(result: HomogenisedStiffness) -> DeclaredConstants:
    """Return E_T, E_L, ν_LT, G_T, G_L and K_T of a cell with a round fibre, with their errors.

    T is any direction across the fibres and L the one along them. With the plane-strain bulk
    modulus k = K_T, l = C13 and n = C33 of the cell, E_L = n − l²/k, ν_LT = l/(2 k) and 1/E_T =
    1/(4 G_T) + 1/(4 K_T) + ν_LT²/E_L. By Hill's relations l and n follow from k, by a number z̄
    that is known within an interval.

    The declared errors are the largest changes of the constants at the corners of the box of z̄,
    G_T and G_L within their own errors.

    Args:
        result: Result of any model, with its cell; G_T and K_T are those of its average.

    Returns:
        Values and absolute errors by name: "E_T", "E_L", "nu_LT", "G_T", "G_L" and "K_T", moduli in
        Pa. If the result declares no errors, all errors but the one of G_L are NaN.

    Raises:
        RefusedError: The cell has no round particle and two isotropic phases, or is a rectangle,
            across which directions differ.
    """
    cell = result.cell
    if cell is None or not cell.square:
        allowed = "a result of round particles and two isotropic phases, on no rectangle"
        raise RefusedError("cell", cell, allowed)
    mixture = Mixture.of_cell(cell)
    K_T = result.moduli[0] / 2
    G_T = result.shear
    shear = (cell.matrix.stiffness[2, 2], cell.inclusion.stiffness[2, 2])
    G_L, G_L_error = theta_mean(
        cell.radius_map, lambda radius: longitudinal_shear(radius, *shear, lattice=cell.lattice)
    )
    G_T_error = float(result.error_of(result.shear_of)) / G_T
    z, lowest_z, highest_z = mixture.z_from_bulk(K_T, result.modulus_errors[0])
    values = _constants(mixture, z, K_T=K_T, G_T=G_T, G_L=G_L)
    # To first order the constants are linear in the three numbers, so that they change most at a
    # corner of the box.
    corners = []
    for z_end in (lowest_z, highest_z):
        for G_T_end in (G_T / (1 + G_T_error), G_T * (1 + G_T_error)):
            for G_L_end in (G_L / (1 + G_L_error), G_L * (1 + G_L_error)):
                K_T_end = mixture.bulk(z_end)
                corner = _constants(mixture, z_end, K_T=K_T_end, G_T=G_T_end, G_L=G_L_end)
                corners.append(corner)
    rounding = 1e-12 * np.abs(values)
    errors = np.abs(np.array(corners) - values).max(axis=0) + rounding
    names = ("E_T", "E_L", "nu_LT", "G_T", "G_L", "K_T")
    return DeclaredConstants.from_arrays(names, values, errors)


def _constants(mixture: Mixture, z: float, *, K_T: float, G_T: float, G_L: float) -> Array:
    """Return E_T, E_L, ν_LT, G_T, G_L and K_T, shape (6,), from Hill's z̄ and the other moduli."""
    lateral, axial = mixture.lateral_and_axial(z)
    nu_LT = lateral / (2 * K_T)
    E_L = axial - lateral**2 / K_T
    E_T = 1 / (1 / (4 * G_T) + 1 / (4 * K_T) + nu_LT**2 / E_L)
    return np.array([E_T, E_L, nu_LT, G_T, G_L, K_T])


def fibre_conductivity(
    radius_map: RadiusMap, matrix: float, inclusion: float, *, lattice: Arrangement = "square"
) -> DeclaredConstants:
    """Return the conductivities of an array of fibres of random radius, with their errors.

    They are means over θ, as those of the stiffness.

    Args:
        radius_map: Function of θ: the radius over half the distance of the nearest fibres.
        matrix: Conductivity around the fibres (of heat, electricity, or a diffusivity), positive.
        inclusion: Conductivity of the fibres along and across their axis, positive, in the same
            unit.
        lattice: "square", "hexagonal", or the sides [a, b] of a rectangle along x and y.

    Returns:
        "k_T", across the fibres, and "k_L", along them, in that unit, with absolute errors. A
        rectangle has "k_x" and "k_y" in place of "k_T".

    Raises:
        RefusedError: A conductivity is not positive and finite, the radius map is not one, or there
            is no such lattice.
    """
    cell = lattice_of(lattice)
    require_map(radius_map)
    checked_number("matrix", matrix, positive=True)
    checked_number("inclusion", inclusion, positive=True)

    def across(radius: Array, *, axis: int = 0) -> tuple[Array, Array]:
        """Return the conductivity along x or y at each radius, and its relative error."""
        return longitudinal_shear(radius, matrix, inclusion, lattice=cell, axis=axis)

    def along(radius: Array) -> tuple[Array, Array]:
        """Return the mean of both conductivities at each radius, which is exact."""
        fraction = np.pi * radius**2 / cell.area
        return matrix + (inclusion - matrix) * fraction, np.full_like(radius, 1e-15)

    functions: dict[str, Callable[[Array], tuple[Array, Array]]] = {"k_T": across, "k_L": along}
    if not cell.is_square:
        functions = {"k_x": across, "k_y": partial(across, axis=1), "k_L": along}
    means = np.array([theta_mean(radius_map, values_at) for values_at in functions.values()])
    values, relative_errors = means.T
    return DeclaredConstants.from_arrays(tuple(functions), values, values * relative_errors)


def theta_mean(
    radius_map: RadiusMap, values_at: Callable[[Array], tuple[Array, Array]]
) -> tuple[float, float]:
    """Return the mean over θ of a positive function of the radius, and its relative error.

    The mean is by Gauss quadrature with 32 nodes. Its declared error is the mean error of the
    function at the nodes plus 1.6 times the larger distance from the means by two finer rules.

    Args:
        radius_map: Function of θ: the radius over half the cell's side.
        values_at: Function from radii, shape (n,), to values and their relative errors, of the same
            shape.
    """
    points = 32
    rules = []
    for _ in range(3):
        rules.append(gauss_rule(radius_map.distribution, points=points))
        points = finer_count(points)
    # The nodes of all rules are solved at once: one batch of small systems is faster than three.
    nodes = np.concatenate([rule.nodes for rule in rules])
    values, relative_errors = values_at(radius_map(nodes))
    ends = np.cumsum([rule.nodes.size for rule in rules])[:-1]
    of_rules = zip(rules, np.split(values, ends), strict=True)
    mean, finer, finest = [float(rule.weights @ at_nodes) for rule, at_nodes in of_rules]
    weights = rules[0].weights
    error = float(weights @ (values * relative_errors)[: weights.size]) / mean
    return mean, error + SAFETY * max(abs(mean / finer - 1), abs(mean / finest - 1))


def longitudinal_shear(
    radius: Array, matrix: float, inclusion: float, *, lattice: Lattice = SQUARE, axis: int = 0
) -> tuple[Array, Array]:
    """Return the shear modulus G_L along the fibres of an array, and its relative error.

    The number of harmonics of Rayleigh's series (1892) is doubled from 4 until no modulus changes
    by more than 1e-12, or up to 128; the error is the last change, plus 1e-12, times
    `remainder_factor` where fibres nearly touch.

    Args:
        radius: Radii over half the distance of the fibres, in [0, 1), shape (n,), one at least.
        matrix: Shear modulus around the fibres, in Pa.
        inclusion: Shear modulus of the fibres, in Pa.
        lattice: The array.
        axis: 0 for shear of the plane of the fibres and x, 1 for that of the fibres and y; they
            differ on a rectangle.

    Returns:
        G_L in Pa and its relative errors, shape (n,) each. The error is larger where 128 harmonics
        do not suffice, as for fibres that nearly touch.
    """
    tolerance = 1e-12
    max_harmonics = 128  # more would cost their third power
    harmonics = 4
    moduli_by = partial(_rayleigh_moduli, radius, matrix, inclusion, lattice=lattice, axis=axis)
    moduli = moduli_by(harmonics=harmonics)
    while True:
        harmonics *= 2
        previous = moduli
        moduli = moduli_by(harmonics=harmonics)
        change = np.abs(moduli / previous - 1)
        if change.max() <= tolerance or harmonics >= max_harmonics:
            # The harmonics are of odd orders: the last half of them are as many orders as there are
            # harmonics.
            return moduli, (change + tolerance) * remainder_factor(radius, harmonics)


def remainder_factor(radius: Array, orders: int) -> Array:
    """Return by how much a series' remainder may exceed its change by the last orders, shape (n,).

    Charges at the images of touching fibres or spheres accumulate at the foci of bipolar
    coordinates, which lie at r e^(−α) from the axis, with cosh α = 1/r: multipoles of order n fall
    with e^(−α n) in the end (Jeffery, Proc. R. Soc. A 87, 109, 1912), and the modulus, quadratic in
    them, faster. With q = e^(−α · orders) the remainder of a geometric series is q/(1 − q) of its
    last terms. It is 1 at least.

    Args:
        radius: Radii over half the distance, in [0, 1), shape (n,).
        orders: Number of the last orders.
    """
    with np.errstate(divide="ignore"):  # of the radius 0, whose factor is 1
        exponent = orders * np.arccosh(1 / radius)
        return np.asarray(np.maximum(1 / np.expm1(exponent), 1.0), float)


def _rayleigh_moduli(
    radius: Array,
    matrix: float,
    inclusion: float,
    *,
    harmonics: int,
    lattice: Lattice,
    axis: int,
) -> Array:
    """Return the shear modulus G_L along the fibres of an array, by a number of harmonics.

    The axial displacement outside the fibres is the real part of A z + Σ_P Σ_n a_n (z − P)^-n, with
    odd n, over the axes P of all fibres (Rayleigh 1892); A and a_n are real for a load along x and
    imaginary along y. Its continuity, and that of the traction, at the fibre at 0 give a linear
    system for the a_n.

    Args:
        radius: Radii over half the cell's side, in [0, 1), shape (n,).
        matrix: Shear modulus of the matrix, in Pa.
        inclusion: Shear modulus of the fibres, in Pa.
        harmonics: Number of unknown a_n, for n = 1, 3, 5, ….
        lattice: The array.
        axis: 0 for a load along x, 1 for one along y.

    Returns:
        Moduli in Pa, shape (n,).
    """
    # The conditions at the fibre take the conjugates of what the images cause, which changes the
    # sign of imaginary numbers; unknowns are −a_n / A there.
    images = _image_couplings(harmonics, lattice) * (-1) ** axis
    # Unknowns are scaled by r^n / A, so that the system has entries of order one for any order n.
    scale = radius[:, None] ** (2 * np.arange(harmonics) + 1)
    contrast = (matrix - inclusion) / (matrix + inclusion)
    system = np.eye(harmonics) - contrast * images * scale[:, :, None] * scale[:, None, :]
    source = np.zeros((radius.size, harmonics, 1))
    source[:, 0, 0] = contrast * radius
    dipole = np.linalg.solve(system, source)[:, 0, 0]  # a_1
    # The sum over the images is not periodic: it jumps across the cell by this, which is part of
    # the mean strain.
    jump = np.pi / lattice.area * radius * dipole
    return np.asarray(matrix * (1 - jump) / (1 + jump))


@cache
def _image_couplings(harmonics: int, lattice: Lattice) -> Array:
    """Return what unit a_n of all images add to the Taylor coefficients at 0, for odd orders.

    Rows are the orders k = 1, 3, … of the coefficients and columns the n = 1, 3, … of the a_n,
    shape (harmonics, harmonics). Equal arguments give the same array, which must not be changed.
    """
    orders = 2 * np.arange(harmonics) + 1
    # Two orders add up to 4 · harmonics − 2 at most.
    return lattice_images(lattice_sums(4 * harmonics, lattice).plain, orders, orders)
