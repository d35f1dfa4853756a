"""Polynomials of bounded total degree on the unit box, fitted to values and derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement, pairwise
from math import comb

import numpy as np
from scipy.sparse import csr_array

from alphacut.frame.calculus.jet import Array, Jet

Index = np.ndarray[tuple[int, ...], np.dtype[np.int64]]


def terms(dimension: int, degree: int) -> int:
    """Number of monomials of at most `degree` in `dimension` variables."""
    return comb(dimension + degree, degree)


@lru_cache
def exponents(dimension: int, degree: int) -> Index:
    """Exponents of the monomials by rising total degree, shape (terms, dimension)."""
    rows = []
    for total in range(degree + 1):
        for chosen in combinations_with_replacement(range(dimension), total):
            rows.append(
                np.bincount(chosen, minlength=dimension)
                if chosen
                else np.zeros(dimension, np.int64)
            )
    return np.array(rows, np.int64)


def basis(u: Array, index: Index) -> Array:
    """Values of the monomials with exponents `index` (terms, d) at points u (S, d), (S, terms)."""
    axis, parent, starts = _parents(index.tobytes(), index.shape)
    out, points = np.ones((len(index), len(u))), np.ascontiguousarray(u.T)
    for first, last in pairwise(starts):
        rows = slice(first, last)
        out[rows] = out[parent[rows]] * points[axis[rows]]
    return out.T


@lru_cache(64)
def _parents(index: bytes, shape: tuple[int, int]) -> tuple[Index, Index, list[int]]:
    """Recursion by which monomials are evaluated: each is one variable times a lower monomial.

    Args:
        index: Bytes of the exponents (terms, d), by rising total degree.
        shape: Their shape.

    Returns:
        Variable of each monomial and position of the lower one, (terms,) each; first position of
        each total degree from 1 on, with the number of terms at the end.
    """
    rows = np.frombuffer(index, np.int64).reshape(shape)
    axis, total = (rows > 0).argmax(1), rows.sum(1)
    parent = np.zeros(len(rows), np.int64)
    for i in range(shape[1]):
        parent[axis == i] = lowered(index, shape, i)[axis == i]
    starts = np.searchsorted(total, np.arange(1, total.max(initial=0) + 2))
    return axis, parent, [int(start) for start in starts]


def derivative(index: Index, axis: int, coefficients: Array) -> Array:
    """Coefficients (terms, …) of the derivative along `axis`, on the same monomials."""
    position = lowered(index.tobytes(), index.shape, axis)
    out = np.zeros_like(coefficients)
    raised = index[:, axis] > 0
    out[position[raised]] = (index[raised, axis] * coefficients[raised].T).T
    return out


@lru_cache(64)
def lowered(index: bytes, shape: tuple[int, int], axis: int) -> Index:
    """Positions of the monomials with one power of `axis` less, (terms,); 0 for none."""
    rows = np.frombuffer(index, np.int64).reshape(shape)
    lookup = {tuple(row): k for k, row in enumerate(rows.tolist())}
    step = np.eye(shape[1], dtype=np.int64)[axis]
    return np.array([lookup.get(tuple(row), 0) for row in (rows - step).tolist()], np.int64)


def product(real: Array, coefficients: Array) -> Array:
    """Real @ coefficients for complex coefficients without making `real` complex."""
    if not np.iscomplexobj(coefficients):
        return real @ coefficients
    flat = np.ascontiguousarray(coefficients).view(float)
    values: Array = (real @ flat).view(complex)
    return values


@dataclass(frozen=True, eq=False)
class Polynomial:
    """A vector of polynomials with its derivatives up to order 2 as polynomials.

    Args:
        index: Exponents, shape (terms, d).
        coefficients: Shape (terms, K), complex or real.
    """

    index: Index
    coefficients: Array

    @cached_property
    def gradient(self) -> Array:
        """Coefficients of the first derivatives, shape (d, terms, K)."""
        return np.stack(
            [derivative(self.index, i, self.coefficients) for i in range(self.index.shape[1])]
        )

    @cached_property
    def hessian(self) -> Array:
        """Coefficients of the second derivatives, shape (d, d, terms, K)."""
        d = self.index.shape[1]
        out = np.zeros((d, *self.gradient.shape), self.coefficients.dtype)
        for i in range(d):
            for j in range(i, d):
                out[i, j] = out[j, i] = derivative(self.index, j, self.gradient[i])
        return out

    def divided(self, scale: Array) -> Polynomial:
        """The polynomials, each divided by its entry of `scale` (K,)."""
        return Polynomial(self.index, self.coefficients / scale)

    def __call__(self, u: Array) -> Array:
        """Values at (S, d), shape (S, K)."""
        return product(basis(u, self.index), self.coefficients)

    def jets(self, u: Array) -> Array:
        """Values, gradients and Hessians (upper triangle) at (S, d), shape (S, q, K)."""
        B, parts = basis(u, self.index), [self.coefficients, *self._packed]
        tables = np.hstack([product(B[:, : len(part)], part) for part in parts])
        return tables.reshape(len(u), -1, self.coefficients.shape[1])

    @cached_property
    def _packed(self) -> list[Array]:
        """Coefficients of all first and all second derivatives side by side, without zero rows."""
        d, degree = self.index.shape[1], int(self.index.sum(1).max())
        derivatives = (self.gradient, self.hessian[np.triu_indices(d)])
        counts = (terms(d, max(degree - k, 0)) for k in (1, 2))
        arrays_and_counts = zip(derivatives, counts, strict=True)
        return [x[:, :n].swapaxes(0, 1).reshape(n, -1) for x, n in arrays_and_counts]


def fit(u: Array, data: Jet, degree: int) -> Polynomial:
    """Fits K polynomials of total `degree` to values and derivatives by least squares.

    Derivatives of order k weigh 1 / degree^k, which is how they grow with the degree.

    Args:
        u: Points of the unit box, shape (S, d).
        data: Values, gradients and Hessians there, shape (S, K).
        degree: Total degree.
    """
    index = exponents(u.shape[1], degree)
    d, w = u.shape[1], 1 / max(degree, 1)  # w: weight of slopes, w² of second derivatives
    B = basis(u, index)
    pairs = [(i, j) for i in range(d) for j in range(i, d)]
    slopes = [_differentiated(B, index, (i,)) for i in range(d)]
    curves = [_differentiated(B, index, pair) for pair in pairs]
    design = np.vstack([B, *(w * x for x in slopes), *(w * w * x for x in curves)])
    second = [data.second[pair] for pair in pairs]
    values = np.vstack([data.value, *(w * x for x in data.first), *(w * w * x for x in second)])
    column_norms = np.linalg.norm(design, axis=0)
    q, r = np.linalg.qr(design / column_norms)
    solution = np.linalg.solve(r, product(q.T, values)) / column_norms[:, None]
    return Polynomial(index, solution)


@dataclass(frozen=True)
class LowerGrid:
    """As many points as terms, for products of a polynomial of `degrees` and one of total `excess`.

    Args:
        degrees: Exponents along each axis that are free of any sum, d of them.
        excess: Largest sum of what exponents exceed these by.
    """

    degrees: tuple[int, ...]
    excess: int

    def __len__(self) -> int:
        counts = np.eye(1, self.excess + 1, dtype=object)[0]  # sets of axes so far, by their sum
        for degree in self.degrees:
            counts = (degree * counts) + np.cumsum(counts)
        return int(counts.sum())

    @cached_property
    def index(self) -> Index:
        """Exponents e of the terms, shape (S, d): all with Σ max(e_i − degree_i, 0) ≤ excess."""
        rows, used_excess = np.zeros((1, 0), np.int64), np.zeros(1, np.int64)
        for degree in self.degrees:
            count = degree + 1 + self.excess - used_excess
            which = np.repeat(np.arange(len(rows)), count)
            exponents = np.concatenate([np.arange(n) for n in count])
            rows = np.column_stack([rows[which], exponents])
            used_excess = used_excess[which] + np.maximum(exponents - degree, 0)
        return rows

    @property
    def points(self) -> Array:
        """Leja points on which the terms are known, shape (S, d)."""
        return leja(max(self.degrees) + self.excess + 1)[self.index]

    def coefficients(self, values: Array) -> Array:
        """Chebyshev coefficients c_j of polynomials with `values` (S, …) at `points`, same shape.

        The constant comes first. Since no product of Chebyshev polynomials T_k exceeds 1 on the
        box, Σ ‖c_j‖ bounds ‖polynomial‖ there, for any norm. The matrix of T_k at the points is L U
        along each axis; so is that of all terms, since with a term the set holds all of lower
        exponents.
        """
        out = values.reshape(len(values), -1)
        for factor in self._factors:
            out = factor @ out
        return np.asarray(out.reshape(values.shape))

    @cached_property
    def _factors(self) -> list[csr_array]:
        """L⁻¹ along each axis, then U⁻¹."""
        triangles = _triangles(max(self.degrees) + self.excess + 1)
        axes = range(len(self.degrees))
        return [self._along(axis, triangle) for triangle in triangles for axis in axes]

    def _along(self, axis: int, factor: Array) -> csr_array:
        """Sparse matrix (S, S) that applies a triangular `factor` (n, n) along one axis.

        Its rows and columns are the S terms. With a term the set holds all of lower degree along
        the axis; they are found by keys that have the exponents as digits.
        """
        degrees = self.index[:, axis]
        place_values = len(factor) ** np.arange(len(self.degrees))
        keys = self.index @ place_values
        order = np.argsort(keys)
        rows, columns = [], []
        for difference in range(int(degrees.max()) + 1):
            high = np.flatnonzero(degrees >= difference)
            low = order[np.searchsorted(keys[order], keys[high] - difference * place_values[axis])]
            rows.append(high)
            columns.append(low)
        high, low = np.concatenate(rows), np.concatenate(columns)
        is_lower = bool(factor[-1, 0])  # a lower triangle takes from the terms below
        to, source = (high, low) if is_lower else (low, high)
        return csr_array(
            (factor[degrees[to], degrees[source]], (to, source)), shape=(len(degrees),) * 2
        )


@lru_cache
def leja(count: int) -> Array:
    """Leja points on [−1, 1], shape (count,), from 0 on.

    Each has the greatest product of its distances from all before, among 4001 candidates.
    """
    candidates = np.cos(np.linspace(0, np.pi, 4001))
    points, distance_products = [0.0], np.abs(candidates)
    while len(points) < count:
        points.append(float(candidates[distance_products.argmax()]))
        distance_products = distance_products * np.abs(candidates - points[-1])
    return np.array(points)


@lru_cache
def _triangles(count: int) -> tuple[Array, Array]:
    """L⁻¹ and U⁻¹, (count, count) each, where L U has entries T_k(x_j) at Leja points x_j.

    T_k are Chebyshev's polynomials; L has ones on its diagonal.
    """
    upper = np.polynomial.chebyshev.chebvander(leja(count), count - 1)
    lower = np.eye(count)
    for k in range(count - 1):  # Gaussian elimination; the order of Leja points needs no pivots
        lower[k + 1 :, k] = upper[k + 1 :, k] / upper[k, k]
        upper[k + 1 :] -= np.outer(lower[k + 1 :, k], upper[k])
    return np.tril(np.linalg.inv(lower)), np.triu(np.linalg.inv(np.triu(upper)))


def _differentiated(B: Array, index: Index, axes: tuple[int, ...]) -> Array:
    """Values (S, terms) of the monomials' derivatives along `axes`, from their values B."""
    position, factor = np.arange(len(index)), np.ones(len(index))
    for axis in axes:
        factor = factor * index[position, axis]
        position = lowered(index.tobytes(), index.shape, axis)[position]
    return B[:, position] * factor
