"""Series model of the cell, exact for circles: Kolosov–Muskhelishvili potentials in plane strain.

In the matrix 2μu = κφ − z conj(φ') − conj(ψ). Every particle P of the square lattice carries the
same multipoles (Weierstrass' and Natanzon's functions; Grigolyuk and Fil'shtinskii, Perforated
Plates and Shells, 1970):

    φ = A z + Σ_P Σ_n a_n (z − P)^-n
    ψ = B z + Σ_P Σ_n [b_n (z − P)^-n + n a_n conj(P) (z − P)^(-n-1)]

Let p_k and q_k be the Taylor coefficients at 0 of φ and ψ without their poles there, all
coefficients scaled by powers of the radius r, and λ = μ_m / μ_i. Continuity of displacement and
traction on |z| = r gives

    a_n = (1 − λ)/(κ + λ) · [(n + 2) p*_{n+2} + q*_n]
    b_n = (κ − λκ_i)/(1 + λκ_i) · p*_n + (n − 2) a_{n-2}        (n ≥ 2)
    b_1 = 2 [(κ − 1) − λ(κ_i − 1)]/[2 + λ(κ_i − 1)] · Re p_1

Because of the symmetry of the square, each load excites only every fourth harmonic, and its
coefficients are all real or all imaginary. So a few unknowns are enough for rounding accuracy, and
all nodes of a quadrature rule times many moduli are solved as one batch. With N harmonics the error
falls like exp(−8 N arccosh(1/r)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from time import perf_counter
from typing import Any, ClassVar, Self

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import RefusedError, is_number
from alphacut.rve.cell.cell import Cell, Phase, require_points, require_solve_arguments
from alphacut.rve.result.cell_model import AnyModel, Resolution
from alphacut.rve.result.checks import with_checks
from alphacut.rve.result.moduli import AVERAGES, AXES, square_voigt
from alphacut.rve.result.result import HomogenisedStiffness
from alphacut.rve.series.lattice_sums import LatticeSums, lattice_images, lattice_sums
from alphacut.rve.series.means import Material, Series, converged_means, mean_energies
from alphacut.stochastic import RadiusMap


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
    """The harmonics that one load excites, and their couplings by all images at r = 1.

    Args:
        a: Orders n of the a_n, shape (N,): 3, 7, 11, … for the hydrostatic load, 1, 5, 9, … for the
            two deviatoric ones.
        b: Orders n of the b_n, shape (N,): 1, 5, 9, … and 3, 7, 11, ….
        to_p: What unit a_n add to p_k for k in `b`, shape (N, N), one column for each a_n.
        to_next: What unit a_n add to (k + 2) p_{k+2} for k in `a`, shape (N, N).
        a_to_q: What unit a_n add to q_k for k in `a`, shape (N, N).
        b_to_q: What unit b_n add to q_k for k in `a`, shape (N, N).
    """

    a: Ints
    b: Ints
    to_p: Array
    to_next: Array
    a_to_q: Array
    b_to_q: Array


def _sums() -> LatticeSums:
    """Return the lattice sums up to the highest order that couples all harmonics of `CIRCLES`."""
    # With N harmonics the orders of the coefficients are below 4 N. Couplings take the sums of two
    # of them, up to 8 N; more cost nothing that matters.
    return lattice_sums(12 * CIRCLES.steps[-1] + 8)


@cache
def family(harmonics: int, *, hydrostatic: bool) -> Family:
    """Return the first harmonics of a hydrostatic or of a deviatoric load, and their couplings.

    The potentials of plane elasticity, φ = A z + Σ_P Σ_n a_n (z − P)^-n and ψ likewise with b_n and
    n a_n conj(P) (z − P)^(-n-1), have poles at all particles P. By the symmetry of the square only
    every fourth order n is excited.

    Args:
        harmonics: Number N of the a_n, and of the b_n, up to 160.
        hydrostatic: Whether the load is hydrostatic (a_3, a_7, …, b_1, b_5, …); else it is one of
            the two deviatoric ones (a_1, a_5, …, b_3, b_7, …).

    Returns:
        Orders `a` and `b`, shape (N,), and, at radius 1, what unit coefficients of all images add
        to the Taylor coefficients p_k of φ and q_k of ψ at 0, shape (N, N): `to_p`, of a_n to p_k
        for k in `b`; `to_next`, of a_n to (k + 2) p_{k+2}, `a_to_q`, of a_n to q_k, and `b_to_q`,
        of b_n to q_k, for k in `a`. Equal arguments give the same object.
    """
    sums = _sums()
    ones = 4 * np.arange(harmonics) + 1
    threes = 4 * np.arange(harmonics) + 3
    a = ones
    b = threes
    if hydrostatic:
        a = threes
        b = ones
    return Family(
        a=a,
        b=b,
        to_p=lattice_images(sums.plain, b, a),
        to_next=(a + 2)[:, None] * lattice_images(sums.plain, a + 2, a),
        a_to_q=-2 * a * lattice_images(sums.conjugate, a, a + 1),
        b_to_q=lattice_images(sums.plain, a, b),
    )


def _system(
    orders: Family, radius: Array, contrast: Contrast, *, mirror: float
) -> tuple[Array, Array]:
    """Return the linear systems for the coefficients a_n, from which the b_n are eliminated.

    With the Taylor coefficients p_k of φ and q_k of ψ that all images cause, and conjugates *, the
    conditions at the interface are a_n = outer [(n + 2) p*_{n+2} + q*_n], b_n = inner p*_n + (n −
    2) a_{n-2} for n ≥ 2, and b_1 = swelling Re p_1.

    Args:
        orders: The N harmonics of the load, and their couplings at radius 1.
        radius: Radii over half the cell's side, shape (n,).
        contrast: The factors outer, inner and swelling of m inclusions, shape (m,) each.
        mirror: 1 if the coefficients are real, −1 if they are imaginary, which reverses the sign of
            conjugates.

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
    is_deviatoric = orders.a[0] == 1
    # What the term (n − 2) a_{n-2} of b_n adds to q. The orders b − 2 are those of a, shifted by
    # one for the hydrostatic load, whose b_1 has no such term.
    by_shift = np.zeros_like(b_to_q)
    if is_deviatoric:
        by_shift = b_to_q * (orders.b - 2)
    else:
        by_shift[..., :-1] = b_to_q[..., 1:] * (orders.b[1:] - 2)
    outer = mirror * contrast.outer[:, None, None]
    inner = mirror * contrast.inner[:, None, None]
    # The b_n act on q, and consist of inner p* and of the term (n − 2) a_{n-2}; both are put into
    # the equations of the a_n.
    coupling = (to_next + a_to_q + by_shift)[:, None] + inner * (b_to_q @ to_p)[:, None]
    shape = len(radius), contrast.outer.size, orders.a.size
    source = np.zeros(shape, np.result_type(outer))
    if is_deviatoric:
        source[..., 0] = mirror * contrast.outer * radius[:, None]
    else:
        # b_1 has the factor `swelling` in place of `inner`; it alone is excited by the load itself.
        b1_to_q = b_to_q[:, None, :, 0]
        to_p1 = to_p[:, None, :1, :]
        excess = (contrast.swelling - contrast.inner)[:, None, None]
        coupling += excess * b1_to_q[..., None] * to_p1
        factor = contrast.outer * contrast.swelling
        source += factor[:, None] * b1_to_q * radius[:, None, None]
    return np.eye(orders.a.size) - outer * coupling, source


def modulus_of_load(load: str, radius: Array, contrast: Contrast, harmonics: int) -> Array:
    """Return the plane modulus that a load determines, in Pa, shape (n, m).

    The mean strain and the mean stress follow from the jumps across the cell of the displacement
    2μu and of the resultant force φ + z conj(φ') + conj(ψ).

    Args:
        load: "hydrostatic" for C11 + C12, "deviator" for C11 − C12, or "shear" for C33.
        radius: Radii over half the cell's side, in [0, 1), shape (n,).
        contrast: Factors of the interface conditions of m inclusions.
        harmonics: Number of harmonics of each potential, up to 160.
    """
    orders = family(harmonics, hydrostatic=load == "hydrostatic")
    # The coefficients are real for loads that are symmetric about the x axis, and imaginary for
    # shear, which is antisymmetric.
    mirror = 1.0
    if load == "shear":
        mirror = -1.0
    matrices, sources = _system(orders, radius, contrast, mirror=mirror)
    a = np.linalg.solve(matrices, sources[..., None])[..., 0]  # scaled by rⁿ, shape (n, m, N)
    r = radius[:, None]
    kappa = contrast.kappa
    mu = contrast.mu
    if load == "hydrostatic":
        to_first = orders.to_p[0] * r ** (orders.a + 1)
        # For the hydrostatic load ψ jumps by b_1, whose factor differs from those of the other b_n.
        b_1 = contrast.swelling * (np.einsum("nk,nmk->nm", to_first, a) + r)
        jump = LatticeSums.ZETA_PERIOD * r * b_1  # of ψ across the cell
        return np.asarray(mu * (4 + 2 * jump) / (kappa - 1 - jump))
    jump = LatticeSums.ZETA_PERIOD * r * a[..., 0]  # of φ across the cell
    natanzon_jump = _sums().natanzon_period * r * a[..., 0]
    if load == "deviator":
        return np.asarray(2 * mu * (1 + natanzon_jump + jump) / (1 + natanzon_jump - kappa * jump))
    return np.asarray(mu * (1 + natanzon_jump - jump) / (1 + natanzon_jump + kappa * jump))


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
    loads = ("hydrostatic", "deviator", "shear")
    columns = [modulus_of_load(load, radius, contrast, harmonics) for load in loads]
    return np.stack(columns, axis=-1)


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


@dataclass(frozen=True)
class SeriesModel(AnyModel):
    """The cell by multipole series at the nodes of a Gauss rule in θ.

    Args:
        points: Number of nodes of the rule. None takes as many as bring the mean moduli of finer
            rules within `accuracy`.
        accuracy: Relative error allowed for the series at each θ and, without `points`, for the
            quadrature in θ; from `MIN_ACCURACY` to 0.1.
        energies: Whether to compute the energies of the phases, for loss factors. They are always
            computed where a phase has a loss factor.

    Example:
        >>> from alphacut.rve import Phase
        >>> from alphacut.stochastic import HermiteMap
        >>> model = SeriesModel(points=8)
        >>> [result] = model.solve(HermiteMap(0.2, 0.1, 0.6, 0.1), Phase(20e9), [Phase(80e9)])
        >>> f"{result.modulus / 1e9:.3f} GPa"
        '22.773 GPa'
    """

    points: int | None = None
    accuracy: float = 1e-11
    energies: bool = False
    name: ClassVar[str] = "series"
    convention: ClassVar[str] = AVERAGES[AXES]
    is_exact: ClassVar[bool] = True
    MIN_ACCURACY: ClassVar[float] = 1e-12
    MAX_ACCURACY: ClassVar[float] = 0.1
    DEFAULT_TOLERANCE: ClassVar[float | None] = None
    series: ClassVar[Series] = CIRCLES

    def __post_init__(self) -> None:
        """RefusedError for fewer than 2 points, or an accuracy that is not allowed."""
        require_points(self.points)
        accuracy = self.accuracy
        if not (is_number(accuracy) and self.MIN_ACCURACY <= accuracy <= self.MAX_ACCURACY):
            allowed = f"values in [{self.MIN_ACCURACY:g}, {self.MAX_ACCURACY:g}]"
            raise RefusedError("the accuracy of the series", repr(accuracy), allowed)

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """Return the model whose E has at most the relative error that a resolution allows.

        An accuracy below `MIN_ACCURACY` of the class is not asked for, however small the tolerance.

        Args:
            resolution: Its `tolerance` of E (None, or 0, for `DEFAULT_TOLERANCE` of the class; if
                that is None too, for the default accuracy) and whether strain `energies` of the
                phases are wanted; all else concerns other models.

        Raises:
            RefusedError: The tolerance is so large that the accuracy would be above 0.1.
        """
        tolerance = resolution.tolerance or cls.DEFAULT_TOLERANCE
        if tolerance is None:
            return cls(energies=resolution.energies)
        # The errors of the series at each θ and of the quadrature add up: .4 of the tolerance for
        # each leaves some for terms of second order.
        accuracy = max(0.4 * tolerance, cls.MIN_ACCURACY)
        return cls(accuracy=accuracy, energies=resolution.energies)

    def for_samples(self, moduli: tuple[float, float] | None, *, energies: bool) -> Self:
        """Return this model, with energies if they are needed; see `CellModel`."""
        return replace(self, energies=energies or self.energies)

    def coarser(self) -> Self:
        """Return the model with 100 times the error, by which declared errors are tested."""
        return replace(self, accuracy=min(100.0 * self.accuracy, self.MAX_ACCURACY))

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[HomogenisedStiffness]:
        """Return the homogenised stiffness for each of the inclusions, in their order.

        Args:
            radius_map: Radius of the particle over θ, in halves of the cell's side.
            matrix: Isotropic material around the particle.
            inclusions: Isotropic materials of the particle, which is solved with each.

        Returns:
            Results with declared errors by "space" (series) and "theta" (quadrature), checks
            against classical bounds, and the wall time of all together. Strain energies of the
            phases are there if `self.energies` is set or a phase has a loss factor.

        Raises:
            SeriesError: Particles nearly touch.
            RuleError: No quadrature rule converges, since the radius map is not smooth.
            RefusedError: A phase is not isotropic, there is no inclusion, a radius is outside (0,
                1), or the map jumps.
            CertificateError: A result violates a bound by more than its declared error.
        """
        require_solve_arguments(radius_map, matrix, inclusions)
        start = perf_counter()
        solver = self.series.converged_moduli
        moduli = partial(solver, matrix=matrix, inclusions=inclusions, tolerance=self.accuracy)
        means = converged_means(radius_map, moduli, points=self.points, accuracy=self.accuracy)
        seconds = perf_counter() - start
        results = []
        for mean, inclusion in zip(means, inclusions, strict=True):
            cell = Cell(matrix, inclusion, radius_map)
            result = self._checked_result(
                curve=mean.curve,
                method=self.name,
                unknowns=self.series.unknowns(int(mean.terms.max())),
                seconds=seconds,
                errors=mean.errors,
                cell=cell,
            )
            if self.energies or matrix.loss is not None or inclusion.loss is not None:
                result = replace(result, energies=mean_energies(self.series, cell, mean))
            results.append(result)
        return results

    def _checked_result(self, **parts: Any) -> HomogenisedStiffness:
        """Return the result with its fields, and with checks of symmetry and bounds."""
        return with_checks(HomogenisedStiffness(**parts))
