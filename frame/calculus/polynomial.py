"""Polynomials of bounded total degree on the unit box, fitted to values and derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import combinations_with_replacement
from math import comb, prod

import numpy as np
from scipy.fft import dctn

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
    """Monomials at points (S, d), shape (S, terms)."""
    top = int(index.max(initial=0))
    powers = np.ones((u.shape[1], top + 1, len(u)))
    for k in range(1, top + 1):
        powers[:, k] = powers[:, k - 1] * u.T
    out = np.ones((len(u), len(index)))
    for start in range(0, len(u), 2048):  # pieces that stay in the cache
        piece = powers[..., start : start + 2048]
        monomials: Array = piece[0, index[:, 0]]
        for i in range(1, u.shape[1]):
            monomials *= piece[i, index[:, i]]
        out[start : start + 2048] = monomials.T
    return out


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
        plain: Array = real @ coefficients
        return plain
    flat = np.ascontiguousarray(coefficients).view(float)
    both: Array = (real @ flat).view(complex)
    return both


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
    def slope(self) -> Array:
        """Coefficients of the first derivatives, shape (d, terms, K)."""
        return np.stack(
            [derivative(self.index, i, self.coefficients) for i in range(self.index.shape[1])]
        )

    @cached_property
    def curve(self) -> Array:
        """Coefficients of the second derivatives, shape (d, d, terms, K)."""
        d = self.index.shape[1]
        out = np.zeros((d, *self.slope.shape), self.coefficients.dtype)
        for i in range(d):
            for j in range(i, d):
                out[i, j] = out[j, i] = derivative(self.index, j, self.slope[i])
        return out

    def __call__(self, u: Array) -> Array:
        """Values at (S, d), shape (S, K)."""
        return product(basis(u, self.index), self.coefficients)

    def jet(self, u: Array) -> Jet:
        """Values with first and second derivatives, V = (S, K)."""
        B = basis(u, self.index)
        d, degree = self.index.shape[1], int(self.index.sum(1).max())
        second = np.empty((d, d, len(u), self.coefficients.shape[1]), self.coefficients.dtype)
        # a derivative has fewer terms
        lower, lowest = (terms(d, max(degree - k, 0)) for k in (1, 2))
        for i in range(d):
            for j in range(i, d):
                second[i, j] = second[j, i] = product(B[:, :lowest], self.curve[i, j, :lowest])
        first = np.stack([product(B[:, :lower], self.slope[i, :lower]) for i in range(d)])
        return Jet(product(B, self.coefficients), first, second)


def fit(u: Array, data: Jet, degree: int) -> Polynomial:
    """Least-squares fit to values and derivatives, V = (S, K), at unit points (S, d)."""
    index = exponents(u.shape[1], degree)
    d = u.shape[1]
    unit = Polynomial(index, np.eye(len(index)))
    B = basis(u, index)
    pairs = [(i, j) for i in range(d) for j in range(i, d)]
    left = [B, *(B @ unit.slope[i] for i in range(d)), *(B @ unit.curve[i, j] for i, j in pairs)]
    right = [data.value, *data.first, *(data.second[i, j] for i, j in pairs)]
    weights = [1.0, *[1 / max(degree, 1)] * d, *[1 / max(degree, 1) ** 2] * len(pairs)]
    rows = np.vstack([w * x for w, x in zip(weights, left, strict=True)])
    values = np.vstack([w * x for w, x in zip(weights, right, strict=True)])
    scale = np.linalg.norm(rows, axis=0)
    solution = np.linalg.lstsq(rows / scale, values, rcond=1e-15)[0] / scale[:, None]
    return Polynomial(index, solution)


@dataclass(frozen=True)
class ChebyshevGrid:
    """The Gauss–Chebyshev points on which a polynomial of given degrees is known by its values.

    Args:
        degrees: Largest exponent along each axis, d of them.
    """

    degrees: tuple[int, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(degree + 1 for degree in self.degrees)

    def __len__(self) -> int:
        return prod(self.shape)

    @property
    def points(self) -> Array:
        """All points, shape (S, d)."""
        axes = [np.cos(np.pi * (np.arange(n) + 0.5) / n) for n in self.shape]
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(axes))

    def coefficients(self, values: Array) -> Array:
        """Chebyshev coefficients of values (S, …), same shape, the constant first.

        Since no product exceeds 1 on the box, Σ ‖c_j‖ bounds ‖polynomial‖ there, for any norm.
        """
        out = dctn(
            values.reshape(*self.shape, -1), type=2, axes=range(len(self.shape)), overwrite_x=True
        ) / len(self)
        for axis in range(len(self.shape)):
            out[(slice(None),) * axis + (0,)] /= 2
        coefficients: Array = out.reshape(values.shape)
        return coefficients
