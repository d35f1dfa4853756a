"""Truncated Taylor polynomials of degree 2: first and second derivatives of a model.

A jet is a value with its first and second derivatives with respect to d parameters. With d = 0 it
is a plain array that costs nothing more, so the same code computes values alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Jet:
    """An array of shape V with its first and second derivatives by d parameters.

    Operators act on jets as NumPy's act on arrays of shape V, and broadcast over V.

    Args:
        terms: Values, then the d first derivatives, then the second derivatives by the parameters
            i and j for i ≤ j, shape (1 + d + d (d + 1)/2, *V).
        directions: Number d of parameters.
    """

    # NumPy's arrays as left operands leave the operation to this class
    __array_ufunc__ = None

    terms: Array
    directions: int

    @classmethod
    def constant(cls, value: ArrayLike, directions: int) -> Jet:
        """Return a constant, of shape V, whose derivatives by `directions` parameters are zero."""
        array = np.asarray(value, float)
        d = directions
        terms = np.zeros((1 + d + d * (d + 1) // 2, *array.shape))
        terms[0] = array
        return cls(terms, d)

    @classmethod
    def of(cls, value: Array, first: Array, second: Array) -> Jet:
        """Return the jet with the given values and derivatives by d parameters.

        Args:
            value: Values, of any shape V.
            first: First derivatives, shape (d, *V).
            second: Second derivatives, symmetric in the first two axes, shape (d, d, *V).
        """
        pairs = _pairs(len(first))
        return cls(np.concatenate([value[None], first, second[pairs.i, pairs.j]]), len(first))

    def like(self, value: ArrayLike) -> Jet:
        """Return a constant with as many derivatives as this jet."""
        return Jet.constant(value, self.directions)

    @property
    def value(self) -> Array:
        """Values, shape V."""
        return self.terms[0, ...]

    @property
    def first(self) -> Array:
        """First derivatives, shape (d, *V)."""
        return self.terms[1 : 1 + self.directions]

    @property
    def second(self) -> Array:
        """Second derivatives, shape (d, d, *V), symmetric in the first two axes."""
        return self.terms[1 + self.directions :][_pairs(self.directions).place]

    def __getitem__(self, index: Any) -> Jet:
        key = index if isinstance(index, tuple) else (index,)
        return Jet(self.terms[(slice(None), *key)], self.directions)

    @staticmethod
    def stack(jets: Sequence[Jet]) -> Jet:
        """Return jets of equal shape V, joined along a new last axis of V."""
        return Jet(np.stack([x.terms for x in jets], -1), jets[0].directions)

    def contract(self, arrays: Array) -> Jet:
        """Return Σ_k x[…, k] arrays[k] of a jet x, for V = (…, e) and numbers of shape (e, …)."""
        return Jet(np.tensordot(self.terms, arrays, 1), self.directions)

    def map(self, linear: Callable[[Array], Array]) -> Jet:
        """Return a linear map of the values and of each derivative.

        Args:
            linear: The map. It takes and returns arrays with one more axis in front of V.
        """
        return Jet(linear(self.terms), self.directions)

    def rescaled(self, units: Array) -> Jet:
        """Return the same values with derivatives by the parameters over their units.

        Args:
            units: Unit u of each parameter p, shape (d,): d/d(p/u) = u d/dp.
        """
        # One factor for each row: the values, the first and the second derivatives.
        pairs = _pairs(self.directions)
        factors = np.concatenate([[1.0], units, units[pairs.i] * units[pairs.j]])
        return self.map(lambda x: x * np.expand_dims(factors, tuple(range(1, x.ndim))))

    def __neg__(self) -> Jet:
        return Jet(-self.terms, self.directions)

    def __add__(self, other: Jet | ArrayLike) -> Jet:
        a, b = _matched(self, other)
        return Jet(a.terms + b.terms, self.directions)

    __radd__ = __add__

    def __sub__(self, other: Jet | ArrayLike) -> Jet:
        if isinstance(other, Jet):
            return self + -other
        return self + -np.asarray(other, float)

    def __rsub__(self, other: Jet | ArrayLike) -> Jet:
        return -self + other

    def __mul__(self, other: Jet | ArrayLike) -> Jet:
        """Return the elementwise product with a jet of the same parameters or with numbers."""
        if not isinstance(other, Jet):
            factor = np.asarray(other, float)
            return Jet(_padded(self, factor.ndim).terms * factor, self.directions)
        a, b = _matched(self, other)
        return _product(a, b, np.multiply)

    __rmul__ = __mul__

    def __matmul__(self, other: Jet | Array) -> Jet:
        if not isinstance(other, Jet):
            return Jet(self.terms @ other, self.directions)
        return _product(self, other, np.matmul)

    def __rmatmul__(self, other: Array) -> Jet:
        return Jet(other @ self.terms, self.directions)

    def __truediv__(self, other: Jet | ArrayLike) -> Jet:
        if isinstance(other, Jet):
            return self * other**-1
        return self * (1 / np.asarray(other, float))

    def __rtruediv__(self, other: ArrayLike) -> Jet:
        return self**-1 * other

    def __pow__(self, exponent: float) -> Jet:
        """Return a real power x^k, entry by entry, with derivatives by the chain rule.

        Zeros need k ≥ 2, and negative values a whole k. Elsewhere entries become NaN or infinite,
        with a warning of NumPy.
        """
        if exponent == 2:
            return self * self
        x = self.value
        k = exponent
        d = self.directions
        pairs = _pairs(d)
        # (x^k)_i = k x^(k−1) x_i and (x^k)_ij = k x^(k−1) x_ij + k (k − 1) x^(k−2) x_i x_j
        terms = k * x ** (k - 1) * self.terms
        terms[0] = x**k
        products = self.first[pairs.i] * self.first[pairs.j]
        terms[1 + d :] += k * (k - 1) * x ** (k - 2) * products
        return Jet(terms, d)


class _Pairs(NamedTuple):
    """Pairs i ≤ j of d parameters, in the order of a jet's second derivatives.

    `i` and `j` have shape (d (d + 1)/2,); `place` says where the pair (i, j) or (j, i) stands among
    them, shape (d, d).
    """

    i: Array
    j: Array
    place: Array


@cache
def _pairs(d: int) -> _Pairs:
    """Return the pairs of d parameters."""
    i, j = np.triu_indices(d)
    place = np.zeros((d, d), int)
    place[i, j] = np.arange(len(i))
    place[j, i] = np.arange(len(i))
    return _Pairs(i, j, place)


def _padded(a: Jet, ndim: int) -> Jet:
    """Return a jet whose V has at least `ndim` axes, new ones of length 1 on the left."""
    missing = ndim - (a.terms.ndim - 1)
    if missing <= 0:
        return a
    return a[(None,) * missing]


def _matched(a: Jet, other: Jet | ArrayLike) -> tuple[Jet, Jet]:
    """Return both operands as jets whose V have equally many axes."""
    b = other
    if not isinstance(b, Jet):
        b = a.like(b)
    return _padded(a, b.terms.ndim - 1), _padded(b, a.terms.ndim - 1)


def _product(a: Jet, b: Jet, bilinear: Callable[[Array, Array], Array]) -> Jet:
    """Return the product a b of two jets, elementwise or of matrices.

    Its derivatives follow Leibniz' rule: (a b)_i = a_i b + a b_i and (a b)_ij = a_ij b + a_i b_j +
    a_j b_i + a b_ij.

    Args:
        a: Jet with derivatives by d parameters.
        b: Jet with derivatives by the same parameters, in the same order. Their values must fit one
            another as NumPy's arrays, with equally many axes.
        bilinear: `np.multiply` or `np.matmul`.

    Returns:
        A new jet; it shares no memory with the factors.
    """
    d = a.directions
    terms = np.asarray(bilinear(a.terms, b.value))
    # The first product is of all terms of a with the values of b, so that a_i b and a_ij b are
    # there. The rows of a jet's terms are the values, d first derivatives, and one row for each
    # pair i ≤ j.
    if d:  # operations on empty arrays take time, too
        pairs = _pairs(d)
        terms[1:] += bilinear(a.value, b.terms[1:])
        terms[1 + d :] += bilinear(a.first[pairs.i], b.first[pairs.j])
        terms[1 + d :] += bilinear(a.first[pairs.j], b.first[pairs.i])
    return Jet(terms, d)


def variables(points: Array, names: Sequence[str], selected: Sequence[str]) -> dict[str, Jet]:
    """Return the variables as jets, values with derivatives, for differentiation of functions.

    Args:
        points: Values of all variables at S points, shape (S, variables).
        names: Names of the variables, in the order of the columns of `points`.
        selected: Names of those to differentiate by; their order is that of the derivatives.

    Returns:
        A jet of shape (S,) for each name. Its derivative by itself is 1 if it is selected; all
        others are 0.

    Raises:
        ValueError: A selected name is not among the names.
    """
    jets = Jet.constant(points, len(selected))
    for k, name in enumerate(selected):
        jets.first[k, :, names.index(name)] = 1.0
    return {name: jets[:, column] for column, name in enumerate(names)}


def inverse(a: Jet) -> Jet:
    """Return the inverses X of square matrices A, with their derivatives.

    They are X_i = −X A_i X and X_ij = −X A_ij X − X A_i X_j − X A_j X_i.

    Args:
        a: The matrices with their derivatives by d parameters, shape (…, n, n).

    Raises:
        numpy.linalg.LinAlgError: A matrix is singular.
    """
    x = np.linalg.inv(a.value)
    d = a.directions
    pairs = _pairs(d)
    scaled = x @ a.terms[1:]  # X A_i, then X A_ij
    terms = np.concatenate([x[None], -scaled @ x])
    first = terms[1 : 1 + d]
    mixed_products = scaled[pairs.i] @ first[pairs.j] + scaled[pairs.j] @ first[pairs.i]
    terms[1 + d :] -= mixed_products
    return Jet(terms, d)


def concatenate(jets: Sequence[Jet], axis: int) -> Jet:
    """Return jets joined along an axis of V, counted from the last one (negative)."""
    return Jet(np.concatenate([jet.terms for jet in jets], axis), jets[0].directions)
