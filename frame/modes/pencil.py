"""The pencil K − ℓ M of a column over the box, and bounds of solutions of its linear systems.

Coordinates are those in which the middle of the box has diagonal K and M (M with zeros where
unknowns have no mass). ℓ is a polynomial near an eigenvalue; T is the pencil in all coordinates
but those of the block that the eigenvalue belongs to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.calculus.monomials import convolve, monomials
from alphacut.frame.calculus.rounding import gamma
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.fuzzy.arrays import Array, Mask, Rows

REFINED = 8
"""Rounds that improve bounds of single entries by those of the others."""
CORNERS = 10
"""Inputs whose signs are all tried together."""
SMALL = 0.1
"""Norm of linear terms, as a share of what they are taken from, up to which signs are not tried."""


def form_variation(matrix: TaylorModel, scale: Array) -> float:
    """Bound over the box of ‖S (A(u) − A(0)) S‖₂, A a symmetric matrix, S = diag `scale` (n,)."""
    weight = scale[:, None] * scale
    linear = _linear_norm(matrix.part(1) * weight)
    squares, terms = _squares(matrix.inputs), matrix.part(2) * weight
    quadratic = max(_norm_of_terms(sign * terms, squares) for sign in (1.0, -1.0))
    higher = sum(matrix.sizes()[3:]) + matrix.remainder
    return linear + quadratic + float(np.linalg.norm(weight * higher, 2))


def _linear_norm(terms: Array, enough: float = 0.0) -> float:
    """Bound of ‖Σ_i u_i V_i‖₂ over the box |u_i| ≤ 1, for symmetric V_i = `terms` (d, n, n).

    That of Σ |V_i| suffices up to `enough`; else the largest V_i are taken at all corners.
    """
    by_sum = _norm_of_terms(terms, np.zeros(len(terms), bool))
    if by_sum <= enough:
        return by_sum
    terms = terms[np.argsort(-np.linalg.norm(terms, axis=(1, 2)))]
    first, further_terms = terms[:CORNERS], terms[CORNERS:]
    # all corners but for a common sign, which does not change the norm
    signs = 1 - 2 * (np.arange(2 ** (len(first) - 1))[:, None] >> np.arange(len(first)) & 1)
    at_corners = np.abs(np.linalg.eigvalsh(np.tensordot(signs, first, 1))).max()
    return float(at_corners) + _norm_of_terms(further_terms, np.zeros(len(further_terms), bool))


def _norm_of_terms(terms: Array, squares: Mask) -> float:
    """Norm of Σ_α |V_α|, |V| the absolute value of a symmetric matrix, shape (n, n) each.

    Of a square u_i² ≥ 0 only the negative part of V counts, since bounds from below are wanted.
    """
    some = terms.any((1, 2))
    if not some.any():
        return 0.0
    value, vector = np.linalg.eigh(terms[some])
    lowers = np.where(squares[some, None], np.maximum(-value, 0.0), np.abs(value))
    total = np.einsum("aij,aj,akj->ik", vector, lowers, vector, optimize=True)
    return float(np.linalg.norm(total, 2))


def _squares(d: int) -> Mask:
    lists = monomials(d, 2)
    return np.asarray(lists[:, 0] == lists[:, 1])


@dataclass(frozen=True, eq=False)
class Pencil:
    """Parts of K − ℓ M.

    Args:
        sizes: Bounds of the parts of degree 0 (none), 1, … N, and of the rest, each (n, n).
        linear: Coefficients of degree 1, in which what moves all frequencies alike cancels.
        quadratic: The same of degree 2.
        rounding: Bounds of the rounding of both, shape (2, n, n).
    """

    sizes: list[Array]
    linear: Array
    quadratic: Array
    rounding: Array

    @classmethod
    def from_rate(cls, rate: list[Array], mass: TaylorModel, stiffness: TaylorModel) -> Pencil:
        """The pencil T = K − ℓ M over the box, ℓ a polynomial near an eigenvalue.

        It has bounds of the entries' terms of each degree, the last above N, and the terms of
        degrees 1 and 2 themselves with their rounding.

        Args:
            rate: Coefficients (monomials,) of ℓ, of degree 0 to N ≥ 2.
            mass: M.
            stiffness: K.
        """
        N, d = len(rate) - 1, mass.inputs
        rate_sizes = [float(np.abs(part).sum()) for part in rate]
        mass_sizes = mass.sizes()
        sizes = [np.zeros_like(mass.remainder) for _ in range(N + 2)]  # the last above degree N
        for m, size in enumerate(stiffness.sizes()[1:], 1):
            sizes[m] = sizes[m] + size
        for a, rate_size in enumerate(rate_sizes):
            for b, mass_size in enumerate(mass_sizes):
                if (a, b) != (0, 0):
                    sizes[min(a + b, N + 1)] += rate_size * mass_size
        sizes[-1] = sizes[-1] + sum(rate_sizes) * mass.remainder + stiffness.remainder
        parts, rounding = [], gamma(16) * np.stack(sizes[1:3])
        for m in (1, 2):
            part = stiffness.part(m)
            for a in range(max(0, m + 1 - len(mass.parts)), m + 1):
                scaled = rate[a][:, None, None]
                part = part - convolve(scaled, mass.parts[m - a], (a, m - a), d, np.multiply)
            parts.append(part)
            sizes[m] = np.minimum(sizes[m], np.abs(part).sum(0) + rounding[m - 1])
        return cls(sizes, parts[0], parts[1], rounding)

    def loss(self, o: Rows, distance: Array, sign: float) -> float:
        """Bound of how far the least eigenvalue of sign × S T S falls below 1 over the box.

        T is taken on rows and columns o, scaled to ±1 in the middle of the box.

        Args:
            o: Rows and columns, of one sign of T_jj.
            distance: |T_jj| of these in the middle; S = diag(distance^−½).
            sign: That of T_jj, −1 or 1.
        """
        if not len(o):
            return 0.0
        block, weight = np.ix_(o, o), sign / np.sqrt(np.outer(distance, distance))
        norms = [float(np.linalg.norm(size[block] * weight, 2)) for size in self.sizes[1:]]
        linear, quadratic = (x[:, o[:, None], o] * weight for x in (self.linear, self.quadratic))
        of_rounding = [float(np.linalg.norm(x[block] * weight, 2)) for x in self.rounding]
        norms[0] = min(norms[0], _linear_norm(linear, SMALL) + of_rounding[0])
        squares = _squares(len(linear))
        norms[1] = min(norms[1], _norm_of_terms(quadratic, squares) + of_rounding[1])
        return sum(norms) + gamma(100 * len(o))


@dataclass(frozen=True, eq=False)
class Comparison:
    """Bounds of solutions of T y = r: by Ostrowski's comparison matrix (1937), or in √Σ D y².

    With A = D^-½ T D^-½ and J = diag ±1, as T_jj is positive or negative, (J y)·A y has no part of
    the blocks that join those above to those below. So |A y| ≥ least |y| where neither the block
    above nor that below, with its sign turned, falls under `least`.

    Args:
        distance: D = |T_jj| in the middle of the box, shape (n − p,).
        diagonal: Bound of |T_jj| from below.
        off: Bounds of |T_jl|, j ≠ l, from above, shape (n − p, n − p).
        inverse: Of the comparison matrix; None where it has a negative entry.
        least: Bound of both blocks of J A from below.
    """

    distance: Array
    diagonal: Array
    off: Array
    inverse: Array | None
    least: float

    @classmethod
    def over_box(cls, pencil: Pencil, gaps: Array, o: Rows) -> Comparison:
        """Comparison matrix (Ostrowski) of a pencil T over the box.

        Args:
            pencil: T.
            gaps: T_jj in the middle of the box, shape (n,).
            o: Modes outside the block, the rows and columns of T that are taken.
        """
        total: Array = np.sum(pencil.sizes[1:], axis=0)[np.ix_(o, o)]
        distance, above = np.abs(gaps[o]), gaps[o] > 0
        blocks = ((above, 1.0), (~above, -1.0))
        # of ± T on the rows of either sign, scaled to 1 in the middle, the least eigenvalue
        least = 1 - max(pencil.loss(o[some], distance[some], sign) for some, sign in blocks)
        diagonal, off = distance - np.diag(total), total - np.diag(np.diag(total))
        inverse = np.asarray(np.linalg.inv(np.diag(diagonal) - off), float)
        inverse = inverse * (1 + gamma(8 * len(o) ** 2))
        positive = bool((inverse >= 0).all() and (diagonal > 0).all())
        return cls(distance, diagonal, off, inverse if positive else None, least)

    @property
    def regular(self) -> bool:
        """True if T is singular nowhere in the box."""
        return self.inverse is not None or self.least > 0

    def solution_bounds(self, right: Array) -> Array:
        """Bounds of |y| for all solutions of T y = r with |r| ≤ `right`, by entry, shape (n − p,).

        The least of the bounds by T's least eigenvalues and by its comparison matrix is improved,
        entry by entry, through its row: |y_j| ≤ (r_j + Σ_l |T_jl| |y_l|) / |T_jj|.
        """
        scale = self.distance**-0.5
        y: Array = np.full(len(right), np.inf)
        if self.least > 0:
            y = np.asarray(scale * np.linalg.norm(scale * right) / self.least)
        if self.inverse is not None:
            y = np.minimum(y, self.inverse @ right)
        positive = self.diagonal > 0
        divisor = np.where(positive, self.diagonal, 1.0)
        for _ in range(REFINED):
            y = np.where(positive, np.minimum(y, (right + self.off @ y) / divisor), y)
        return y
