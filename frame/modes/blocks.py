"""Invariant subspaces K X = M X L over the whole box, with proved bounds of what series miss.

A block is one mode, or several whose frequencies meet somewhere in the box, apart from the others
(Davis, Kahan 1970; Stewart 1973). In coordinates in which M and K are diagonal at the midpoint of
the box, its columns X are a given rotation R in the p rows b of the block. This makes them smooth
functions of the inputs, however the block's own modes cross. Perturbation theory gives polynomials
X̃(u) and L̃(u) of some degree, which need no proof; `enclosed_block` bounds what they miss.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from math import comb
from threading import Lock
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.frame.calculus.polynomials import matmul, monomials, product_part
from alphacut.frame.calculus.taylor_model import TaylorModel, inverse_bound

MIN_DEGREE, MAX_DEGREE = 4, 10
"""Degrees of the series that are tried; boxes that are too wide for the highest are bisected."""


@dataclass(frozen=True, eq=False)
class Block:
    """p modes over the box as one invariant subspace; vectors are rows."""

    modes: Ints  # their numbers from below, from 0, rising, (p,)
    eigenvalue_block: TaylorModel  # Lᵀ: K x_j = Σ_i Lᵀ_ji M x_i, (p, p), in 1/s²
    shapes: TaylorModel  # x_j, (p, n)
    mass_times_shapes: TaylorModel  # M x_j, (p, n)
    modal_mass: TaylorModel  # N, x_iᵀ M x_j, (p, p)

    @property
    def relative_error(self) -> float:
        """Largest error bound of the diagonals of L and N, relative to their midpoint values."""
        of_eigenvalues = np.diag(self.eigenvalue_block.remainder) / np.diag(
            self.eigenvalue_block.value
        )
        of_mass = np.diag(self.modal_mass.remainder) / np.diag(self.modal_mass.value)
        return float(max(of_eigenvalues.max(), of_mass.max()))


@dataclass(frozen=True, eq=False)
class CentredMatrices:
    """M and K over the box in coordinates in which both are diagonal at its midpoint."""

    mass: TaylorModel  # M, (n, n), as functions of the inputs that M and K depend on
    stiffness: TaylorModel  # K, (n, n), as functions of the same inputs
    basis: Array  # displacements are basis @ x, (n, n)
    mode_count: int  # number of modes; the other coordinates, which follow, have no mass

    @property
    def eigenvalues(self) -> Array:
        """λ of the modes at the midpoint, rising, shape (modes,), in 1/s²."""
        return np.diag(self.stiffness.value)[: self.mode_count]

    @property
    def has_mass(self) -> Array:
        """1 for coordinates with mass, 0 for others, shape (n,): the diagonal of M(0)."""
        return np.asarray(np.arange(len(self.basis)) < self.mode_count, float)

    @cached_property
    def digest(self) -> bytes:
        """Digest that tells both matrices from others."""
        arrays = []
        for matrix in (self.mass, self.stiffness):
            arrays += [*matrix.parts, matrix.remainder]
        return sha256(b"".join(array.tobytes() for array in arrays)).digest()


@dataclass(eq=False)
class SubspaceSeries:
    """Series of an invariant subspace: coefficients by degree, one array for each."""

    eigenvalue_block: list[Array]  # of Lᵀ, (monomials, p, p)
    shapes: list[Array]  # of x_j, (monomials, p, n)
    mass_times_shapes: list[Array]  # of M x_j, (monomials, p, n)


@dataclass(eq=False)
class _KeptEnclosures:
    """Series of a block to the highest degree so far, and its enclosure by that of each degree."""

    series: SubspaceSeries | None = None
    blocks: list[Block | None] = field(default_factory=list)  # from `MIN_DEGREE` on

    def size(self) -> int:
        """Return about how many numbers are kept."""
        if self.series is None:
            return 0
        series = self.series
        arrays = series.eigenvalue_block + series.shapes + series.mass_times_shapes
        return (2 + len(self.blocks)) * sum(array.size for array in arrays)


KEPT: dict[tuple[bytes, bytes], _KeptEnclosures] = {}
"""Enclosures by the digest of the matrices and the numbers of the modes; those used last stand at
the end."""
KEPT_LOCK = Lock()


def narrowest_block(
    block: Ints, rotation: Array, centre: CentredMatrices, tolerance: float
) -> Block | None:
    """Enclose a block of modes over the box, by series of the lowest degree that meets a tolerance.

    A block spans an invariant subspace K X = M X L of p modes; its enclosure is a polynomial of X
    and L with a proved remainder. Enclosures are kept for the whole process, under a lock: those of
    the same matrices serve all levels and records that differ in damping or loads alone.

    Args:
        block: Indices of its modes from the lowest on, rising, shape (p,).
        rotation: Orthogonal matrix, shape (p, p): X at the midpoint of the box, in the rows of the
            block. It must be the same at each call for the same block and matrices.
        centre: M and K as Taylor models, diagonal at the midpoint.
        tolerance: Relative error bound of L and of the modal masses that suffices.

    Returns:
        The enclosure by the last degree tried, which meets the tolerance or is the highest one.
        None if this degree gives no enclosure, or one with a relative error of .05 (a tuned number)
        or more.
    """
    largest_error = 0.05
    # With a relative error of 3e-4 no higher degree is tried; this is tuned.
    tolerance = min(max(tolerance, 3e-4), largest_error / 2)
    # A series has at most 33,000 monomials of its highest degree.
    inputs = centre.mass.inputs
    max_degree = MIN_DEGREE
    while max_degree < MAX_DEGREE and comb(inputs + max_degree, max_degree + 1) <= 33_000:
        max_degree += 1
    found = None
    key = (centre.digest, block.tobytes())
    with KEPT_LOCK:
        kept = KEPT.pop(key, _KeptEnclosures())
        KEPT[key] = kept  # now the last one
        for degree in range(MIN_DEGREE, max_degree + 1):
            if len(kept.blocks) == degree - MIN_DEGREE:
                kept.series = subspace_series(block, degree, centre, kept.series)
                kept.blocks.append(enclosed_block(block, rotation, kept.series, centre))
            found = kept.blocks[degree - MIN_DEGREE]
            if found is None and degree > MIN_DEGREE:
                break  # sums of coefficients over all degrees are too large; more only add to them
            if found is not None and found.relative_error < tolerance:
                break
        # All together have 64 MB at most, tuned: an enclosure of 12 inputs takes a sixteenth of it.
        max_kept = 8_000_000
        while sum(x.size() for x in KEPT.values()) > max_kept:
            del KEPT[next(iter(KEPT))]
    return found if found is not None and found.relative_error < largest_error else None


def subspace_series(
    block: Ints, degree: int, centre: CentredMatrices, lower: SubspaceSeries | None = None
) -> SubspaceSeries:
    """Return the perturbation series of an invariant subspace K X = M X L of p modes.

    X is the identity in the rows of the block. Let Λ and M₀ be the diagonals of K and M at the
    midpoint of the box. In degree m, (Λ − λ_j M₀) x_j + M₀ Σ_i L_ij e_i is known from lower
    degrees; the rows of the block give L, and the others x_j. The polynomials have no bound of
    their error.

    Args:
        block: Indices of its modes from the lowest on, shape (p,). No other mode may have one of
            their eigenvalues at the midpoint.
        degree: Degree of the series.
        centre: M and K as Taylor models of shape (n, n), diagonal at the midpoint; `has_mass`, 1 or
            0, is the diagonal of M there.
        lower: The same series to a lower degree, which need not be made anew; not changed.

    Returns:
        Coefficients by degree from 0: of Lᵀ (monomials, p, p), of x_j as rows (monomials, p, n),
        and of M x_j (monomials, p, n).
    """
    mass = centre.mass
    stiffness = centre.stiffness
    d = mass.inputs
    eigenvalues = centre.eigenvalues[block]
    gaps = np.diag(stiffness.value) - eigenvalues[:, np.newaxis] * centre.has_mass
    gaps[:, block] = np.inf  # no correction inside the block
    if lower is None:
        unit = np.eye(len(centre.basis))[block][None]
        lower = SubspaceSeries([np.diag(eigenvalues)[None]], [unit], [unit])
    eigenvalue_block = list(lower.eigenvalue_block)
    shapes = list(lower.shapes)
    mass_times_shapes = list(lower.mass_times_shapes)
    for m in range(len(eigenvalue_block), degree + 1):
        of_mass = product_part(shapes, mass.parts, m, d, matmul)
        of_stiffness = product_part(shapes, stiffness.parts, m, d, matmul)
        right = eigenvalues[:, np.newaxis] * of_mass - of_stiffness
        right += product_part(eigenvalue_block, mass_times_shapes, m, d, matmul, lowest=(1, 1))
        eigenvalue_block.append(-right[:, :, block])
        shapes.append(right / gaps)
        mass_times_shapes.append(of_mass + shapes[m] * centre.has_mass)
    return SubspaceSeries(eigenvalue_block, shapes, mass_times_shapes)


class SubspaceEquations(NamedTuple):
    """Bounds over the box of the magnitudes in the equations of `enclosed_block`.

    Matrices of p modes have the modes as rows: `coupling` is |Fᵀ| for the F of these equations.
    """

    residual: Array  # |Rᵀ|, (p, n)
    shapes: Array  # |X̃ᵀ|, (p, n)
    mass_times_shapes: Array  # |(M X̃)ᵀ|, (p, n)
    mass: Array  # |M|, (n, n)
    coupling: Array  # |Fᵀ|, L̃ᵀ off its diagonal, (p, p)
    difference: Array  # |L̃_jj − L̃_ii|, (p, p)

    def right_sides(self, Y: Array, E: Array) -> tuple[Array, Array]:
        """Return bounds of the right sides of the equations for the error of an invariant subspace.

        With K (X̃ + Z) = M (X̃ + Z)(L̃ + D), series X̃ and L̃ of p modes and their errors Z and D,
        the equations are, column by column, o being the rows of all other modes,

            (K − L̃_jj M)_oo Z_j = −R_j + Σ_i D_ij (M X̃_i)_o + Σ_i (D_ij + F_ij) M_oo Z_i,
            N D = X̃ᵀR + RᵀZ + L̃ᵀW − W L̃ − W D,    N = X̃ᵀM X̃,  W = X̃ᵀM Z,

        with the residual R and F = L̃ off its diagonal. The bounds also say how fast the right
        sides change: where Z and D change by at most θ Y and θ E, these change by at most θ times
        the bounds. This takes twice the products of the unknowns, since |D Z − D′ Z′| ≤ |D − D′|
        |Z| + |D′| |Z − Z′|. The fields of this tuple are bounds, with the modes as rows, of |R|,
        |X̃| and |M X̃|, shape (p, n), of |M| (n, n), and of |F| and |L̃_jj − L̃_ii|, shape (p, p).

        Args:
            Y: Bound of |Zᵀ|, shape (p, n).
            E: Bound of |Dᵀ|, shape (p, p).

        Returns:
            That of the first equation with its modes as rows, shape (p, n), and that of the
            transposed second one, shape (p, p).
        """
        R, X, MX, M, F, difference = self
        of_shapes = R + E @ MX + (F + 2 * E) @ Y @ M
        W = Y @ MX.T
        # L̃ᵀW − W L̃ is bounded by the diagonal of L̃, |L̃_jj − L̃_ii| W, and by F.
        of_eigenvalues = R @ X.T + Y @ R.T + difference * W + W @ F.T + F @ W + 2 * E @ W
        return of_shapes, of_eigenvalues


def enclosed_block(
    block: Ints, rotation: Array, series: SubspaceSeries, centre: CentredMatrices
) -> Block | None:
    """Enclose a block's invariant subspace K X = M X L over the box by Brouwer's theorem.

    Let R = K X̃ − M X̃ L̃ be the residual of the series X̃, L̃. The subspace X = X̃ + Z, with Z zero
    in the rows b of the block, and L = L̃ + D obeys, o being all other rows,

        (K − L̃_jj M)_oo Z_j = −R_j + Σ_i D_ij (M X̃_i)_o + Σ_i (D_ij + F_ij) M_oo Z_i,
        N D = X̃ᵀR + RᵀZ + L̃ᵀW − W L̃ − W D,    N = X̃ᵀM X̃,  W = X̃ᵀM Z,  F = L̃ off its diagonal.

    The first equation is K X = M X L in the rows o, the second X̃ᵀ times all rows. As X̃ is a
    rotation in the rows b, and thus regular, both together give the rows b as well.

    1. The matrices on the left are bounded away from singular (`SolutionBounds`).
    2. Where bounds |Z| ≤ Y and |D| ≤ E give themselves back through these equations, Brouwer's
       theorem gives a subspace there, at every u of the box (as Rump 2001). Products of the
       unknowns count twice (`SubspaceEquations.right_sides`), so the map contracts: the subspace
       is the only one there and continuous in u.
    3. The equations' derivative is then regular, which it would not be if L shared an eigenvalue
       with the modes outside. So no mode of a block ever meets another of outside: a block holds
       the same numbers of modes, counted from below, as at the midpoint, and blocks are
       M-orthogonal.

    Args:
        block: Numbers of its modes, shape (p,).
        rotation: Rotation of X̃ in the rows of the block, shape (p, p).
        series: That of `subspace_series`.
        centre: M and K.

    Returns:
        The block with proved remainders; None if K − L̃_jj M may be singular or no bounds hold.
    """
    mass = centre.mass
    stiffness = centre.stiffness
    p = len(block)
    others = np.setdiff1d(np.arange(len(centre.basis)), block)
    rotated = [rotation.T @ part @ rotation for part in series.eigenvalue_block]
    L = _polynomial(rotated, mass.inputs)
    x = _polynomial([rotation.T @ part for part in series.shapes], mass.inputs)

    # 1. Regular matrices on the left.
    systems = []
    for j in range(p):
        shifted = stiffness.truncated(2) - mass.truncated(2) * L[j, j].truncated(2)
        systems.append(SolutionBounds.over_box(shifted[others[:, np.newaxis], others]))
        if systems[-1].min_eigenvalue <= 0:
            return None
    Mx = x @ mass
    modal_mass = x @ Mx.T
    inverse_modal_mass = inverse_bound(modal_mass)
    if inverse_modal_mass is None:
        return None

    # 2. Bounds that give themselves back. Those that do not are widened by a factor of 1.02 a
    # round; the factor 1.001 makes rounding of the linear systems harmless.
    diagonal = L[np.arange(p), np.arange(p)]
    equations = SubspaceEquations(
        residual=(x @ stiffness - L @ Mx).magnitude(),
        shapes=x.magnitude(),
        mass_times_shapes=Mx.magnitude(),
        mass=mass.magnitude(),
        coupling=L.magnitude() * (1.0 - np.eye(p)),
        difference=(diagonal[:, None] - diagonal[None, :]).magnitude(),
    )
    Y = np.zeros_like(equations.residual)
    E = np.zeros_like(equations.coupling)
    for _ in range(60):
        of_shapes, of_eigenvalues = equations.right_sides(Y, E)
        new_Y = np.zeros_like(Y)
        for j, system in enumerate(systems):
            new_Y[j, others] = system.solution_bounds(of_shapes[j, others])
        new_E = of_eigenvalues @ inverse_modal_mass
        # Entries of X are 1 in the block's own row; far larger bounds do not converge.
        if not (new_Y.max() < 10.0 and np.isfinite(new_E).all()):
            return None
        holds_Y = 1.001 * new_Y <= Y
        holds_E = 1.001 * new_E <= E
        if holds_Y.all() and holds_E.all():
            break
        # What holds stays: else E, which follows Y a round later, would never come up with it.
        Y = np.where(holds_Y, Y, 1.02 * np.maximum(new_Y, Y))
        E = np.where(holds_E, E, 1.02 * np.maximum(new_E, E))
    else:
        return None
    of_products = Y @ equations.mass_times_shapes.T
    error = of_products + of_products.T + Y @ equations.mass @ Y.T
    return Block(
        modes=block,
        eigenvalue_block=L.widened(E),
        shapes=x.widened(Y),
        mass_times_shapes=Mx.widened(Y @ equations.mass),
        modal_mass=modal_mass.widened(error),
    )


def eigenvalue_discs(block: TaylorModel) -> tuple[Array, Array]:
    """Return lower and upper ends over the box of Gershgorin's discs of a matrix, shape (p,) each.

    Together they contain its diagonal and all of its eigenvalues, if these are real.
    """
    j = np.arange(len(block.remainder))
    low, high = block[j, j].bounds()
    radius = (block.magnitude() * (1.0 - np.eye(len(j)))).sum(axis=1)
    return low - radius, high + radius


def _polynomial(parts: list[Array], inputs: int) -> TaylorModel:
    """Return polynomials with given coefficients by degree as Taylor models without remainders."""
    return TaylorModel(tuple(parts), np.zeros(parts[0].shape[1:]), inputs, len(parts) - 1)


def max_eigenvalue_decrease(matrix: TaylorModel, scale: Array, *, sign: float) -> float:
    """Bound over the box how far eigenvalues of sign × S (A(u) − A(0)) S fall below 0.

    A result c says that sign × S (A(u) − A(0)) S ≥ −c as a quadratic form, for all u of the box.

    Args:
        matrix: A, symmetric, shape (n, n), a Taylor model over the box |u_i| ≤ 1.
        scale: Diagonal of S, shape (n,), not negative.
        sign: 1 or −1.

    Returns:
        A bound > 0, rounding included; 0 if n is 0.
    """
    if not len(scale):
        return 0.0
    weight = sign * np.outer(scale, scale)
    low_order = matrix.truncated(2)
    linear = low_order.homogeneous_part(1) * weight
    quadratic = low_order.homogeneous_part(2) * weight
    factors = monomials(matrix.inputs, 2)
    is_square = factors[:, 0] == factors[:, 1]
    of_linear = _norm_over_box(linear)
    of_quadratic = _norm_of_terms(quadratic, is_square)
    of_remainder = float(np.linalg.norm(np.abs(weight) * low_order.remainder, 2))
    # 1e-13 n is far above the rounding of norms and eigenvalues, of which only sums below 1 matter.
    return of_linear + of_quadratic + of_remainder + 1e-13 * len(scale)


def _norm_over_box(terms: Array) -> float:
    """Bound ‖Σ_i u_i V_i‖₂ over the box |u_i| ≤ 1.

    The norm is convex in u, so its maximum is at a corner. All signs of the ten largest V_i are
    tried, 2⁹ corners; the other V_i count by their absolute values. Where the sum of all absolute
    values is at most .1 it is returned at once.

    Args:
        terms: Symmetric V_i, shape (d, n, n).
    """
    by_sum = _norm_of_terms(terms, np.zeros(len(terms), bool))
    if by_sum <= 0.1:  # sharp enough: only its distance from 1 matters
        return by_sum
    terms = terms[np.argsort(-np.linalg.norm(terms, axis=(1, 2)))]
    first = terms[:10]
    others = terms[10:]
    # The bits of a corner's number are its signs. A common sign does not change the norm, so that
    # half of the corners suffice.
    corners = np.arange(2 ** (len(first) - 1))[:, np.newaxis]
    signs = 1 - 2 * (corners >> np.arange(len(first)) & 1)
    at_corners = np.abs(np.linalg.eigvalsh(np.tensordot(signs, first, 1))).max()
    return float(at_corners) + _norm_of_terms(others, np.zeros(len(others), bool))


def _norm_of_terms(terms: Array, is_square: Mask) -> float:
    """Return ‖Σ_α |V_α|‖₂, a bound of the change of eigenvalues by Σ_α u^α V_α for |u_i| ≤ 1.

    |V| has the absolute values of the eigenvalues of V and its eigenvectors, so that −|V| ≤ V ≤
    |V|.

    Args:
        terms: Symmetric V_α, shape (K, n, n).
        is_square: Whether u^α is a square u_i² ≥ 0, shape (K,). Only the negative part of V lowers
            eigenvalues then, and is taken in the place of |V|.

    Returns:
        0 if all terms are zero.
    """
    is_nonzero = terms.any(axis=(1, 2))
    if not is_nonzero.any():
        return 0.0
    values, vectors = np.linalg.eigh(terms[is_nonzero])
    of_square = is_square[is_nonzero, np.newaxis]
    magnitudes = np.where(of_square, np.maximum(-values, 0.0), np.abs(values))
    weighted = magnitudes[:, np.newaxis, :] * vectors
    total = np.tensordot(weighted, vectors, ((0, 2), (0, 2)))  # Σ_αj v_ij |λ_j| v_kj
    return float(np.linalg.norm(total, 2))


@dataclass(frozen=True, eq=False)
class SolutionBounds:
    """Bounds over a box of inputs of the solutions y of A y = r, A symmetric, shape (n, n).

    They follow from Ostrowski's comparison matrix (1937), entry by entry, where it gives an
    inverse, and in the norm √Σ D y² with the magnitudes D of the diagonal at the midpoint.
    """

    abs_diagonal: Array  # D = |A_jj| at the midpoint of the box, (n,)
    radius: Array  # bound of |A − A(0)|, (n, n)
    min_eigenvalue: float  # a number b with |D^-½ r| ≥ b |D^½ y|; A is regular if it is positive
    inverse_bound: Array | None = None  # bound of |A⁻¹|, (n, n)

    @classmethod
    def over_box(cls, matrix: TaylorModel) -> SolutionBounds:
        """Prepare bounds, over a box of inputs, of the solutions y of A y = r.

        Args:
            matrix: Symmetric A, shape (n, n), a Taylor model over the box |u_i| ≤ 1. At the
                midpoint it is diagonal, without zeros there; the entries may have either sign.
        """
        diagonal = np.diag(matrix.value)
        abs_diagonal = np.abs(diagonal)
        # Scale A to B = D^-½ A D^-½, which at the midpoint is the diagonal matrix J of the signs ±1
        # of the diagonal of A. Let P and N be the rows with the sign 1 and −1. In
        #     (J y)·B y = y_P·B_PP y_P − y_N·B_NN y_N
        # the blocks B_PN and B_NP = B_PNᵀ cancel. If no eigenvalue of B_PP and of −B_NN is below b,
        # then b |y|² ≤ (J y)·B y ≤ |y| |B y|, hence |B y| ≥ b |y|. At the midpoint both blocks are
        # the identity, so b is 1 minus the largest decrease of an eigenvalue over the box.
        largest_decrease = 0.0
        for sign, has_sign in ((1.0, diagonal > 0), (-1.0, diagonal <= 0)):
            rows = np.flatnonzero(has_sign)
            block = matrix[rows[:, np.newaxis], rows]
            decrease = max_eigenvalue_decrease(block, abs_diagonal[rows] ** -0.5, sign=sign)
            largest_decrease = max(largest_decrease, decrease)
        bound = inverse_bound(matrix)
        return cls(abs_diagonal, matrix.deviation(), 1 - largest_decrease, bound)

    def solution_bounds(self, right: Array) -> Array:
        """Return bounds of |y| for all solutions of A y = r over the box, shape (n,), finite.

        Args:
            right: Bound of |r|, shape (n,), finite and not negative.
        """
        scale = self.abs_diagonal**-0.5
        y = np.asarray(scale * np.linalg.norm(scale * right) / self.min_eigenvalue)
        if self.inverse_bound is not None:
            y = np.minimum(y, self.inverse_bound @ right)
        # Each row bounds y_j by the bounds of the other entries, |y_j| ≤ (r_j + Σ_l |A_jl| |y_l|) /
        # |A_jj|, where |A_jj| cannot be zero. Eight rounds suffice; more change little.
        min_diagonal = self.abs_diagonal - np.diag(self.radius)
        off_diagonal = self.radius - np.diag(np.diag(self.radius))
        is_positive = min_diagonal > 0
        divisor = np.where(is_positive, min_diagonal, 1.0)
        for _ in range(8):
            y = np.where(is_positive, np.minimum(y, (right + off_diagonal @ y) / divisor), y)
        return y
