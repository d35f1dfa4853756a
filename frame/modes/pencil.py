"""Bounds over the box of a symmetric matrix A(u) and of the solutions of A y = r.

A is diagonal in the middle of the box. For the modes it is K − ℓ M on the coordinates outside a
block, ℓ a polynomial near an eigenvalue of that block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.monomials import monomials
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel, inverse_bound
from alphacut.fuzzy.arrays import Array, Mask

REFINEMENTS = 8
"""Rounds that improve bounds of single entries by those of the others."""
CORNERS = 10
"""Inputs whose signs are all tried together, 2^9 corners."""
SMALL = 0.1
"""Norm of scaled linear terms up to which their sum of absolute values is sharp enough."""


def eigenvalue_drop(matrix: TaylorModel, scale: Array, sign: float) -> float:
    """Bound over the box of how far eigenvalues of ± S (A(u) − A(0)) S fall below 0.

    Args:
        matrix: A, symmetric, shape (n, n).
        scale: Diagonal of S, shape (n,).
        sign: 1 or −1.
    """
    if not len(scale):
        return 0.0
    weight, low = sign * np.outer(scale, scale), matrix.cut(2)
    linear, quadratic = low.part(1) * weight, low.part(2) * weight
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

    Args:
        distance: D = |A_jj| in the middle of the box, shape (n,).
        spread: Bound of |A − A(0)|, shape (n, n).
        inverse: Of the comparison matrix, a bound of |A⁻¹|; None where there is none.
        least: Bound of both blocks of J B from below.
    """

    distance: Array
    spread: Array
    inverse: Array | None
    least: float

    @classmethod
    def over_box(cls, matrix: TaylorModel) -> Comparison:
        """Comparison of a matrix that is diagonal in the middle of the box."""
        middle = np.diag(matrix.value)
        distance, drops = np.abs(middle), [0.0]
        for sign, rows in ((1.0, middle > 0), (-1.0, middle <= 0)):
            o = np.flatnonzero(rows)
            drops.append(eigenvalue_drop(matrix[o[:, None], o], distance[o] ** -0.5, sign))
        return cls(distance, matrix.spread(), inverse_bound(matrix), 1 - max(drops))

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
