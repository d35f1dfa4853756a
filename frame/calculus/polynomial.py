"""Polynomials of bounded total degree on the unit box: their values and derivatives at points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import pairwise
from math import comb

import numpy as np

from alphacut.frame.calculus.monomials import count, exponents
from alphacut.frame.calculus.taylor_model import TaylorModel
from alphacut.fuzzy.arrays import Array

Index = np.ndarray[tuple[int, ...], np.dtype[np.int64]]


def terms(dimension: int, degree: int) -> int:
    """Number of monomials of at most `degree` in `dimension` variables."""
    return comb(dimension + degree, degree)


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

    @classmethod
    def of_model(cls, model: TaylorModel) -> Polynomial:
        """The polynomials of a Taylor model, K functions in the order of its shape."""
        d, degrees = model.inputs, range(model.order + 1)
        index = np.concatenate([exponents(d, degree) for degree in degrees])
        parts = [model.part(degree).reshape(count(d, degree), -1) for degree in degrees]
        return cls(index, np.concatenate(parts))

    def as_model(self, shape: tuple[int, ...]) -> TaylorModel:
        """The polynomials as functions of some shape, of which none has a remainder."""
        total = self.index.sum(1)
        order = int(total.max(initial=0))
        parts = (self.coefficients[total == degree] for degree in range(order + 1))
        shaped = tuple(part.reshape(len(part), *shape) for part in parts)
        return TaylorModel(shaped, np.zeros(shape), self.index.shape[1], order)

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

    def divided_by(self, scale: Array) -> Polynomial:
        """The polynomials, each divided by its entry of `scale` (K,)."""
        return Polynomial(self.index, self.coefficients / scale)

    def __call__(self, u: Array) -> Array:
        """Values at (S, d), shape (S, K)."""
        return product(basis(u, self.index), self.coefficients)

    def jets(self, u: Array) -> Array:
        """Values, gradients and Hessians (upper triangle) at (S, d), shape (S, q, K)."""
        B, parts = basis(u, self.index), [self.coefficients, *self._derivative_tables]
        tables = np.hstack([product(B[:, : len(part)], part) for part in parts])
        return tables.reshape(len(u), -1, self.coefficients.shape[1])

    @cached_property
    def _derivative_tables(self) -> list[Array]:
        """Coefficients of all first and all second derivatives side by side, without zero rows."""
        d, degree = self.index.shape[1], int(self.index.sum(1).max())
        derivatives = (self.gradient, self.hessian[np.triu_indices(d)])
        counts = (terms(d, max(degree - k, 0)) for k in (1, 2))
        arrays_and_counts = zip(derivatives, counts, strict=True)
        return [x[:, :n].swapaxes(0, 1).reshape(n, -1) for x, n in arrays_and_counts]
