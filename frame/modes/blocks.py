"""Invariant subspaces K X = M X L over the whole box, with proved bounds of what series miss.

A block is one mode, or several whose frequencies meet somewhere in the box, apart from the others
(Davis, Kahan 1970; Stewart 1973). In coordinates in which the middle of the box has diagonal M and
K, its columns X have a rotation R, given, in the p rows b of the block, which makes them smooth,
however the block's own modes cross. Perturbation theory gives polynomials X̃(u) and L̃(u) of some
degree N, which need no proof; `enclosed_block` bounds what they miss.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from math import comb
from threading import Lock
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.calculus.monomials import matmul, monomials, product_part
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, inverse_bound

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

MAX_KEPT = 8_000_000
"""Numbers of enclosures that are kept: 64 MB; one of 12 inputs takes half a million."""
REFINEMENTS = 8
"""Rounds that improve bounds of single entries by those of the others."""
CORNERS = 10
"""Inputs whose signs are all tried together, 2^9 corners."""
SMALL = 0.1
"""Norm of scaled linear terms up to which their sum of absolute values is sharp enough."""


@dataclass(frozen=True, eq=False)
class Block:
    """p modes over the box as one invariant subspace; vectors are rows."""

    modes: Ints  # their numbers from below, from 0, rising, (p,)
    rate: TaylorModel  # Lᵀ: K x_j = Σ_i rate_ji M x_i, (p, p), in 1/s²
    shape: TaylorModel  # x_j, (p, n)
    mass_shape: TaylorModel  # M x_j, (p, n)
    norm: TaylorModel  # N, x_iᵀ M x_j, (p, p)

    @property
    def relative_error(self) -> float:
        """Largest error bound of the diagonals of L and N, relative to their middle values."""
        rate, norm = (np.diag(x.remainder) / np.diag(x.value) for x in (self.rate, self.norm))
        return float(max(rate.max(), norm.max()))

    def truncated(self, order: int) -> Block:
        """Block with its Taylor models cut to a lower order."""
        parts = (x.truncated(order) for x in (self.rate, self.shape, self.mass_shape, self.norm))
        return Block(self.modes, *parts)

    def embedded(self, used: Ints, inputs: int) -> Block:
        """The same as functions of all inputs, of which those at `used` are its own."""
        parts = (
            x.embedded(used, inputs) for x in (self.rate, self.shape, self.mass_shape, self.norm)
        )
        return Block(self.modes, *parts)


@dataclass(frozen=True, eq=False)
class CentredMatrices:
    """M and K over the box in coordinates in which its middle has both diagonal."""

    mass: TaylorModel  # M, (n, n), as functions of the inputs that M and K depend on
    stiffness: TaylorModel  # K, the same
    basis: Array  # displacements are basis @ x, (n, n)
    modes: int  # number of modes; the other coordinates, which follow, have no mass

    @property
    def squared(self) -> Array:
        """λ of the modes in the middle, rising, shape (modes,), in 1/s²."""
        return np.diag(self.stiffness.value)[: self.modes]

    @property
    def has_mass(self) -> Array:
        """1 of coordinates with mass, 0 of others, shape (n,): the diagonal of M in the middle."""
        return np.asarray(np.arange(len(self.basis)) < self.modes, float)

    @cached_property
    def digest(self) -> bytes:
        """What tells both matrices from others."""
        parts = (y for x in (self.mass, self.stiffness) for y in (*x.parts, x.remainder))
        return sha256(b"".join(part.tobytes() for part in parts)).digest()


Series = list[list[Array]]
"""Coefficients by degree of Lᵀ (monomials, p, p), of x_j and M x_j (monomials, p, n)."""


def narrowest_block(
    block: Ints, rotation: Array, centre: CentredMatrices, tolerance: float
) -> Block | None:
    """Enclosure of a block (p,) of modes by series of the least degree that meets the tolerance.

    `tolerance` is the relative error bound of L and N that suffices, clipped to [FINE, ROUGH / 2];
    of the last degree tried if none meets it. None if its error bound exceeds `ROUGH`. Enclosures
    are kept: those of the same matrices serve all levels and records that differ in damping.
    """
    found, tolerance = None, min(max(tolerance, FINE), ROUGH / 2)
    max_degree, d = DEGREES[0], centre.mass.inputs
    while max_degree < DEGREES[1] and comb(d + max_degree, max_degree + 1) <= MAX_MONOMIALS:
        max_degree += 1
    key = (centre.digest, block.tobytes())
    with KEPT_LOCK:
        series, enclosures = KEPT[key] = KEPT.pop(key, ([], []))  # the last one used
        for degree in range(DEGREES[0], max_degree + 1):
            if len(enclosures) == degree - DEGREES[0]:
                series[:] = subspace_series(block, degree, centre, series)
                enclosures.append(enclosed_block(block, rotation, series, centre))
            found = enclosures[degree - DEGREES[0]]
            if found is None and degree > DEGREES[0]:
                break  # sums of coefficients over all degrees are too large; more only add to them
            if found is not None and found.relative_error < tolerance:
                break
        while sum(_numbers(*kept) for kept in KEPT.values()) > MAX_KEPT:
            del KEPT[next(iter(KEPT))]
    return found if found is not None and found.relative_error < ROUGH else None


def _numbers(series: Series, enclosures: list[Block | None]) -> int:
    """About how many numbers a series and its enclosures hold."""
    return (2 + len(enclosures)) * sum(part.size for parts in series for part in parts)


KEPT: dict[tuple[bytes, bytes], tuple[Series, list[Block | None]]] = {}
"""Of matrices and numbers of modes the series of highest degree so far, and the enclosures by those
of each degree from `DEGREES` on; the pair used last stands at the end."""
KEPT_LOCK = Lock()


def subspace_series(block: Ints, degree: int, centre: CentredMatrices, lower: Series) -> Series:
    """Perturbation series of an invariant subspace K X = M X L, X the identity on the block.

    In degree m, (Λ − λ_j M₀) x_j + M₀ Σ_i L_ij e_i is known from lower degrees, Λ and M₀ the
    diagonals of K and M in the middle: the block's own rows give L, the others x_j. `lower` is the
    same to a lower degree, or empty.
    """
    mass, stiffness, d = centre.mass, centre.stiffness, centre.mass.inputs
    middle = centre.squared[block]
    gaps = np.diag(stiffness.value) - middle[:, None] * centre.has_mass
    gaps[:, block] = np.inf  # no correction inside the block
    if not lower:
        unit = np.eye(len(centre.basis))[block][None]
        lower = [[np.diag(middle)[None]], [unit], [unit]]
    rate, shape, mass_shape = (list(parts) for parts in lower)
    for m in range(len(rate), degree + 1):
        of_mass, of_stiffness = (
            product_part(shape, x.parts, m, d, matmul) for x in (mass, stiffness)
        )
        right = middle[:, None] * of_mass - of_stiffness
        right += product_part(rate, mass_shape, m, d, matmul, lowest=(1, 1))
        rate.append(-right[:, :, block])
        shape.append(right / gaps)
        mass_shape.append(of_mass + shape[m] * centre.has_mass)
    return [rate, shape, mass_shape]


class RightSides(NamedTuple):
    """Bounds of the right sides of the equations of `enclosed_block`."""

    of_shape: Array  # of the equation of Z, its rows the modes of the block, (p, n)
    of_rate: Array  # of the transposed equation of N D, (p, p)


class SubspaceEquations(NamedTuple):
    """Bounds over the box of the magnitudes in the equations of `enclosed_block`.

    Matrices of p modes have the modes as rows: `coupling` is |Fᵀ| for the F of these equations.
    """

    residual: Array  # |Rᵀ|, (p, n)
    shape: Array  # |X̃ᵀ|, (p, n)
    mass_shape: Array  # |(M X̃)ᵀ|, (p, n)
    mass: Array  # |M|, (n, n)
    coupling: Array  # |Fᵀ|, L̃ᵀ off its diagonal, (p, p)
    difference: Array  # |L̃_jj − L̃_ii|, (p, p)

    def right_sides(self, Y: Array, E: Array) -> RightSides:
        """Bounds for all Z and D with |Zᵀ| ≤ `Y` (p, n) and |Dᵀ| ≤ `E` (p, p).

        They also bound how fast the right sides change: where Z and D change by θ Y and θ E at
        most, the right sides change by θ times the bounds at most. This takes twice the products of
        the unknowns, since |D Z − D′ Z′| ≤ |D − D′| |Z| + |D′| |Z − Z′|.
        """
        R, X, MX, M, F, difference = self
        of_shape = R + E @ MX + (F + 2 * E) @ Y @ M
        W = Y @ MX.T
        # L̃ᵀW − W L̃ by its diagonal, |L̃_jj − L̃_ii| W, and by F
        of_rate = R @ X.T + Y @ R.T + difference * W + W @ F.T + F @ W + 2 * E @ W
        return RightSides(of_shape, of_rate)


def enclosed_block(
    block: Ints, rotation: Array, series: Series, centre: CentredMatrices
) -> Block | None:
    """Enclose a block's invariant subspace K X = M X L over the box by Brouwer's theorem.

    With the residual R = K X̃ − M X̃ L̃ of the series X̃, L̃ the subspace X = X̃ + Z, Z zero in the
    rows b of the block, with L = L̃ + D obeys, o being all other rows,

        (K − L̃_jj M)_oo Z_j = −R_j + Σ_i D_ij (M X̃_i)_o + Σ_i (D_ij + F_ij) M_oo Z_i,
        N D = X̃ᵀR + RᵀZ + L̃ᵀW − W L̃ − W D,    N = X̃ᵀM X̃,  W = X̃ᵀM Z,  F = L̃ off its diagonal.

    1. The matrices on the left are bounded away from singular (`Comparison`).
    2. Where bounds |Z| ≤ Y and |D| ≤ E give themselves back through these equations, Brouwer's
       theorem gives a subspace there, at every u of the box (as Rump 2001). Products of the
       unknowns count twice (`SubspaceEquations.right_sides`), so the map contracts: the subspace
       is the only one there and continuous in u.
    3. The equations' derivative is then regular, which it would not be if L shared an eigenvalue
       with the modes outside. So no mode of a block ever meets another of outside: a block holds
       the same numbers of modes, counted from below, as in the middle, and blocks are M-orthogonal.

    Args:
        block: Numbers of its modes, shape (p,).
        rotation: Rotation R of X̃ in the rows of the block, shape (p, p).
        series: That of `subspace_series`.
        centre: M and K.

    Returns:
        The block with proved remainders; None if K − L̃_jj M may be singular or no bounds hold.
    """
    mass, stiffness, p = centre.mass, centre.stiffness, len(block)
    o = np.setdiff1d(np.arange(len(centre.basis)), block)
    L = _polynomial([rotation.T @ part @ rotation for part in series[0]], mass.inputs)
    x = _polynomial([rotation.T @ part for part in series[1]], mass.inputs)
    systems = []
    for j in range(p):
        shifted = stiffness.truncated(2) - mass.truncated(2) * L[j, j].truncated(2)
        systems.append(Comparison.over_box(shifted[o[:, None], o]))
        if not systems[-1].regular:
            return None
    Mx = x @ mass
    norm = x @ Mx.T
    inverse_norm = inverse_bound(norm)
    if inverse_norm is None:
        return None
    diagonal = L[np.arange(p), np.arange(p)]
    equations = SubspaceEquations(
        residual=(x @ stiffness - L @ Mx).magnitude(),
        shape=x.magnitude(),
        mass_shape=Mx.magnitude(),
        mass=mass.magnitude(),
        coupling=L.magnitude() * (1.0 - np.eye(p)),
        difference=(diagonal[:, None] - diagonal[None, :]).magnitude(),
    )
    Y, E = np.zeros_like(equations.residual), np.zeros_like(equations.coupling)
    for _ in range(ROUNDS):
        right = equations.right_sides(Y, E)
        new_Y = np.zeros_like(Y)
        for j, system in enumerate(systems):
            new_Y[j, o] = system.solution_bounds(right.of_shape[j, o])
        new_E = right.of_rate @ inverse_norm
        if not (new_Y.max() < MAX_SHAPE and np.isfinite(new_E).all()):
            return None
        if (SLACK * new_Y <= Y).all() and (SLACK * new_E <= E).all():
            break
        Y, E = 1.02 * np.maximum(new_Y, Y), 1.02 * np.maximum(new_E, E)
    else:
        return None
    norm_error = Y @ equations.mass_shape.T
    M = equations.mass
    norm = norm.widened(norm_error + norm_error.T + Y @ M @ Y.T)
    return Block(block, L.widened(E), x.widened(Y), Mx.widened(Y @ M), norm)


def _polynomial(parts: list[Array], inputs: int) -> TaylorModel:
    return TaylorModel(tuple(parts), np.zeros(parts[0].shape[1:]), inputs, len(parts) - 1)


def eigenvalue_drop(matrix: TaylorModel, scale: Array, sign: float) -> float:
    """Bound over the box of how far eigenvalues of sign × S (A(u) − A(0)) S fall below 0.

    `matrix` is A (n, n), symmetric, and `scale` the diagonal of S (n,).
    """
    if not len(scale):
        return 0.0
    weight, low = sign * np.outer(scale, scale), matrix.truncated(2)
    linear, quadratic = low.homogeneous_part(1) * weight, low.homogeneous_part(2) * weight
    lists = monomials(matrix.inputs, 2)
    norm_1 = min(_norm_of_sizes(linear), _linear_norm(linear))
    norm_2 = min(_norm_of_sizes(quadratic), _norm_of_terms(quadratic, lists[:, 0] == lists[:, 1]))
    norm_3 = float(np.linalg.norm(np.abs(weight) * low.remainder, 2))
    return norm_1 + norm_2 + norm_3 + gamma(100 * len(scale))


def _norm_of_sizes(terms: Array) -> float:
    """Bound of ‖Σ_α u^α V_α‖₂ by that of the matrix of sums of magnitudes."""
    return float(np.linalg.norm(np.abs(terms).sum(0), 2))


def _linear_norm(terms: Array) -> float:
    """Bound of ‖Σ_i u_i V_i‖₂ over the box |u_i| ≤ 1, for symmetric V_i = `terms` (d, n, n)."""
    by_sum = _norm_of_terms(terms, np.zeros(len(terms), bool))
    if by_sum <= SMALL:
        return by_sum
    # the norm is convex, so that corners suffice; those of the largest V_i are tried
    terms = terms[np.argsort(-np.linalg.norm(terms, axis=(1, 2)))]
    first, further_terms = terms[:CORNERS], terms[CORNERS:]
    # all corners but for a common sign, which does not change the norm
    signs = 1 - 2 * (np.arange(2 ** (len(first) - 1))[:, None] >> np.arange(len(first)) & 1)
    at_corners = np.abs(np.linalg.eigvalsh(np.tensordot(signs, first, 1))).max()
    return float(at_corners) + _norm_of_terms(further_terms, np.zeros(len(further_terms), bool))


def _norm_of_terms(terms: Array, squares: Mask) -> float:
    """Norm of Σ_α |V_α|, |V| the absolute value of a symmetric matrix (its eigenvalues')."""
    some = terms.any((1, 2))
    if not some.any():
        return 0.0
    value, vector = np.linalg.eigh(terms[some])
    # of a square u_i² ≥ 0 only the negative part of V lowers eigenvalues
    lowers = np.where(squares[some, None], np.maximum(-value, 0.0), np.abs(value))
    total = np.einsum("aij,aj,akj->ik", vector, lowers, vector, optimize=True)
    return float(np.linalg.norm(total, 2))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Bounds of solutions of A y = r: by Ostrowski's comparison matrix (1937), or in √Σ D y².

    With B = D^-½ A D^-½ and J = diag ±1, as A_jj is positive or negative, (J y)·B y has no part of
    the blocks that join rows with A_jj > 0 to those with A_jj < 0. So |B y| ≥ least |y| where no
    eigenvalue of either block, the second with its sign turned, falls below `least`.
    """

    distance: Array  # D = |A_jj| in the middle of the box, (n,)
    spread: Array  # bound of |A − A(0)|, (n, n)
    inverse: Array | None  # of the comparison matrix, a bound of |A⁻¹|; None where there is none
    least: float  # bound of both blocks of J B from below

    @classmethod
    def over_box(cls, matrix: TaylorModel) -> Comparison:
        """Comparison of a matrix that is diagonal in the middle of the box."""
        middle = np.diag(matrix.value)
        distance, drops = np.abs(middle), [0.0]
        for sign, rows in ((1.0, middle > 0), (-1.0, middle <= 0)):
            o = np.flatnonzero(rows)
            drops.append(eigenvalue_drop(matrix[o[:, None], o], distance[o] ** -0.5, sign))
        return cls(distance, matrix.deviation(), inverse_bound(matrix), 1 - max(drops))

    @property
    def regular(self) -> bool:
        """True if A is singular nowhere in the box."""
        return self.inverse is not None or self.least > 0

    def solution_bounds(self, right: Array) -> Array:
        """Bounds of |y|, entry by entry, for all solutions of A y = r with |r| ≤ `right` (n,)."""
        scale = self.distance**-0.5
        y: Array = np.full(len(right), np.inf)
        if self.least > 0:
            y = np.asarray(scale * np.linalg.norm(scale * right) / self.least)
        if self.inverse is not None:
            y = np.minimum(y, self.inverse @ right)
        diagonal = self.distance - np.diag(self.spread)
        off = self.spread - np.diag(np.diag(self.spread))
        positive = diagonal > 0
        divisor = np.where(positive, diagonal, 1.0)
        for _ in range(REFINEMENTS):  # |y_j| ≤ (r_j + Σ_l |A_jl| |y_l|) / |A_jj|
            y = np.where(positive, np.minimum(y, (right + off @ y) / divisor), y)
        return y
