"""Bounds of the outputs of a structure at rest, K(p) u = f(p), over boxes of its parameters.

Over a sub-box with unit coordinates x in [−1, 1]^d stiffness, loads and rows of the outputs are
affine, K(x) = K₀ + Σ xᵢ Kᵢ and likewise f(x) and r(x), up to remainders that are bounded entry by
entry. Polynomials of degree 1, U(x) for the displacements and Z(x) for the solution of K z = r,
leave the residuals ρ = f − K U and σ = r − K Z. The output is then

    r·u = Z·f + σ·U + σ·K⁻¹ρ,    |σ·K⁻¹ρ| ≤ ‖σ‖ ‖ρ‖,    ‖w‖² = w·K_low⁻¹ w,

with a matrix K_low ≤ K(x), as of Prager and Synge's inequality in the norm of the energy. The first
two terms are a polynomial of degree 3 whose range is bounded by its coefficients, the last one is
of degree 4 in the radii of the box (docs/theory/proofs.md, "At rest").
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import heappop, heappush
from itertools import count
from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import RefusedError
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF
from alphacut.frame.calculus.taylor_model import TaylorModel, concatenate
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.modes.structure import parameter_models
from alphacut.frame.structures.linear import LinearSystem

AFFINE = 1e-11
"""Remainder, as a fraction of the largest entry, up to which a function of the parameters counts as
affine: it is rounding then, some hundred units."""
RANK_ONE = 1e-11
"""Second eigenvalue over the first one, up to which a matrix counts as of rank one."""


@dataclass(frozen=True, eq=False)
class AffineModel:
    """Stiffness, loads and output rows over a box, affine in its unit coordinates x.

    Args:
        blocks: [K, f, rᵀ] as affine functions with bounds of what these leave out, shape
            (n, n + 1 + m) for n unknowns and m outputs.
        magnitudes: |Kᵢ| = (Kᵢ²)^½ for i = 1 … d, so that −|Kᵢ| ≤ Kᵢ ≤ |Kᵢ|, shape (d, n, n).
        is_affine: Whether the functions are affine, so that the remainders are rounding alone.
    """

    blocks: TaylorModel
    magnitudes: Array
    is_affine: bool = False

    @cached_property
    def parts(self) -> Array:
        """Blocks [Kᵢ, fᵢ, rᵢᵀ] of degree 0 and of each coordinate, shape (1 + d, n, n + 1 + m)."""
        return np.concatenate([self.blocks.homogeneous_part(k) for k in (0, 1)])

    @property
    def stiffness(self) -> Array:
        """K₀ … K_d, shape (1 + d, n, n)."""
        return self.parts[..., : self.parts.shape[1]]

    @property
    def loads(self) -> Array:
        """f₀ … f_d, shape (1 + d, n)."""
        return self.parts[..., self.parts.shape[1]]

    def row(self, output: int) -> Array:
        """Return r₀ … r_d of an output, shape (1 + d, n)."""
        return self.parts[..., self.parts.shape[1] + 1 + output]

    def on_subbox(self, low: Array, high: Array) -> AffineModel:
        """Return the model over a sub-box, with the coordinates that have width in it.

        The remainders are those of this box and rounding.

        Args:
            low: Lower ends in unit coordinates of this box, shape (d,).
            high: Upper ends.
        """
        wide = np.flatnonzero(high > low)
        return replace(
            self,
            blocks=self.blocks.on_subbox(low, high).restricted_to(wide),
            magnitudes=((high - low) / 2)[wide, None, None] * self.magnitudes[wide],
        )

    def has_ends_at_corners(self, output: int) -> Mask:
        """Return in which coordinates an output has its extremes at an end, the others fixed, (d,).

        A coordinate that multiplies a matrix of rank one, Kᵢ = s b bᵀ, and no load gives the output
        (α + β xᵢ)/(γ + δ xᵢ), which is monotone; so it does where the row of the output grows along
        b with it, as that of the force in a bar. A coordinate of loads or of rows alone is linear.
        """
        found = np.zeros(len(self.magnitudes), bool)
        of_inputs = zip(self.stiffness[1:], self.loads[1:], self.row(output)[1:], strict=True)
        for i, (stiffness, load, row) in enumerate(of_inputs):
            is_load = bool(load.any())
            if not stiffness.any():
                found[i] = not (is_load and row.any())
                continue
            longest = int(np.abs(stiffness).sum(axis=0).argmax())
            column = np.asarray(stiffness)[:, longest]
            b = np.asarray(column / np.linalg.norm(column))
            size = float(b @ stiffness @ b)
            is_rank_one = np.abs(stiffness - size * np.outer(b, b)).max() <= RANK_ONE * abs(size)
            is_along = np.abs(row - (row @ b) * b).max() <= RANK_ONE * np.abs(row).max()
            found[i] = is_rank_one and is_along and not is_load
        return found


def affine_model(
    system: LinearSystem, names: Sequence[str], low: Array, high: Array
) -> AffineModel:
    """Return the model of a structure over a box of parameters.

    Args:
        system: The structure, whose outputs are of displacements.
        names: Names of the d parameters; the others are nominal.
        low: Their lower ends in SI units, shape (d,).
        high: Their upper ends.

    Raises:
        RefusedError: No load is static.
        UnprovedError: A function of the parameters has no bounds over the box.
    """
    parameters = parameter_models(system, names, (low + high) / 2, (high - low) / 2, order=1)
    full = system.assembly(parameters)
    static = full.static
    if static is None:
        raise RefusedError("loads", "no static force", "a force whose history is static")
    n = len(full.pattern)
    rows = (full.row_factors[:, None] * full.rows)[:, :n]
    blocks = concatenate([full.stiffness, static, rows.T], -1)
    # Rounding of an entry, here and in sub-boxes, is some units for each of a few dozen operations.
    blocks = blocks.widened(64 * UNIT_ROUNDOFF * blocks.magnitude())
    magnitudes = [_magnitude(x) for x in blocks.homogeneous_part(1)[:, :, :n]]
    return AffineModel(blocks, np.array(magnitudes).reshape(-1, n, n))


def _magnitude(matrix: Array) -> Array:
    """Return |A| = (A²)^½ of a symmetric matrix."""
    if not matrix.any():
        return matrix
    values, vectors = np.linalg.eigh(matrix)
    return np.asarray((vectors * np.abs(values)) @ vectors.T)


class _Solution(NamedTuple):
    """A polynomial solution of degree 1 of K(x) y = b(x), and what it leaves.

    Args:
        terms: Y₀ … Y_d, shape (1 + d, n).
        products: Kᵢ Yⱼ for i, j ≥ 1, shape (d, d, n); the residual is −Σ xᵢ xⱼ Kᵢ Yⱼ and a rest.
        leftover: Bound of that rest, entry by entry: remainders and rounding, shape (n,).
        norm: Bound of the norm of the residual over the box.
    """

    terms: Array
    products: Array
    leftover: Array
    norm: float


class Enclosure(NamedTuple):
    """What is known of an output over a box.

    Args:
        lower: Guaranteed lower bound.
        upper: Guaranteed upper bound.
        slopes: Derivatives by the unit coordinates at the midpoint, shape (d,).
        slope_radii: Bound of how far derivatives in the box differ from these; infinite where the
            functions of the parameters are not affine, (d,).
    """

    lower: float
    upper: float
    slopes: Array = np.zeros(0)
    slope_radii: Array = np.zeros(0)


class StaticProof:
    """Bounds of outputs over one box.

    Args:
        model: The structure over the box.

    Raises:
        UnprovedError: The stiffness is not known to be positive definite throughout the box.
    """

    def __init__(self, model: AffineModel) -> None:
        self.model = model
        n = model.stiffness.shape[-1]
        # a symmetric matrix has no eigenvalue above its largest sum of magnitudes along a row
        self.remainder = model.blocks.remainder[:, :n]
        rest = self.remainder.sum(axis=1).max(initial=0)
        low = model.stiffness[0] - model.magnitudes.sum(axis=0) - rest * np.eye(n)
        # A Cholesky factor that is found in floating point is that of a matrix which differs by
        # at most (n + 2) u tr A in the norm (Rump, BIT 46, 433, 2006). The factor 4, with the
        # trace of K₀ ≥ Σ |Kᵢ|, covers the rounding of the magnitudes as well.
        shift = 4 * (n + 2) * UNIT_ROUNDOFF * np.trace(model.stiffness[0])
        try:
            self.factor = np.linalg.cholesky(low - shift * np.eye(n))
        except np.linalg.LinAlgError:
            what = "the stiffness may be singular in the box"
            raise UnprovedError(what, "take narrower inputs") from None
        self.middle = cho_factor(model.stiffness[0])
        inverse_factor = solve_triangular(self.factor, np.eye(n), lower=True)
        self.inverse_magnitudes = np.abs(inverse_factor.T @ inverse_factor)
        self.size = np.abs(model.stiffness).sum(axis=0)
        self.displacements = self._solve(model.loads, model.blocks.remainder[:, n])
        self.proofs: dict[int, Enclosure] = {}

    @cached_property
    def ratio(self) -> float:
        """Bound κ for which |Kᵢ| ≤ κ K_low: λ_max(K_low⁻¹K₀) − 1, since K_low + |Kᵢ| ≤ K₀."""
        half = solve_triangular(self.factor, self.model.stiffness[0], lower=True)
        both = solve_triangular(self.factor, half.T, lower=True)
        return float(np.linalg.eigvalsh((both + both.T) / 2)[-1]) * (1 + 1e-9) - 1

    def _solve(self, right: Array, remainder: Array) -> _Solution:
        """Return Y(x) with Y₀ = K₀⁻¹b₀, Yᵢ = K₀⁻¹(bᵢ − KᵢY₀); b has the shape (1 + d, n)."""
        stiffness = self.model.stiffness
        first = cho_solve(self.middle, right[0])
        slopes = cho_solve(self.middle, (right[1:] - stiffness[1:] @ first).T).T
        terms = np.vstack([first[None], slopes])
        products = np.einsum("iab,jb->ija", stiffness[1:], slopes, optimize=True)
        # what rounding leaves of degrees 0 and 1, and the rounding of all products
        left = [right[0] - stiffness[0] @ first]
        left += [right[1 + i] - stiffness[1 + i] @ first - stiffness[0] @ slopes[i]
                 for i in range(len(slopes))]  # fmt: skip
        magnitudes = np.abs(terms).sum(axis=0)
        rounding = 4 * (len(first) + len(terms)) * UNIT_ROUNDOFF
        rounded = rounding * (self.size @ magnitudes + np.abs(right).sum(axis=0))
        leftover = np.abs(left).sum(axis=0) + rounded
        leftover += remainder + self.remainder @ magnitudes
        norm = self._product_norm(products) + self._entry_norm(leftover)
        return _Solution(terms, products, leftover, norm)

    def _product_norm(self, products: Array) -> float:
        """Return a bound of ‖Σ xᵢ xⱼ wᵢⱼ‖ for vectors w, shape (d, d, n): Σ |wₐ·K_low⁻¹ w_b|."""
        d = len(products)
        if not d:
            return 0.0
        i, j = np.triu_indices(d)
        # the terms xᵢ xⱼ and xⱼ xᵢ are one
        vectors = products[i, j] + np.where((i == j)[:, None], 0.0, products[j, i])
        half = solve_triangular(self.factor, vectors.T, lower=True)
        return float(np.sqrt(np.abs(half.T @ half).sum()))

    def _entry_norm(self, bound: Array) -> float:
        """Return a bound of ‖w‖ for all w with |w| ≤ bound entry by entry."""
        return float(np.sqrt(bound @ self.inverse_magnitudes @ bound))

    def enclosure(self, output: int) -> Enclosure:
        """Return what is known of an output over the box."""
        if output not in self.proofs:
            self.proofs[output] = self._enclosure(output)
        return self.proofs[output]

    def _enclosure(self, output: int) -> Enclosure:
        """Compute the bounds of an output and of its derivatives."""
        model = self.model
        n = len(self.size)
        rows = model.row(output)
        u = self.displacements
        z = self._solve(rows, model.blocks.remainder[:, n + 1 + output])

        # the polynomial Z·f − Σ xᵢ xⱼ (Kᵢ Zⱼ)·U by degree
        of_loads = z.terms @ model.loads.T
        constant = of_loads[0, 0]
        linear = of_loads[0, 1:] + of_loads[1:, 0]
        quadratic = of_loads[1:, 1:] - z.products @ u.terms[0]
        cubic = np.einsum("ija,ka->ijk", z.products, u.terms[1:], optimize=True)
        error = z.norm * u.norm
        error += np.abs(z.terms).sum(axis=0) @ model.blocks.remainder[:, n]
        error += z.leftover @ np.abs(u.terms).sum(axis=0)
        error += np.abs(cubic).sum()
        magnitude = abs(constant) + np.abs(linear).sum() + np.abs(quadratic).sum()
        error += 4 * n * UNIT_ROUNDOFF * (magnitude + np.abs(of_loads).sum())
        mixed = np.abs(quadratic + quadratic.T)
        error += (mixed.sum() - mixed.trace()) / 2
        upper = constant + _largest(linear, quadratic.diagonal()) + error
        lower = constant - _largest(-linear, -quadratic.diagonal()) - error
        return self._with_slopes(Enclosure(lower, upper), rows, z, cubic)

    def _with_slopes(self, known: Enclosure, rows: Array, z: _Solution, cubic: Array) -> Enclosure:
        """Return an enclosure with the derivatives z·(fᵢ − Kᵢ u) + rᵢ·u and their radii.

        The true solutions are u = U + e and z = Z + g with ‖Ke‖ ≤ ‖ρ‖ and ‖Kg‖ ≤ ‖σ‖, so that the
        derivatives differ from z = Z, u = U by at most ‖σ‖ ‖fᵢ − KᵢU‖ + ‖ρ‖ ‖rᵢ − KᵢZ‖ + κ ‖σ‖ ‖ρ‖.
        """
        model = self.model
        u = self.displacements
        left_loads = model.loads[1:] - model.stiffness[1:] @ u.terms[0]
        left_rows = rows[1:] - model.stiffness[1:] @ z.terms[0]
        slopes = left_loads @ z.terms[0] + rows[1:] @ u.terms[0]
        change = left_loads @ z.terms[1:].T + left_rows @ u.terms[1:].T
        radii = np.abs(change).sum(axis=1) + np.abs(cubic).sum(axis=(1, 2))
        norms = self._norms(left_loads) + self._norms(u.products).sum(axis=1)
        radii += z.norm * norms
        norms = self._norms(left_rows) + self._norms(z.products).sum(axis=1)
        radii += u.norm * norms + self.ratio * z.norm * u.norm
        rounding = 1e-12 * (np.abs(left_loads) @ np.abs(z.terms[0]))
        if not model.is_affine:
            radii = np.full(len(cubic), np.inf)
        return known._replace(slopes=slopes, slope_radii=radii + rounding)

    def _norms(self, vectors: Array) -> Array:
        """Return the norms of vectors, shape (…, n)."""
        n = vectors.shape[-1]
        half = solve_triangular(self.factor, vectors.reshape(-1, n).T, lower=True)
        return np.asarray(np.linalg.norm(half, axis=0).reshape(vectors.shape[:-1]))


def _largest(linear: Array, square: Array) -> float:
    """Return Σᵢ max over |xᵢ| ≤ 1 of linear_i xᵢ + square_i xᵢ²."""
    inside = (square < 0) & (np.abs(linear) < -2 * square)
    ends = np.abs(linear) + square
    curved = np.where(inside, square, -1.0)
    return float(np.where(inside, -(linear**2) / (4 * curved), ends).sum())


class Extreme(NamedTuple):
    """Largest value of side × output over a box.

    Args:
        bound: Guaranteed upper bound.
        attained: Largest value found.
        at: Parameters that have it, in SI units, shape (d,).
    """

    bound: float
    attained: float
    at: Array


class StaticSearch:
    """Branch and bound over the parameters of a structure at rest.

    Args:
        system: The structure.
        names: Names of the d parameters.
        low: Lower ends of the whole box in SI units, shape (d,).
        high: Upper ends.
    """

    def __init__(self, system: LinearSystem, names: Sequence[str], low: Array, high: Array) -> None:
        self.system = system
        self.names = tuple(names)
        self.low = low
        self.high = high
        self.model = affine_model(system, names, low, high)
        if self._is_affine():
            self.model = replace(self.model, is_affine=True)
        self._proofs: dict[bytes, StaticProof] = {}
        self._values: dict[bytes, tuple[AffineModel, Array]] = {}
        self._corners: dict[int, Mask] = {}

    def _is_affine(self) -> bool:
        """Return whether stiffness, loads and rows are affine functions of the parameters.

        A box of a tenth of each parameter tells: over a narrow one every function looks affine.
        """
        centre = (self.low + self.high) / 2
        radius = np.maximum((self.high - self.low) / 2, np.abs(centre) / 10)
        try:
            wide = affine_model(self.system, self.names, centre - radius, centre + radius)
        except UnprovedError:
            return False
        largest = np.abs(wide.parts).max(axis=(0, 1))  # of each column: units differ
        return bool((wide.blocks.remainder.max(axis=0) <= AFFINE * largest).all())

    def size(self, output: int, point: Array) -> float:
        """Return Σ |rₐ uₐ| of an output at parameters in SI units, its magnitude without signs."""
        row, displacements = self._solved(output, point)
        return float(np.abs(row) @ np.abs(displacements))

    def _unit(self, points: Array) -> Array:
        """Return the unit coordinates of the whole box; 0 of parameters without width."""
        radius = (self.high - self.low) / 2
        return np.asarray((points - (self.low + self.high) / 2) / np.where(radius > 0, radius, 1.0))

    def proof(self, low: Array, high: Array) -> tuple[StaticProof, Ints]:
        """Return the proof over a sub-box, in SI units, and the parameters that have width in it.

        Raises:
            UnprovedError: The stiffness is not known to be positive definite in the sub-box.
        """
        wide = np.flatnonzero(high > low)
        key = low.tobytes() + high.tobytes()
        if key not in self._proofs:
            if len(self._proofs) > 64:  # outputs and sides share the first boxes
                self._proofs.pop(next(reversed(self._proofs)))
            if self.model.is_affine:
                over_box = self.model.on_subbox(self._unit(low), self._unit(high))
            else:
                over_box = affine_model(self.system, self.names, low, high)
                has_width: Array = np.where(high > low, 1.0, 0.0)
                over_box = over_box.on_subbox(-has_width, has_width)
            self._proofs[key] = StaticProof(over_box)
        return self._proofs[key], wide

    def value(self, output: int, point: Array) -> float:
        """Return an output at parameters in SI units."""
        row, displacements = self._solved(output, point)
        return float(row @ displacements)

    def _solved(self, output: int, point: Array) -> tuple[Array, Array]:
        """Return the row of an output and the displacements at parameters, shape (n,) each."""
        key = point.tobytes()
        if key not in self._values:
            model = affine_model(self.system, self.names, point, point)
            displacements = np.linalg.solve(model.stiffness[0], model.loads[0])
            self._values[key] = (model, displacements)
        model, displacements = self._values[key]
        return model.row(output)[0], displacements

    def extreme(
        self, output: int, side: float, low: Array, high: Array, *, gap: float, max_boxes: int
    ) -> Extreme:
        """Return the largest value of side × output over a sub-box of the whole box.

        Inputs whose derivative has a proved sign move to the end where the output is larger. Of the
        open sub-box with the largest bound one input is chosen: one that has its extremes at its
        ends is set to either end, another one is bisected.

        Args:
            output: Index of the output.
            side: 1, or −1 for the smallest value.
            low: Lower ends in SI units, shape (d,).
            high: Upper ends.
            gap: Wanted distance of bound and attained value, in the unit of the output.
            max_boxes: Number of sub-boxes after which the search ends with a larger gap.

        Raises:
            UnprovedError: The stiffness is not known to be positive definite in some sub-box.
        """
        at_corners = self._at_corners(output)
        best = Extreme(np.inf, -np.inf, (low + high) / 2)
        order = count()
        waiting: list[tuple[float, int, Array, Array, int]] = []

        def add(low: Array, high: Array) -> None:
            """Examine a sub-box, and keep it if it may hold a larger value than the best one."""
            nonlocal best
            bound, axis, low, high = self._examine(output, side, low, high)
            at = low
            if axis >= 0:
                at = self._candidate(output, side, low, high)
            value = side * self.value(output, at)
            if value > best.attained:
                best = Extreme(np.inf, value, at)
            heappush(waiting, (-bound, next(order), low, high, axis))

        add(low, high)
        for _ in range(max_boxes):
            bound, _, low, high, axis = waiting[0]
            is_closed = -bound - best.attained <= gap
            if axis < 0 or is_closed:
                break
            heappop(waiting)
            middle = (low[axis] + high[axis]) / 2
            ends = [(low[axis], middle), (middle, high[axis])]
            if at_corners[axis]:
                ends = [(low[axis], low[axis]), (high[axis], high[axis])]
            for lower_end, upper_end in ends:
                part_low, part_high = low.copy(), high.copy()
                part_low[axis], part_high[axis] = lower_end, upper_end
                add(part_low, part_high)
        bound = -waiting[0][0]
        if not np.isfinite(bound):
            what = "the stiffness may be singular in the box"
            raise UnprovedError(what, "take narrower inputs")
        return best._replace(bound=max(bound, best.attained))

    def _at_corners(self, output: int) -> Mask:
        """Return which inputs have extremes of an output at their ends, (d,)."""
        if output not in self._corners:
            found: Mask = np.zeros(len(self.names), bool)
            if self.model.is_affine:
                found = self.model.has_ends_at_corners(output)
            self._corners[output] = found
        return self._corners[output]

    def _examine(
        self, output: int, side: float, low: Array, high: Array
    ) -> tuple[float, int, Array, Array]:
        """Return a bound of side × output over a sub-box, the input to divide, and what is left.

        The input is −1 where none has width; what is left is the sub-box after inputs with a proved
        sign have moved to an end.
        """
        while True:
            try:
                proof, wide = self.proof(low, high)
            except UnprovedError:
                return np.inf, int((self._unit(high) - self._unit(low)).argmax()), low, high
            known = proof.enclosure(output)
            bound = known.upper if side > 0 else -known.lower
            if not len(wide):
                return bound, -1, low, high
            sure = np.abs(known.slopes) > known.slope_radii
            if not sure.any():
                break
            rises = side * known.slopes[sure] > 0
            fixed = wide[sure]
            low, high = low.copy(), high.copy()
            low[fixed] = np.where(rises, high[fixed], low[fixed])
            high[fixed] = low[fixed]
        finite = np.where(np.isfinite(known.slope_radii), known.slope_radii, 1e-300)
        spread = np.abs(known.slopes) + finite
        return bound, int(wide[spread.argmax()]), low, high

    def _candidate(self, output: int, side: float, low: Array, high: Array) -> Array:
        """Return the corner of a sub-box towards which an output rises at its midpoint."""
        try:
            proof, wide = self.proof(low, high)
        except UnprovedError:
            return low
        slopes = np.zeros(len(low))
        slopes[wide] = proof.enclosure(output).slopes
        return np.where(side * slopes > 0, high, low)
