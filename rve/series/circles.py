"""Multipole series of cells with a circle: Kolosov–Muskhelishvili potentials in plane strain.

In the matrix 2μu = κφ − z conj(φ') − conj(ψ). Every particle P of the lattice carries the same
multipoles (Weierstrass' and Natanzon's functions; Grigolyuk and Fil'shtinskii, Perforated
Plates and Shells, 1970):

    φ = A z + Σ_P Σ_n a_n (z − P)^-n
    ψ = B z + Σ_P Σ_n [b_n (z − P)^-n + n a_n conj(P) (z − P)^(-n-1)]

Let p_k and q_k be the Taylor coefficients at 0 of φ and ψ without their poles there, all
coefficients scaled by powers of the radius r, and λ = μ_m / μ_i. Continuity of displacement and
traction on |z| = r gives

    a_n = (1 − λ)/(κ + λ) · [(n + 2) p*_{n+2} + q*_n]
    b_n = (κ − λκ_i)/(1 + λκ_i) · p*_n + (n − 2) a_{n-2}        (n ≥ 2)
    b_1 = 2 [(κ − 1) − λ(κ_i − 1)]/[2 + λ(κ_i − 1)] · Re p_1

Lattices are symmetric about x1, so that the coefficients of a load are all real or all imaginary.
On the square each load excites only every fourth harmonic, on other lattices every second one. So a
few unknowns are enough for rounding accuracy, and all nodes of a quadrature rule times many moduli
are solved as one batch. With N harmonics the error falls like exp(−8 N arccosh(1/r)) on the square,
and like exp(−4 N arccosh(1/r)) on others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.rve.cell.lattice import SQUARE, Lattice
from alphacut.rve.result.moduli import square_voigt
from alphacut.rve.series.lattice_sums import lattice_images, lattice_sums
from alphacut.rve.series.means import Material, Series


@dataclass(frozen=True)
class Contrast:
    """Factors of the interface conditions for a matrix and m inclusions; complex with losses.

    Args:
        kappa: κ = 3 − 4ν of the matrix, in plane strain.
        mu: Its shear modulus μ, in Pa.
        outer: Factor of a_n, shape (m,).
        inner: Factor of b_n, n ≥ 2.
        swelling: Factor of b_1.
    """

    kappa: complex
    mu: complex
    outer: Array
    inner: Array
    swelling: Array

    @classmethod
    def of_materials(cls, materials: Sequence[Material]) -> Contrast:
        """Return the factors of the interface conditions for a matrix and m inclusions.

        With κ = 3 − 4ν and λ the shear modulus of the matrix over that of the inclusion they are
        outer = (1 − λ)/(κ + λ), inner = (κ − λκ_i)/(1 + λκ_i) and swelling = 2 [(κ − 1) − λ(κ_i −
        1)]/[2 + λ(κ_i − 1)].

        Args:
            materials: Matrix first, then the inclusions; their shear moduli are not 0.

        Returns:
            κ and the shear modulus μ in Pa of the matrix, and the three factors, shape (m,) each.
        """
        kappas = [3 - 4 * material.poisson for material in materials]
        shear_moduli = [material.bulk_and_shear[1] for material in materials]
        kappa = kappas[0]
        mu = shear_moduli[0]
        kappa_i = np.array(kappas[1:])
        ratio = mu / np.array(shear_moduli[1:])
        return cls(
            kappa,
            mu,
            outer=(1 - ratio) / (kappa + ratio),
            inner=(kappa - ratio * kappa_i) / (1 + ratio * kappa_i),
            swelling=2 * ((kappa - 1) - ratio * (kappa_i - 1)) / (2 + ratio * (kappa_i - 1)),
        )


@dataclass(frozen=True)
class Family:
    """The harmonics that some loads excite, and their couplings by all images at r = 1.

    Args:
        a: Orders n of the a_n, shape (N,).
        b: Orders n of the b_n, shape (N,).
        to_p: What unit a_n add to p_k for k in `b`, shape (N, N), one column for each a_n.
        to_next: What unit a_n add to (k + 2) p_{k+2} for k in `a`, shape (N, N).
        a_to_q: What unit a_n add to q_k for k in `a`, shape (N, N).
        b_to_q: What unit b_n add to q_k for k in `a`, shape (N, N).
        zeta_period: π over the area of the cell.
    """

    a: Ints
    b: Ints
    to_p: Array
    to_next: Array
    a_to_q: Array
    b_to_q: Array
    zeta_period: float


ONES = (1, 4)
"""First order and step of the harmonics 1, 5, 9, …"""
THREES = (3, 4)
ODD = (1, 2)


@cache
def family(harmonics: int, a: tuple[int, int], b: tuple[int, int], lattice: Lattice) -> Family:
    """Return the first harmonics of a load, and their couplings.

    The potentials of plane elasticity, φ = A z + Σ_P Σ_n a_n (z − P)^-n and ψ likewise with b_n and
    n a_n conj(P) (z − P)^(-n-1), have poles at all particles P. By the symmetry of the square only
    every fourth order n is excited there, a_3, a_7, … and b_1, b_5, … of the hydrostatic load, a_1,
    a_5, … and b_3, b_7, … of the two deviatoric ones; on other lattices all odd ones.

    Args:
        harmonics: Number N of the a_n, and of the b_n.
        a: First order of the a_n, and the step to the next one.
        b: First order of the b_n, and the step to the next one.
        lattice: The cell.

    Returns:
        Orders `a` and `b`, shape (N,), and, at radius 1, what unit coefficients of all images add
        to the Taylor coefficients p_k of φ and q_k of ψ at 0, shape (N, N): `to_p`, of a_n to p_k
        for k in `b`; `to_next`, of a_n to (k + 2) p_{k+2}, `a_to_q`, of a_n to q_k, and `b_to_q`,
        of b_n to q_k, for k in `a`. Equal arguments give the same object.
    """
    # With N harmonics the orders of the coefficients are below 4 N, with half more terms for their
    # error. Couplings take the sums of two of them; more cost nothing that matters.
    sums = lattice_sums(12 * CIRCLES.steps[-1] + 8, lattice)
    count = np.arange(harmonics)
    a_orders = a[0] + a[1] * count
    b_orders = b[0] + b[1] * count
    return Family(
        a=a_orders,
        b=b_orders,
        to_p=lattice_images(sums.plain, b_orders, a_orders),
        to_next=(a_orders + 2)[:, None] * lattice_images(sums.plain, a_orders + 2, a_orders),
        a_to_q=-2 * a_orders * lattice_images(sums.conjugate, a_orders, a_orders + 1),
        b_to_q=lattice_images(sums.plain, a_orders, b_orders),
        zeta_period=sums.zeta_period,
    )


class _Multipoles(NamedTuple):
    """The first coefficients of a load on n cells with m inclusions, over their radius.

    Attributes:
        a_1: Of φ, shape (n, m); 0 where the load does not excite it.
        b_1: Of ψ.
    """

    a_1: Array
    b_1: Array


def _solve_multipoles(
    orders: Family, radius: Array, contrast: Contrast, *, mirror: float, dilatation: bool
) -> _Multipoles:
    """Return the first coefficients of the potentials, over the radius, for one load.

    Args:
        orders: The N harmonics of the load, and their couplings at radius 1.
        radius: Radii over half the distance of the particles, shape (n,).
        contrast: The factors of the interface conditions of m inclusions.
        mirror: 1 if the coefficients are real, −1 if they are imaginary.
        dilatation: Whether the load is the far field φ = z, which excites b_1; else ψ = z or i z.
    """
    matrices, sources = _system(orders, radius, contrast, mirror=mirror, dilatation=dilatation)
    a = np.linalg.solve(matrices, sources[..., None])[..., 0]  # scaled by rⁿ, shape (n, m, N)
    a_1 = np.asarray(a[..., 0])
    b_1 = np.zeros_like(a_1)
    if orders.b[0] == 1 and mirror > 0:
        to_p1 = orders.to_p[0] * radius[:, None] ** (orders.a + 1)
        p_1 = np.einsum("nk,nmk->nm", to_p1, a) + dilatation * radius[:, None]
        b_1 = contrast.swelling * p_1
    if orders.a[0] != 1:
        a_1 = np.zeros_like(a_1)
    return _Multipoles(a_1, b_1)


def _system(
    orders: Family, radius: Array, contrast: Contrast, *, mirror: float, dilatation: bool
) -> tuple[Array, Array]:
    """Return the linear systems for the coefficients a_n, from which the b_n are eliminated.

    With the Taylor coefficients p_k of φ and q_k of ψ that all images cause, and conjugates *, the
    conditions at the interface are a_n = outer [(n + 2) p*_{n+2} + q*_n], b_n = inner p*_n + (n −
    2) a_{n-2} for n ≥ 2, and b_1 = swelling Re p_1.

    Args:
        orders: The N harmonics of the load, and their couplings at radius 1.
        radius: Radii over half the distance of the particles, shape (n,).
        contrast: The factors outer, inner and swelling of m inclusions, shape (m,) each.
        mirror: 1 if the coefficients are real, −1 if they are imaginary, which reverses the sign of
            conjugates.
        dilatation: Whether the load is the far field φ = z; else ψ = z or i z.

    Returns:
        Matrices, shape (n, m, N, N), and right-hand sides for a unit load, shape (n, m, N).
        Unknowns are scaled by powers of the radius, so that entries stay of order one.
    """
    r_a = radius[:, None] ** orders.a
    r_b = radius[:, None] ** orders.b
    to_p = orders.to_p * r_b[:, :, None] * r_a[:, None, :]
    to_next = orders.to_next * (r_a * radius[:, None] ** 2)[:, :, None] * r_a[:, None, :]
    a_to_q = orders.a_to_q * r_a[:, :, None] * r_a[:, None, :]
    b_to_q = orders.b_to_q * r_a[:, :, None] * r_b[:, None, :]
    has_b1 = orders.b[0] == 1
    # What the term (n − 2) a_{n-2} of b_n adds to q. The orders b − 2 are those of a, shifted by
    # one where there is a b_1, which has no such term.
    by_shift = np.zeros_like(b_to_q)
    if has_b1:
        by_shift[..., :-1] = b_to_q[..., 1:] * (orders.b[1:] - 2)
    else:
        by_shift = b_to_q * (orders.b - 2)
    outer = mirror * contrast.outer[:, None, None]
    inner = mirror * contrast.inner[:, None, None]
    # The b_n act on q, and consist of inner p* and of the term (n − 2) a_{n-2}; both are put into
    # the equations of the a_n.
    coupling = (to_next + a_to_q + by_shift)[:, None] + inner * (b_to_q @ to_p)[:, None]
    # b_1 has the factor `swelling` in place of `inner`, and vanishes where p_1 is imaginary.
    swelling = contrast.swelling if mirror > 0 else np.zeros_like(contrast.swelling)
    b1_to_q = b_to_q[:, None, :, 0]
    if has_b1:
        excess = swelling[:, None, None] - inner
        coupling = coupling + excess * b1_to_q[..., None] * to_p[:, None, :1, :]
    source = np.zeros((len(radius), contrast.outer.size, orders.a.size), np.result_type(outer))
    if dilatation:
        source += (contrast.outer * swelling)[:, None] * b1_to_q * radius[:, None, None]
    else:
        source[..., 0] = mirror * contrast.outer * radius[:, None]
    return np.eye(orders.a.size) - outer * coupling, source


def _shear_modulus(orders: Family, radius: Array, contrast: Contrast) -> Array:
    """Return C33, the shear modulus of ε12, in Pa, shape (n, m).

    The mean strain and the mean stress follow from the jumps across the cell of the displacement
    2μu and of the resultant force φ + z conj(φ') + conj(ψ).

    Args:
        orders: The harmonics that ε12 excites.
        radius: Radii over half the distance of the particles, in [0, 1), shape (n,).
        contrast: Factors of the interface conditions of m inclusions.
    """
    # The load is antisymmetric about x1, so that the coefficients are imaginary.
    found = _solve_multipoles(orders, radius, contrast, mirror=-1.0, dilatation=False)
    jump = orders.zeta_period * radius[:, None] * found.a_1  # of φ across the cell
    return np.asarray(contrast.mu * (1 - jump) / (1 + contrast.kappa * jump))


def plane_moduli(radius: Array, materials: Sequence[Material], harmonics: int) -> Array:
    """Return C11 + C12, C11 − C12 and C33 of square cells with a round particle, in plane strain.

    Args:
        radius: Radii over half the cell's side, in [0, 1), shape (n,).
        materials: Matrix, then m inclusions, with real or complex moduli.
        harmonics: Number of harmonics of each potential and load, up to 160.

    Returns:
        Moduli in Pa, shape (n, m, 3).
    """
    contrast = Contrast.of_materials(materials)
    kappa = contrast.kappa
    mu = contrast.mu
    hydrostatic = family(harmonics, THREES, ONES, SQUARE)
    deviatoric = family(harmonics, ONES, THREES, SQUARE)
    r = radius[:, None]
    found = _solve_multipoles(hydrostatic, radius, contrast, mirror=1.0, dilatation=True)
    jump = hydrostatic.zeta_period * r * found.b_1  # of ψ across the cell
    bulk = mu * (4 + 2 * jump) / (kappa - 1 - jump)
    found = _solve_multipoles(deviatoric, radius, contrast, mirror=1.0, dilatation=False)
    jump = deviatoric.zeta_period * r * found.a_1  # of φ across the cell
    deviator = 2 * mu * (1 + jump) / (1 - kappa * jump)
    return np.stack([bulk, deviator, _shear_modulus(deviatoric, radius, contrast)], axis=-1)


def lattice_moduli(
    radius: Array, materials: Sequence[Material], harmonics: int, *, lattice: Lattice
) -> Array:
    """Return the moduli of cells of any lattice with a round particle, in plane strain.

    Args:
        radius: Radii over half the distance of the nearest particles, in [0, 1), shape (n,).
        materials: Matrix, then m inclusions, with real or complex moduli.
        harmonics: Number of harmonics of each potential and load.
        lattice: The cell, symmetric about x1.

    Returns:
        (C11 + C22)/2 + C12, (C11 + C22)/2 − C12, C33, C11 and C22 in Pa, shape (n, m, 5).
    """
    contrast = Contrast.of_materials(materials)
    orders = family(harmonics, ODD, ODD, lattice)
    # Mean strains and stresses of both far fields φ = z and ψ = z, (11 + 22)/2 and (11 − 22)/2, by
    # the jumps of displacements, times 2μ, and of resultant forces across the cell.
    strains = []
    stresses = []
    for dilatation in (True, False):
        found = _solve_multipoles(orders, radius, contrast, mirror=1.0, dilatation=dilatation)
        a_jump = orders.zeta_period * radius[:, None] * found.a_1
        b_jump = orders.zeta_period * radius[:, None] * found.b_1
        mean_strain = (contrast.kappa - 1) * dilatation - b_jump
        strains.append([mean_strain, contrast.kappa * a_jump - (not dilatation)])
        stresses.append([2 * dilatation + b_jump, -a_jump - (not dilatation)])
    # σ = M ε for both far fields, which are the columns, with M11 = (C11 + C22)/2 + C12, M22 =
    # (C11 + C22)/2 − C12 and M12 = M21 = (C11 − C22)/2.
    strain = np.moveaxis(np.array(strains), (0, 1), (-1, -2))
    stress = np.moveaxis(np.array(stresses), (0, 1), (-1, -2))
    matrix = 2 * contrast.mu * stress @ np.linalg.inv(strain)
    bulk = matrix[..., 0, 0]
    deviator = matrix[..., 1, 1]
    mean = (bulk + deviator) / 2
    difference = (matrix[..., 0, 1] + matrix[..., 1, 0]) / 2
    shear = _shear_modulus(orders, radius, contrast)
    return np.stack([bulk, deviator, shear, mean + difference, mean - difference], axis=-1)


def rectangle_voigt(
    bulk: Array, deviator: Array, shear: Array, first: Array, second: Array
) -> Array:
    """Return Voigt matrices, (…, 3, 3), from the five moduli of `lattice_moduli`."""
    stiffness = square_voigt(bulk, deviator, shear)
    stiffness[..., 0, 0] = first
    stiffness[..., 1, 1] = second
    return stiffness


CIRCLES = Series(
    moduli=plane_moduli,
    voigt=square_voigt,
    steps=(3, 4, 5, 6, 8, 10, 12, 16, 24, 32, 48, 64, 96, 128, 160),  # reaches radii of .999
    decay=8.0,
    start=1.0,
    unknowns=int,
    safety=1.6,
    round_off=2e-15,
    tolerance=1e-12,
)
square_stiffness = CIRCLES.converged_moduli
"""C11 + C12, C11 − C12 and C33 of n square cells times m inclusions, with declared errors."""


@cache
def series_of(lattice: Lattice) -> Series:
    """Return the multipole series for round particles on a lattice."""
    if lattice == SQUARE:
        return CIRCLES
    return replace(
        CIRCLES,
        moduli=partial(lattice_moduli, lattice=lattice),
        voigt=rectangle_voigt,
        # All odd harmonics in place of every fourth one: twice as many reach as far.
        steps=tuple(2 * step for step in CIRCLES.steps),
        decay=CIRCLES.decay / 2,
        round_off=2e-14,
        size=5,
    )
