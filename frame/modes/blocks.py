"""Invariant subspaces K X = M X L over the whole box, with proved bounds of what series miss.

A block is one mode, or several whose frequencies meet somewhere in the box, apart from the others
(Davis, Kahan 1970; Stewart 1973). In coordinates in which the middle of the box has diagonal M and
K, its columns X have a rotation R, given, in the p rows b of the block, which makes them smooth,
however the block's own modes cross. Perturbation theory gives polynomials X̃(u) and L̃(u) of some
degree N. They need no proof; what they miss, R = K X̃ − M X̃ L̃, has parts of higher degree alone,
and is bounded over the box by the sums of magnitudes of coefficients.
The subspace X = X̃ + Z, Z zero in the rows b, with L = L̃ + D obeys, o being all other rows,

    (K − L̃_jj M)_oo Z_j = −R_j + Σ_i D_ij (M X̃_i)_o + Σ_i (D_ij + F_ij) M_oo Z_i,
    N D = X̃ᵀR + RᵀZ + L̃ᵀW − W L̃ − W D,    N = X̃ᵀM X̃,  W = X̃ᵀM Z,  F = L̃ off its diagonal.

1. The matrices on the left are bounded away from singular (`pencil`).
2. Where bounds |Z| ≤ Y and |D| ≤ E give themselves back through these equations, Brouwer's theorem
   gives a subspace there, at every u of the box (as Rump 2001). Products of the unknowns count
   twice, so the map contracts: the subspace is the only one there and continuous in u.
3. The equations' derivative is then regular, which it would not be if L shared an eigenvalue with
   the modes outside. So no mode of a block ever meets another of outside: a block holds the same
   numbers of modes, counted from below, as in the middle, and blocks are M-orthogonal.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from alphacut.frame.calculus.monomials import convolve, count, matmul
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, inverse_bound
from alphacut.frame.modes.pencil import Comparison, Pencil
from alphacut.fuzzy.arrays import Array, Rows

MAX_MONOMIALS = 33_000
"""Monomials of the series' highest degree, at most."""
DEGREES = (4, 10)
"""Least and greatest degree of the series."""
FINE = 3e-4
"""Relative error bound of L and N at which no higher degree is tried."""
ROUGH = 0.05
"""Relative error bound above which a block counts as not enclosed."""
MAX_SHAPE = 10.0
"""Bound of an entry of X, which is 1 in the block's own row, above which none is found."""
ROUNDS = 60
"""Most rounds in which the bounds of a block are widened until they hold."""
SLACK = 1.001
"""Factor by which bounds must hold, so that rounding of the systems they solve does not matter."""


@dataclass(frozen=True, eq=False)
class Block:
    """p modes over the box as one invariant subspace; vectors are rows.

    Args:
        modes: Their numbers from below, from 0, rising, shape (p,).
        rate: Lᵀ: K x_j = Σ_i rate_ji M x_i, shape (p, p), in 1/s².
        shape: x_j, shape (p, n).
        mass_shape: M x_j, shape (p, n).
        norm: x_iᵀ M x_j, shape (p, p).
    """

    modes: Rows
    rate: TaylorModel
    shape: TaylorModel
    mass_shape: TaylorModel
    norm: TaylorModel

    @property
    def relative_error(self) -> float:
        """Largest error bound of the diagonals of L and N, relative to their middle values."""
        rate, norm = (np.diag(x.remainder) / np.diag(x.value) for x in (self.rate, self.norm))
        return float(max(rate.max(), norm.max()))

    def cut(self, order: int) -> Block:
        """Block with its Taylor models cut to a lower order."""
        parts = (x.cut(order) for x in (self.rate, self.shape, self.mass_shape, self.norm))
        return Block(self.modes, *parts)

    def among(self, used: Rows, inputs: int) -> Block:
        """The same as functions of all inputs, of which those at `used` are its own."""
        parts = (x.among(used, inputs) for x in (self.rate, self.shape, self.mass_shape, self.norm))
        return Block(self.modes, *parts)


@dataclass(frozen=True, eq=False)
class CentredMatrices:
    """M and K over the box in coordinates in which its middle has both diagonal.

    Args:
        mass: M, shape (n, n), as functions of the inputs that M and K depend on.
        stiffness: K, the same.
        basis: Displacements are basis @ x, shape (n, n).
        modes: Number of modes; the other coordinates, which follow, have no mass.
    """

    mass: TaylorModel
    stiffness: TaylorModel
    basis: Array
    modes: int

    @property
    def squared(self) -> Array:
        """λ of the modes in the middle, rising, shape (modes,), in 1/s²."""
        return np.diag(self.stiffness.value)[: self.modes]

    def shifted_diagonal(self, rate: float) -> Array:
        """Diagonal of K − rate M in the middle, shape (n,)."""
        return np.asarray(
            np.diag(self.stiffness.value) - rate * (np.arange(len(self.basis)) < self.modes)
        )


Series = tuple[list[Array], list[Array], list[Array]]


def subspace_series(
    block: Rows, degree: int, centre: CentredMatrices, lower: Series | None = None
) -> Series:
    """Perturbation series of an invariant subspace K X = M X L, X the identity on the block.

    In degree m, (Λ − λ_j M₀) x_j + M₀ Σ_i L_ij e_i is known from lower degrees, Λ and M₀ the
    diagonals of K and M in the middle: the block's own rows give L, the others x_j.

    Args:
        block: Numbers of its modes.
        degree: Degree N.
        centre: The structure.
        lower: The same to a lower degree, where it is known.

    Returns:
        Coefficients of degree 0 to N of Lᵀ (monomials, p, p), of x_j and M x_j (monomials, p, n).
    """
    mass, stiffness, d = centre.mass, centre.stiffness, centre.mass.inputs
    middle = centre.squared[block]
    gaps = np.stack([centre.shifted_diagonal(x) for x in middle])
    gaps[:, block] = np.inf  # no correction inside the block
    if lower is None:
        unit = np.eye(len(centre.basis))[block][None]
        lower = [np.diag(middle)[None]], [unit], [unit]
    rate, shape, mass_shape = (list(parts) for parts in lower)
    for m in range(len(rate), degree + 1):
        of_mass, of_stiffness = (
            sum(
                (
                    convolve(shape[m - b], x.parts[b], (m - b, b), d, matmul)
                    for b in range(1, min(m, len(x.parts) - 1) + 1)
                ),
                np.zeros((count(d, m), *shape[0].shape[1:])),
            )
            for x in (mass, stiffness)
        )
        right = middle[:, None] * of_mass - of_stiffness
        for a in range(1, m):
            right += convolve(rate[a], mass_shape[m - a], (a, m - a), d, matmul)
        rate.append(-right[:, :, block])
        shape.append(right / gaps)
        weight = np.arange(len(centre.basis)) < centre.modes
        mass_shape.append(of_mass + shape[m] * weight)
    return rate, shape, mass_shape


def narrowest_block(
    block: Rows, rotation: Array, centre: CentredMatrices, tolerance: float
) -> Block | None:
    """Enclosure of a block of modes by series of the least degree that meets the tolerance.

    Args:
        block: Numbers of its modes from below, shape (p,).
        rotation: Rotation R of its modes, shape (p, p).
        centre: The structure.
        tolerance: Relative error bound of L and N that suffices, clipped to [FINE, ROUGH / 2].

    Returns:
        That of the last degree tried if none meets it; None if its error bound exceeds `ROUGH`.
    """
    series: Series | None = None
    found, tolerance = None, min(max(tolerance, FINE), ROUGH / 2)
    for degree in range(DEGREES[0], _max_degree(centre.mass.inputs) + 1):
        series = subspace_series(block, degree, centre, series)
        found = enclosed(block, rotation, series, centre)
        if found is None and degree > DEGREES[0]:
            break  # the sums of coefficients over all degrees are too large; more only add to them
        if found is not None and found.relative_error < tolerance:
            break
    return found if found is not None and found.relative_error < ROUGH else None


def _max_degree(d: int) -> int:
    """The greatest degree whose monomials are affordable."""
    degree = DEGREES[0]
    while degree < DEGREES[1] and comb(d + degree, degree + 1) <= MAX_MONOMIALS:
        degree += 1
    return degree


def _rotated(series: Series, rotation: Array) -> Series:
    """Series of `subspace_series` in the basis Rᵀ x, R the `rotation`: of Lᵀ, x and M x."""
    rate, shape, mass_shape = series
    return (
        [rotation.T @ x @ rotation for x in rate],
        [rotation.T @ x for x in shape],
        [rotation.T @ x for x in mass_shape],
    )


def enclosed(block: Rows, rotation: Array, series: Series, centre: CentredMatrices) -> Block | None:
    """Enclose a block's invariant subspace K X = M X L over the box by Brouwer's theorem.

    X = X̃ + Z and L = L̃ + D with polynomials X̃, L̃ and bounds Y of |Z| and E of |D| that the
    equations of the module map into themselves.

    Args:
        block: Numbers of its modes, shape (p,).
        rotation: Rotation R of X̃ in the rows of the block, shape (p, p).
        series: Coefficients of L̃ᵀ, of the rows x̃ of X̃ᵀ and of M x̃, by degree.
        centre: M and K in the coordinates of the box's middle.

    Returns:
        The block with proved remainders; None if K − L̃_jj M may be singular or no bounds hold.
    """
    mass, stiffness = centre.mass, centre.stiffness
    n, d, N = len(centre.basis), mass.inputs, len(series[0]) - 1
    o = np.setdiff1d(np.arange(n), block)
    rate, shape, mass_shape = _rotated(series, rotation)
    order = {"inputs": d, "order": N}
    L = TaylorModel(tuple(rate), np.zeros(rotation.shape), **order)
    x = TaylorModel(tuple(shape), np.zeros(shape[0].shape[1:]), **order)
    rounding = _rounding(x, mass, 0)
    Mx = TaylorModel(tuple(mass_shape), _higher_terms(mass, x.sizes(), N) + rounding, **order)
    pencils = [
        Pencil.from_rate([part[:, j, j] for part in rate], mass, stiffness)
        for j in range(len(block))
    ]
    diagonal = np.diag(L.value)
    systems = [
        Comparison.over_box(pencil, centre.shifted_diagonal(float(ell)), o)
        for pencil, ell in zip(pencils, diagonal, strict=True)
    ]
    if not all(system.regular for system in systems):
        return None
    norm = x @ Mx.T
    if np.abs(np.linalg.eigvals(norm.spread())).max() >= 1:
        return None
    off = 1.0 - np.eye(len(block))
    unknowns = _Unknowns(
        residual=_series_residual(pencils, L, x, Mx)
        + _residual_rounding(L, x, Mx, stiffness, rotation, rounding),
        size=x.size(),
        mass_size=Mx.size(),
        coupling=L.size() * off,
        difference=_differences(L),
        heavy=mass.size(),
        inverse_norm=inverse_bound(norm),
        others=o,
    )
    bounds = unknowns.self_mapped_bounds(systems)
    if bounds is None:
        return None
    Y, E = bounds
    norm_error = Y @ unknowns.mass_size.T
    norm = norm.loosened(norm_error + norm_error.T + Y @ unknowns.heavy @ Y.T)
    return Block(block, L.loosened(E), x.loosened(Y), Mx.loosened(Y @ unknowns.heavy), norm)


def _higher_terms(mass: TaylorModel, x: list[Array], N: int) -> Array:
    """Bound of what M x̃ has above degree N, shape (p, n)."""
    sizes = mass.sizes()
    higher = np.asarray(sum(x) @ mass.remainder)
    for b in range(1, len(sizes)):
        higher = higher + sum(x[max(N + 1 - b, 0) :], np.zeros_like(x[0])) @ sizes[b]
    return higher


def _terms(n: int, p: int, degree: int) -> int:
    """Roundings of a coefficient of a series: of products with M and K, with L, and of the turn."""
    return n * sum(comb(degree, b) for b in range(4)) + p * 2**degree + 4 * p + 8


def _rounding(x: TaylorModel, matrix: TaylorModel, first_degree: int) -> Array:
    """Bound of the rounding of x A, series times A's parts from `first_degree` on, (p, n)."""
    of_x, of_matrix, (p, n) = x.sizes(), matrix.sizes(), x.shape
    total: Array = np.zeros(x.shape)
    for m in range(len(of_x)):  # of the products' degree
        for b in range(first_degree, min(m, len(of_matrix) - 1) + 1):
            total += gamma(_terms(n, p, m)) * (of_x[m - b] @ of_matrix[b])
    return total


def _residual_rounding(
    L: TaylorModel,
    x: TaylorModel,
    Mx: TaylorModel,
    stiffness: TaylorModel,
    rotation: Array,
    rounding: Array,
) -> Array:
    """Bound of K X̃ − M X̃ L̃ up to degree N, zero but for rounding, shape (p, n).

    L and x are L̃ᵀ and X̃ᵀ, Mx is M X̃ with its `rounding`; `rotation`, the rotation of the block's
    modes, is orthogonal but for rounding.
    """
    (p, n), of_L, of_Mx = x.shape, L.sizes(), Mx.sizes()
    skewness = float(np.abs(rotation.T @ rotation - np.eye(p)).sum(0).max())
    total = _rounding(x, stiffness, 0) + np.sum(of_L, 0) @ rounding
    for m in range(len(of_L)):
        for a in range(m + 1):
            total += (gamma(_terms(n, p, m)) + skewness) * (of_L[a] @ of_Mx[m - a])
    return total


def _series_residual(
    pencils: list[Pencil], L: TaylorModel, x: TaylorModel, Mx: TaylorModel
) -> Array:
    """Bound over the box of the residual K x̃_j − Σ_i L̃_ji M x̃_i of a block's series, shape (p, n).

    x̃ and L̃ are polynomials of degree N that solve the equation up to that degree: only terms above
    it, and remainders, are summed.

    Args:
        pencils: K − L̃_jj M of each j, whose `sizes` bound it by degree, the remainder last.
        L: L̃ᵀ, whose diagonal is in the pencils.
        x: x̃.
        Mx: M x̃.
    """
    of_x, N, off = x.sizes(), L.order, 1.0 - np.eye(len(pencils))
    of_L, of_Mx = [size * off for size in L.sizes()], Mx.sizes()
    residual: Array = np.zeros(x.shape)
    for j, pencil in enumerate(pencils):
        residual[j] += pencil.sizes[-1] @ np.sum(of_x, 0)[j]
        for m in range(1, N + 1):
            residual[j] += pencil.sizes[m] @ np.sum(of_x[N + 1 - m :], 0)[j]
    for a in range(N + 1):
        residual += of_L[a] @ (sum(of_Mx[N + 1 - a :], np.zeros(x.shape)) + Mx.remainder)
    return residual


def _differences(L: TaylorModel) -> Array:
    """Bounds of |L̃_jj − L̃_ii| over the box, shape (p, p)."""
    p = len(L.remainder)
    diagonal = L[np.arange(p), np.arange(p)]
    return (diagonal[:, None] - diagonal[None, :]).size()


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """What bounds of Z and D depend on; rows as in `Block`.

    Args:
        residual: Bound of |R|, shape (p, n).
        size: Of |x̃|, shape (p, n).
        mass_size: Of |M x̃|, shape (p, n).
        coupling: Of |F|, shape (p, p).
        difference: Of |L̃_jj − L̃_ii|, shape (p, p).
        heavy: Of |M|, shape (n, n).
        inverse_norm: Of |N⁻¹|, shape (p, p).
        others: Coordinates o outside the block.
    """

    residual: Array
    size: Array
    mass_size: Array
    coupling: Array
    difference: Array
    heavy: Array
    inverse_norm: Array
    others: Rows

    def self_mapped_bounds(self, systems: list[Comparison]) -> tuple[Array, Array] | None:
        """Bounds Y of |Z|, (p, n), and E of |D|, (p, p), that `_images` maps into themselves.

        Found by iteration from 0, widened by 2 % a round; None if they grow too large.
        """
        Y, E = np.zeros_like(self.residual), np.zeros_like(self.coupling)
        for _ in range(ROUNDS):
            new_Y, new_E = self._images(systems, Y, E)
            if not (new_Y.max() < MAX_SHAPE and np.isfinite(new_E).all()):
                return None
            if (SLACK * new_Y <= Y).all() and (SLACK * new_E <= E).all():
                return Y, E
            Y, E = 1.02 * np.maximum(new_Y, Y), 1.02 * np.maximum(new_E, E)
        return None

    def _images(self, systems: list[Comparison], Y: Array, E: Array) -> tuple[Array, Array]:
        """Bounds of |Z|, (p, n), and |D|, (p, p), by the module's equations from |Z| ≤ Y, |D| ≤ E.

        `systems` bound the solutions Z. Products of Z and D count twice, so that the map contracts.
        """
        o, F = self.others, self.coupling
        right = self.residual + E @ self.mass_size + (F + 2 * E) @ Y @ self.heavy
        new_Y = np.zeros_like(Y)
        for j, system in enumerate(systems):
            new_Y[j, o] = system.solution_bounds(right[j, o])
        W = Y @ self.mass_size.T
        within = self.residual @ self.size.T + Y @ self.residual.T + self.difference * W
        within = within + W @ F.T + F @ W + 2 * E @ W
        return new_Y, within @ self.inverse_norm
