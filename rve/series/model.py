"""Series model of the cell, exact for circles: Kolosov–Muskhelishvili potentials in plane strain.

In the matrix 2μu = κφ − z conj(φ') − conj(ψ), with every particle P of the square lattice carrying
the same multipoles (Weierstrass' and Natanzon's functions; Grigolyuk & Fil'shtinskii, Perforated
Plates and Shells, 1970):

    φ = A z + Σ_P Σ_n a_n (z − P)^-n
    ψ = B z + Σ_P Σ_n [b_n (z − P)^-n + n a_n conj(P) (z − P)^(-n-1)]

Continuity of displacement and traction on |z| = r gives, with p_k, q_k the Taylor coefficients of
φ, ψ less their poles at 0, coefficients scaled by r, and λ = μ_m / μ_i,

    a_n = (1 − λ)/(κ + λ) · [(n + 2) p*_{n+2} + q*_n]
    b_n = (κ − λκ_i)/(1 + λκ_i) · p*_n + (n − 2) a_{n-2}        (n ≥ 2)
    b_1 = 2 [(κ − 1) − λ(κ_i − 1)]/[2 + λ(κ_i − 1)] · Re p_1

The square's symmetry leaves every fourth harmonic of each load, all real or all imaginary (`mirror`
= −1): a few unknowns reach round-off, and whole θ-rules times many moduli are solved as one batch.
The error falls as exp(−8 N arccosh(1/r)) with N harmonics.
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
from alphacut.rve.series.lattice_sums import ZETA_PERIOD, lattice_images, lattice_sums
from alphacut.rve.series.means import Material, Series, converged_means, mean_energies
from alphacut.stochastic import RadiusMap

MAX_HARMONICS = 160  # per potential and load; reaches r = 0.999
HIGHEST_SUM = 12 * MAX_HARMONICS + 8  # order of the lattice sums that couple so many
LOADS = ("hydrostatic", "deviator", "shear")
MAX_ACCURACY = 0.1
TOLERANCE_PART = 0.4
"""Fraction of a tolerance for the series at each θ, and again for the quadrature in θ."""
COARSER = 100.0
"""Multiple of the error of a series that tests bounds; a larger one sees less."""


@dataclass(frozen=True)
class Contrast:
    """Factors of the interface conditions of a matrix and m inclusions; complex with losses.

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
        """From the materials of the matrix and of m inclusions."""
        kappa, *inclusion_kappas = (3 - 4 * material.poisson for material in materials)
        mu, *inclusion_mus = (material.bulk_and_shear[1] for material in materials)
        kappa_i, ratio = np.array(inclusion_kappas), mu / np.array(inclusion_mus)
        return cls(
            kappa,
            mu,
            outer=(1 - ratio) / (kappa + ratio),
            inner=(kappa - ratio * kappa_i) / (1 + ratio * kappa_i),
            swelling=2 * ((kappa - 1) - ratio * (kappa_i - 1)) / (2 + ratio * (kappa_i - 1)),
        )


@dataclass(frozen=True)
class Family:
    """Harmonics that one load excites and their lattice couplings at r = 1.

    Args:
        a: Orders n of a_n, shape (N,): 3, 7, 11, … for the hydrostatic load, 1, 5, 9, … for the two
            deviatoric ones.
        b: Orders of b_n, shape (N,): 1, 5, … and 3, 7, ….
        to_p: p at the orders `b` per a_n, shape (N, N).
        to_next: (n + 2) p_{n+2} at the orders `a` per a_n.
        a_to_q: q at the orders `a` per a_n.
        b_to_q: q at the orders `a` per b_n.
    """

    a: Ints
    b: Ints
    to_p: Array
    to_next: Array
    a_to_q: Array
    b_to_q: Array


@cache
def family(harmonics: int, *, hydrostatic: bool) -> Family:
    """First harmonics of a hydrostatic or a deviatoric load, with their lattice couplings."""
    sums = lattice_sums(HIGHEST_SUM)
    a = 4 * np.arange(harmonics) + (3 if hydrostatic else 1)
    b = 4 * np.arange(harmonics) + (1 if hydrostatic else 3)
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
    """Matrices (n, m, N, N) and right-hand sides (n, m, N) for the a_n of φ, the b_n eliminated."""
    r_a, r_b = radius[:, None] ** orders.a, radius[:, None] ** orders.b
    to_p = orders.to_p * r_b[:, :, None] * r_a[:, None, :]
    to_next = orders.to_next * (r_a * radius[:, None] ** 2)[:, :, None] * r_a[:, None, :]
    a_to_q = orders.a_to_q * r_a[:, :, None] * r_a[:, None, :]
    b_to_q = orders.b_to_q * r_a[:, :, None] * r_b[:, None, :]
    is_deviatoric = orders.a[0] == 1
    by_shift = np.zeros_like(b_to_q)  # b_to_q applied to the part (n − 2) a_{n-2} of b_n
    if is_deviatoric:
        by_shift = b_to_q * (orders.b - 2)
    else:
        by_shift[..., :-1] = b_to_q[..., 1:] * (orders.b[1:] - 2)
    outer, inner = (mirror * f[:, None, None] for f in (contrast.outer, contrast.inner))
    coupling = (to_next + a_to_q + by_shift)[:, None] + inner * (b_to_q @ to_p)[:, None]
    shape = len(radius), contrast.outer.size, orders.a.size
    source = np.zeros(shape, np.result_type(outer))
    if is_deviatoric:
        source[..., 0] = mirror * contrast.outer * radius[:, None]
    else:  # b_1 has the factor `swelling` in place of `inner`
        b1_to_q, to_p1 = b_to_q[:, None, :, 0], to_p[:, None, :1, :]
        excess = (contrast.swelling - contrast.inner)[:, None, None]
        coupling += excess * b1_to_q[..., None] * to_p1
        factor = contrast.outer * contrast.swelling
        source += factor[:, None] * b1_to_q * radius[:, None, None]
    return np.eye(orders.a.size) - outer * coupling, source


def modulus_of_load(load: str, radius: Array, contrast: Contrast, harmonics: int) -> Array:
    """C11 + C12, C11 − C12 or C33 in Pa, (n, m), of n radii and m inclusions by one of `LOADS`.

    Mean strain and stress follow from the jumps across the cell of 2μu and of the resultant force
    φ + z conj(φ') + conj(ψ).
    """
    orders = family(harmonics, hydrostatic=load == "hydrostatic")
    # of "shear" the a_n are the imaginary parts
    matrices, sources = _system(orders, radius, contrast, mirror=-1.0 if load == "shear" else 1.0)
    a = np.linalg.solve(matrices, sources[..., None])[..., 0]  # scaled by rⁿ, (n, m, N)
    r, kappa, mu = radius[:, None], contrast.kappa, contrast.mu
    if load == "hydrostatic":
        to_first = orders.to_p[0] * r ** (orders.a + 1)
        pole = contrast.swelling * (np.einsum("nk,nmk->nm", to_first, a) + r)  # b_1
        jump = ZETA_PERIOD * r * pole  # of ψ across the cell
        return np.asarray(mu * (4 + 2 * jump) / (kappa - 1 - jump))
    jump = ZETA_PERIOD * r * a[..., 0]  # of φ across the cell
    natanzon_jump = lattice_sums(HIGHEST_SUM).natanzon_period * r * a[..., 0]
    if load == "deviator":
        return np.asarray(2 * mu * (1 + natanzon_jump + jump) / (1 + natanzon_jump - kappa * jump))
    return np.asarray(mu * (1 + natanzon_jump - jump) / (1 + natanzon_jump + kappa * jump))


def plane_moduli(radius: Array, materials: Sequence[Material], harmonics: int) -> Array:
    """C11 + C12, C11 − C12 and C33 of n square cells times m inclusions, (n, m, 3), in Pa."""
    contrast = Contrast.of_materials(materials)
    columns = [modulus_of_load(load, radius, contrast, harmonics) for load in LOADS]
    return np.stack(columns, axis=-1)


CIRCLES = Series(
    moduli=plane_moduli,
    voigt=square_voigt,
    steps=(3, 4, 5, 6, 8, 10, 12, 16, 24, 32, 48, 64, 96, 128, MAX_HARMONICS),
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
    """Multipole series at the nodes of a Gauss rule in θ.

    Args:
        points: Nodes of the rule, or None: as many as bring two successive rules within `accuracy`
            of one another.
        accuracy: Relative error allowed, of the series at each θ and, without `points`, of E by the
            rule in θ; from `MIN_ACCURACY` to 0.1.
        energies: Whether to compute the energies of the phases, for loss factors; they are also
            computed where a phase states a loss factor.

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
    DEFAULT_TOLERANCE: ClassVar[float | None] = None
    series: ClassVar[Series] = CIRCLES

    def __post_init__(self) -> None:
        require_points(self.points)
        accuracy = self.accuracy
        if not (is_number(accuracy) and self.MIN_ACCURACY <= accuracy <= MAX_ACCURACY):
            allowed = f"values in [{self.MIN_ACCURACY:g}, {MAX_ACCURACY:g}]"
            raise RefusedError("the accuracy of the series", repr(accuracy), allowed)

    @classmethod
    def with_resolution(cls, resolution: Resolution) -> Self:
        """The series of a tolerance of E, at each θ and in the rule in θ; see `CellModel`."""
        tolerance = resolution.tolerance or cls.DEFAULT_TOLERANCE
        if tolerance is None:
            return cls(energies=resolution.energies)
        accuracy = max(TOLERANCE_PART * tolerance, cls.MIN_ACCURACY)
        return cls(accuracy=accuracy, energies=resolution.energies)

    def for_samples(self, moduli: tuple[float, float] | None, *, energies: bool) -> Self:
        """This model; see `CellModel`."""
        return replace(self, energies=energies or self.energies)

    def coarser(self) -> Self:
        """The series of `COARSER` times the error."""
        return replace(self, accuracy=min(COARSER * self.accuracy, MAX_ACCURACY))

    def solve(
        self, radius_map: RadiusMap, matrix: Phase, inclusions: Sequence[Phase]
    ) -> list[HomogenisedStiffness]:
        """Homogenised stiffness for each of `inclusions`, in their order.

        Raises:
            SeriesError: Particles nearly touch.
            RuleError: No rule in θ converges (a map that is not smooth).
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
        return with_checks(HomogenisedStiffness(**parts))
