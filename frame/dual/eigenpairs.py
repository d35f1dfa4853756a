"""Eigenpairs K x = λ M x over the whole box, with proved bounds of what their expansions miss.

In coordinates in which the middle of the box has M = I and K = diag λ, perturbation theory gives
polynomials λ̃_k(u) and x̃_k(u) of some degree N, x̃_k with 1 in entry k. They need no proof;
what they miss, R = K x̃ − λ̃ M x̃, has parts of higher degree alone, and is bounded over the box
by the sums of magnitudes of coefficients. An eigenvector x = x̃ + y with y_k = 0 obeys, o being
all entries but k,

    T y = −R_o + δ (M x̃)_o,   δ = (x̃·R + R_o·y) / (x̃·M x̃ + (M x̃)_o·y),   T = (K − (λ̃ + δ) M)_oo.

1. T is bounded away from singular: its diagonal from zero as expansions of K_jj − λ̃ M_jj, in
   which what moves all frequencies alike cancels, so that with the bounds of the others it is an
   M-matrix.
2. Where bounds |y| ≤ Y and |δ| ≤ L give themselves back through these equations, Brouwer's
   theorem gives an eigenpair there, at every u of the box.
3. T keeps its k − 1 negative eigenvalues over the box and over |δ| ≤ L, since it is nowhere
   singular; the determinant of K − λ M over that of T falls with λ. So this is the only
   eigenvalue there, and the k-th from below, whatever the others do.

Modes that cannot be enclosed so are left in a group, which is known by what all modes are
together.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from alphacut.frame.dual.expansion import ROUND_OFF, Expansion, symmetric
from alphacut.frame.dual.homogeneous import Series, packed, product, tensor
from alphacut.frame.dual.structure import Classical
from alphacut.frame.structures.polynomial_dependence import UnprovedError
from alphacut.fuzzy.arrays import Array, Mask, Rows

MOST_MONOMIALS = 33_000
"""Monomials of the series' highest degree, at most."""
DEGREES = (4, 10)
"""Least and greatest degree of the series."""
FINE = 3e-4
"""Doubt of λ and of x·M x, as a share of each, at which no higher degree is tried."""
ROUGH = 0.05
"""Doubt above which a mode is better left in the group."""
ROUNDS = 60
"""Most rounds in which the bounds of an eigenpair are widened until they hold."""
REFINED = 8
"""Rounds that improve bounds of single entries by those of the others."""
CORNERS = 12
"""Inputs whose signs are all tried together."""
CLOSE = 1e-9
"""Distance of two λ, as a share of the greatest, below which both modes are left in the group."""


@dataclass(frozen=True, eq=False)
class Mode:
    """One mode over the box, the k-th by rising frequency.

    Args:
        squared: λ = ω², one function, in 1/s².
        shape: x, with 1 in entry k.
        moved: M x.
        norm: xᵀ M x, one function.
    """

    squared: Series
    shape: Series
    moved: Series
    norm: Series

    @property
    def doubt(self) -> float:
        """Greatest doubt of λ and x·M x, as a share of each."""
        return max(float(x.rest[0] / x.parts[0][0, 0]) for x in (self.squared, self.norm))

    def cut(self, degree: int) -> Mode:
        """The same to a lower degree."""
        parts = (self.squared, self.shape, self.moved, self.norm)
        return Mode(*(part.cut(degree) for part in parts))


@dataclass(frozen=True, eq=False)
class Modes:
    """All modes over the box.

    Args:
        single: Those that are enclosed one by one, by number from below.
        basis: Shapes in the middle of the box, shape (n, n): displacements are basis @ x.
        mass: M in these coordinates, V = (n, n).
        low: Least λ_k of all modes, shape (n,), in 1/s².
        high: Greatest.
    """

    single: dict[int, Mode]
    basis: Array
    mass: Expansion
    low: Array
    high: Array


def modes(structure: Classical) -> Modes:
    """All modes, each single or left in the group.

    Raises:
        UnprovedError: The box is so wide that the structure may lose its mass or stiffness.
    """
    below = np.linalg.inv(np.linalg.cholesky(structure.mass.parts[0]))
    middle, turned = np.linalg.eigh(below @ structure.stiffness.parts[0] @ below.T)
    basis = below.T @ turned
    mass, stiffness = (_seen(x, basis) for x in (structure.mass, structure.stiffness))
    heavy, stiff = _form(mass, np.ones(len(middle))), _form(stiffness, middle**-0.5)
    if not (heavy < 1 and stiff < 1):
        raise UnprovedError("the structure may lose its stiffness", "take narrower inputs")
    used = np.union1d(mass.present(), stiffness.present())
    used = used if len(used) else np.arange(1)
    of_mass, of_stiffness = (x.on(used) for x in (mass, stiffness))
    enclosed = {k: _sharpest(k, of_mass, of_stiffness, used) for k in range(len(middle))}
    single = {k: mode for k, mode in enclosed.items() if mode is not None}
    low, high = middle * (1 - stiff) / (1 + heavy), middle * (1 + stiff) / (1 - heavy)
    return Modes(single, basis, mass, np.asarray(low, float), np.asarray(high, float))


def _seen(matrix: Expansion, basis: Array) -> Expansion:
    """The symmetric matrix in coordinates `basis`."""
    parts = tuple(
        np.einsum("ia,ij...,jb->ab...", basis, part, basis, optimize=True) for part in matrix.parts
    )
    return Expansion(parts, np.abs(basis.T) @ matrix.rest @ np.abs(basis))


def _form(matrix: Expansion, scale: Array) -> float:
    """Bound of the norm of a form's variation over the box."""
    weight = scale[:, None] * scale
    low = _lowering(matrix.parts[1], weight)
    low += max(_lowering(matrix.parts[2], sign * weight) for sign in (1.0, -1.0))
    return low + float(np.linalg.norm(weight * (matrix.sizes()[3] + matrix.rest), 2))


def _lowering(part: Array, weight: Array) -> float:
    """Bound of how far weight * Σ_α u^α V_α, of first or second degree, lowers a form over the box.

    Of the first degree, the largest V_α are taken at all corners of the box, where a norm is
    greatest. Of the others the norm of Σ_α |V_α| in the order of forms counts; of squares only
    what lowers.
    """
    each = np.moveaxis(part.reshape(*weight.shape, -1), -1, 0) * weight
    if part.ndim == 4:
        return _norm_of(each, np.eye(part.shape[-1], dtype=bool).ravel())
    each = each[np.argsort(-np.linalg.norm(each, axis=(1, 2)))]
    others = each[CORNERS:]
    return _norm_at_corners(each[:CORNERS]) + _norm_of(others, np.zeros(len(others), bool))


def _norm_at_corners(each: Array) -> float:
    """Greatest norm of Σ_α ± V_α."""
    if not len(each):
        return 0.0
    signs = 1 - 2 * (np.arange(2 ** (len(each) - 1))[:, None] >> np.arange(len(each)) & 1)
    return float(np.abs(np.linalg.eigvalsh(np.tensordot(signs, each, 1))).max())


def _norm_of(each: Array, squares: Mask) -> float:
    """Norm of Σ_α |V_α|, of those of squares without what raises."""
    value, vector = np.linalg.eigh(each)
    lowers = np.where(squares[:, None], np.maximum(-value, 0.0), np.abs(value))
    total = np.einsum("aij,aj,akj->ik", vector, lowers, vector, optimize=True)
    return float(np.linalg.norm(total, 2))


def _series(
    k: int, degree: int, mass: Expansion, stiffness: Expansion, lower: tuple[list[Array], ...] = ()
) -> tuple[list[Array], ...]:
    """Perturbation series of mode k: (Λ − λ₀) x_m = λ_m e_k − what lower degrees have put there.

    `lower` are the same to a lower degree, where they are known.

    Returns:
        Homogeneous polynomials of degree 0 to N, packed, of λ̃ (monomials, 1), of x̃ and of M x̃.
    """
    middle, d = np.diag(stiffness.parts[0]), mass.inner
    apart = middle - middle[k]
    apart[k] = np.inf
    heavy, stiff = ([packed(part, a) for a, part in enumerate(x.parts)] for x in (mass, stiffness))
    unit = np.eye(len(middle))[k][None]
    rate, shape, moved = (
        [*part] for part in lower or ([np.full((1, 1), middle[k])], [unit], [unit])
    )
    for m in range(len(rate), degree + 1):
        of_mass, of_stiffness = (
            np.sum([product(x[b], shape[m - b], (b, m - b), d) for b in range(1, min(m, 3) + 1)], 0)
            for x in (heavy, stiff)
        )
        right = middle[k] * of_mass - of_stiffness
        for a in range(1, m):
            column = moved[m - a][:, :, None]
            right += product(column, rate[a], (m - a, a), d)
        rate.append(-right[:, k : k + 1])
        shape.append(right / apart)
        moved.append(of_mass + shape[m])
    return rate, shape, moved


def _sharpest(k: int, mass: Expansion, stiffness: Expansion, used: Rows) -> Mode | None:
    """Mode k by the least degree that is fine, or the greatest affordable; None if it is rough."""
    middle = np.diag(stiffness.parts[0])
    if np.abs(np.delete(middle, k) - middle[k]).min(initial=np.inf) <= CLOSE * middle.max():
        return None
    series: tuple[list[Array], ...] = ()
    for degree in range(DEGREES[0], _degree(len(used)) + 1):
        series = _series(k, degree, mass, stiffness, series)
        mode = _enclosed(k, series, mass, stiffness, used)
        if mode is None and degree > DEGREES[0]:
            break  # sizes of all degrees together stand in the way; more of them do not help
        if mode is not None and mode.doubt < FINE:
            break
    return mode if mode is not None and mode.doubt < ROUGH else None


def _degree(d: int) -> int:
    """The greatest degree whose monomials are affordable."""
    degree = DEGREES[0]
    while degree < DEGREES[1] and comb(d + degree, degree + 1) <= MOST_MONOMIALS:
        degree += 1
    return degree


def _sizes(part: Array) -> Array:
    """Bounds of polynomials (monomials, …) over the box."""
    return np.asarray(np.abs(part).sum(0))


def _enclosed(
    k: int, series: tuple[list[Array], ...], mass: Expansion, stiffness: Expansion, used: Rows
) -> Mode | None:
    """Mode k proved, or None where it is not enclosed."""
    n = len(mass.rest)
    middle = np.diag(stiffness.parts[0])
    rate, shape, moved = series
    N, o = len(rate) - 1, np.delete(np.arange(n), k)
    pencil, x = _Pencil.of(rate, mass, stiffness), [_sizes(part) for part in shape]
    t = pencil.sizes
    missed = t[-1] @ sum(x) + ROUND_OFF * stiffness.size().max(1)
    for m in range(1, N + 1):
        missed = missed + t[m] @ sum((x[j] for j in range(N + 1 - m, N + 1)), np.zeros(n))
    own = float(missed @ sum(x))
    of_m = [*mass.sizes(), mass.rest]
    beyond = of_m[4] @ sum(x)  # what M x̃ has above degree N
    for b in range(1, 4):
        beyond = beyond + of_m[b] @ sum((x[j] for j in range(N + 1 - b, N + 1)), np.zeros(n))
    x_series, moved_series = Series(shape, np.zeros(n), used), Series(moved, beyond, used)
    norm = (x_series * moved_series).through(np.ones((1, n)))
    side: Array = np.sum([_sizes(part) for part in moved], axis=0) + beyond
    heavy = mass.size()
    comparison = _Comparison.of(pencil, middle - middle[k], o)
    least, L = float(2 * norm.parts[0][0, 0] - np.sum(norm.sizes()) - norm.rest[0]), 0.0
    Y: Array = np.zeros(n - 1)
    for _ in range(ROUNDS):
        below = least - float(side[o] @ Y)
        solved = comparison.solved(missed[o] + L * side[o], L * heavy[np.ix_(o, o)])
        if solved is None or below <= 0:
            return None
        L_new = float(own + missed[o] @ Y) / below
        if (solved <= Y).all() and L_new <= L:
            break
        Y, L = 1.02 * np.maximum(solved, Y), 1.02 * max(L_new, L)
    else:
        return None
    off = np.insert(Y, k, 0.0)
    wrong = float(2 * side @ off + off @ heavy @ off)
    return Mode(
        Series(rate, np.array([L]), used),
        Series(shape, off, used),
        Series(moved, beyond + heavy @ off, used),
        Series(norm.parts, norm.rest + wrong, used),
    )


@dataclass(frozen=True, eq=False)
class _Comparison:
    """Bounds of solutions of T y = r by the larger diagonal, or in the norm √Σ D y²; the lesser.

    With A = D^-½ T D^-½ and J = diag ±1, as λ_j is above or below λ_k, (J y)·A y has no part of the
    blocks that join those above to those below. So |A y| ≥ left |y| where neither the block above
    nor that below, with its sign turned, falls under `left`.

    Args:
        distance: D = |λ_j − λ_k| in the middle of the box, shape (n − 1,).
        above: Which λ_j are above λ_k, shape (n − 1,).
        diagonal: Bound of |T_jj| from below.
        off: Bounds of |T_jl|, j ≠ l, from above, shape (n − 1, n − 1).
        left: Bound of both blocks of J A from below.
    """

    distance: Array
    above: Mask
    diagonal: Array
    off: Array
    left: float

    @classmethod
    def of(cls, pencil: _Pencil, apart: Array, o: Rows) -> _Comparison:
        """Bounds over the box; `apart` are the λ_j − λ_k in its middle, o all but k."""
        total: Array = np.sum(pencil.sizes[1:], axis=0)[np.ix_(o, o)]
        distance, above = np.abs(apart[o]), apart[o] > 0
        left = 1 - max(
            sum(
                pencil.loss(m, o[block], distance[block], sign) for m in range(1, len(pencil.sizes))
            )
            for block, sign in ((above, 1.0), (~above, -1.0))
        )
        off = total - np.diag(np.diag(total))
        return cls(distance, above, distance - np.diag(total), off, left)

    def solved(self, right: Array, more: Array) -> Array | None:
        """Bounds of |y| where |r| ≤ right, T off by `more` besides; None if it may be singular."""
        scale = self.distance**-0.5
        y: Array = np.full(len(right), np.inf)
        moved = scale[:, None] * more * scale * (self.above[:, None] == self.above)
        left = self.left - float(np.linalg.svd(moved, compute_uv=False).max(initial=0.0))
        if left > 0:
            y = np.asarray(scale * np.linalg.norm(scale * right) / left)
        comparison = np.diag(self.diagonal) - self.off - more
        inverse = np.linalg.inv(comparison)
        if (inverse >= 0).all():
            y = np.minimum(y, inverse @ right)
        if not np.isfinite(y).all():
            return None
        diagonal, off = np.diag(comparison), self.off + more - np.diag(np.diag(more))
        for _ in range(REFINED):
            own = (right + off @ y) / np.where(diagonal > 0, diagonal, 1.0)
            y = np.where(diagonal > 0, np.minimum(y, own), y)
        return y


@dataclass(frozen=True, eq=False)
class _Pencil:
    """Parts of K − λ̃ M of degree 1 to N, and all that is left.

    Args:
        sizes: Bounds of degree 0 (none) to N, and of the rest, each (n, n).
        parts: Coefficients of degree 1 and 2, in which what moves all frequencies alike cancels.
    """

    sizes: list[Array]
    parts: dict[int, Array]

    @classmethod
    def of(cls, rate: list[Array], mass: Expansion, stiffness: Expansion) -> _Pencil:
        N = len(rate) - 1
        size = [float(_sizes(part)[0]) for part in rate]
        of_k, of_m = ([*x.sizes(), x.rest] for x in (stiffness, mass))
        out = [np.zeros_like(mass.rest) for _ in range(N + 2)]
        for m in range(1, 4):
            out[m] = out[m] + of_k[m]
        for a in range(N + 1):
            for b in range(5):
                place = min(a + b, N + 1) if b < 4 else N + 1
                if (a, b) != (0, 0):
                    out[place] = out[place] + size[a] * of_m[b]
        out[-1] = out[-1] + of_k[4]
        parts = {}
        for m in (1, 2):
            pairs = [
                np.multiply.outer(mass.parts[m - a], tensor(rate[a][:, 0], mass.inner, a))
                for a in range(m + 1)
            ]
            parts[m] = stiffness.parts[m] - sum(symmetric(pair, m) for pair in pairs)
            out[m] = np.minimum(out[m], np.abs(parts[m]).sum(tuple(range(2, 2 + m))))
        return cls(out, parts)

    def loss(self, m: int, o: Rows, distance: Array, sign: float) -> float:
        """Bound of how far one part of the block o, scaled, lowers its sign × T."""
        if not len(o):
            return 0.0
        block, weight = np.ix_(o, o), sign / np.sqrt(np.outer(distance, distance))
        least = float(np.linalg.norm(self.sizes[m][block] * weight, 2))
        return min(least, _lowering(self.parts[m][block], weight)) if m in self.parts else least
