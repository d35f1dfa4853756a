"""Truncated Taylor polynomials of degree 2: first and second derivatives of a model.

A jet is a value with its first and second derivatives with respect to d parameters. With d = 0 it
is a plain array that costs nothing more, so the same code computes values alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Jet:
    """Value of shape V with derivatives along d parameters; broadcasts over V."""

    terms: Array  # value, first and second derivatives (by i ≤ j), (1 + d + d (d + 1) / 2, *V)
    directions: int  # number of parameters d

    __array_ufunc__ = None  # an array on the left leaves the operation to the jet

    @classmethod
    def constant(cls, value: ArrayLike, directions: int) -> Jet:
        """A jet without dependence on any of `directions` parameters."""
        array, d = np.asarray(value, float), directions
        terms = np.zeros((1 + d + d * (d + 1) // 2, *array.shape))
        terms[0] = array
        return cls(terms, d)

    @classmethod
    def of(cls, value: Array, first: Array, second: Array) -> Jet:
        """The jet of a value V, first derivatives (d, *V) and second ones (d, d, *V), symmetric."""
        i, j, _ = _pairs(len(first))
        return cls(np.concatenate([value[None], first, second[i, j]]), len(first))

    def like(self, value: ArrayLike) -> Jet:
        """A constant with as many derivatives as this jet."""
        return Jet.constant(value, self.directions)

    @property
    def value(self) -> Array:
        """Value, shape V."""
        return self.terms[0, ...]

    @property
    def first(self) -> Array:
        """First derivatives, shape (d, *V)."""
        return self.terms[1 : 1 + self.directions]

    @property
    def second(self) -> Array:
        """Second derivatives, shape (d, d, *V), symmetric in the first two axes."""
        return self.terms[1 + self.directions :][_pairs(self.directions)[2]]

    def __getitem__(self, index: Any) -> Jet:
        key = index if isinstance(index, tuple) else (index,)
        return Jet(self.terms[(slice(None), *key)], self.directions)

    @staticmethod
    def stack(jets: Sequence[Jet]) -> Jet:
        """Joins jets along a new last axis of V."""
        return Jet(np.stack([x.terms for x in jets], -1), jets[0].directions)

    def contract(self, arrays: Array) -> Jet:
        """Sum of jets shape (…, e) times arrays of numbers (e, …)."""
        return Jet(np.tensordot(self.terms, arrays, 1), self.directions)

    def map(self, linear: Callable[[Array], Array]) -> Jet:
        """Linear map of value and derivatives, as a function of arrays with one more axis first."""
        return Jet(linear(self.terms), self.directions)

    def rescaled(self, units: Array) -> Jet:
        """The same with derivatives by the parameters measured in `units`, shape (d,)."""
        i, j, _ = _pairs(self.directions)
        factors = np.concatenate([[1.0], units, units[i] * units[j]])
        return self.map(lambda x: x * factors.reshape(-1, *[1] * (x.ndim - 1)))

    def __neg__(self) -> Jet:
        return Jet(-self.terms, self.directions)

    def __add__(self, other: Jet | ArrayLike) -> Jet:
        a, b = _matched(self, other)
        return Jet(a.terms + b.terms, self.directions)

    __radd__ = __add__

    def __sub__(self, other: Jet | ArrayLike) -> Jet:
        return self + (-other if isinstance(other, Jet) else -np.asarray(other, float))

    def __rsub__(self, other: Jet | ArrayLike) -> Jet:
        return -self + other

    def __mul__(self, other: Jet | ArrayLike) -> Jet:
        if not isinstance(other, Jet):
            factor = np.asarray(other, float)
            return Jet(_padded(self, factor.ndim).terms * factor, self.directions)
        return _product(*_matched(self, other), np.multiply)

    __rmul__ = __mul__

    def __matmul__(self, other: Jet | Array) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.terms @ other, self.directions)
        return _product(self, other, np.matmul)

    def __rmatmul__(self, other: Array) -> Jet:
        return Jet(other @ self.terms, self.directions)

    def __truediv__(self, other: Jet | ArrayLike) -> Jet:
        return self * (other**-1 if isinstance(other, Jet) else 1 / np.asarray(other, float))

    def __rtruediv__(self, other: ArrayLike) -> Jet:
        return self**-1 * other

    def __pow__(self, exponent: float) -> Jet:
        """Real power, with derivatives by the chain rule."""
        if exponent == 2:
            return self * self
        x, k, d = self.value, exponent, self.directions
        i, j, _ = _pairs(d)
        terms = k * x ** (k - 1) * self.terms
        terms[0] = x**k
        terms[1 + d :] += k * (k - 1) * x ** (k - 2) * self.first[i] * self.first[j]
        return Jet(terms, d)


@cache
def _pairs(d: int) -> tuple[Array, Array, Array]:
    """Pairs i ≤ j of d parameters, as indices i and j, and the place of each pair, (d, d)."""
    i, j = np.triu_indices(d)
    place = np.zeros((d, d), int)
    place[i, j] = place[j, i] = np.arange(len(i))
    return i, j, place


def _padded(a: Jet, ndim: int) -> Jet:
    """`a` with V extended on the left by axes of length 1 up to `ndim` axes."""
    missing = ndim - (a.terms.ndim - 1)
    return a if missing <= 0 else a[(None,) * missing]


def _matched(a: Jet, other: Jet | ArrayLike) -> tuple[Jet, Jet]:
    b = other if isinstance(other, Jet) else a.like(other)
    return _padded(a, b.terms.ndim - 1), _padded(b, a.terms.ndim - 1)


def _product(a: Jet, b: Jet, bilinear: Callable[[Array, Array], Array]) -> Jet:
    """Product of two jets by `np.multiply` or `np.matmul`, with derivatives by Leibniz' rule."""
    d, terms = a.directions, np.asarray(bilinear(a.terms, b.value))
    if d:  # operations on empty arrays take time, too
        i, j, _ = _pairs(d)
        terms[1:] += bilinear(a.value, b.terms[1:])
        terms[1 + d :] += bilinear(a.first[i], b.first[j])
        terms[1 + d :] += bilinear(a.first[j], b.first[i])
    return Jet(terms, d)


def variables(points: Array, names: Sequence[str], selected: Sequence[str]) -> dict[str, Jet]:
    """Jets of the independent variables by name, each of shape (S,), with slope 1 by itself.

    `points` (S, len(names)) are their values, `selected` the names to differentiate by, in the
    order of the derivatives.
    """
    jets = Jet.constant(points, len(selected))
    for k, name in enumerate(selected):
        jets.first[k, :, names.index(name)] = 1.0
    return {name: jets[:, i] for i, name in enumerate(names)}


def inverse(a: Jet) -> Jet:
    """Inverse of square matrices, shape (..., n, n), by one factorisation."""
    x, d = np.linalg.inv(a.value), a.directions
    i, j, _ = _pairs(d)
    scaled = x @ a.terms[1:]  # A⁻¹ A_k, then A⁻¹ A_ij
    terms = np.concatenate([x[None], -scaled @ x])
    first = terms[1 : 1 + d]
    terms[1 + d :] -= scaled[i] @ first[j] + scaled[j] @ first[i]
    return Jet(terms, d)


def concatenate(parts: Sequence[Jet], axis: int) -> Jet:
    """Joins jets along a negative `axis` of V."""
    return Jet(np.concatenate([x.terms for x in parts], axis), parts[0].directions)
