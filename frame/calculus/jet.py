"""Truncated Taylor polynomials of degree 2: first and second derivatives of a model.

A jet is a value with its first and second derivatives with respect to d parameters. With d = 0 it
is a plain array that costs nothing more, so the same code computes values alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Jet:
    """Value of shape V with derivatives along d parameters; broadcasts over V."""

    value: Array  # V
    first: Array  # first derivatives, (d, *V)
    second: Array  # second derivatives, (d, d, *V), symmetric in the first two axes

    __array_ufunc__ = None  # an array on the left leaves the operation to the jet

    @classmethod
    def constant(cls, value: ArrayLike, directions: int) -> Jet:
        """A jet without dependence on any of `directions` parameters."""
        array, d = np.asarray(value, float), directions
        return cls(array, np.zeros((d, *array.shape)), np.zeros((d, d, *array.shape)))

    def like(self, value: ArrayLike) -> Jet:
        """A constant with as many derivatives as this jet."""
        return Jet.constant(value, self.directions)

    @property
    def directions(self) -> int:
        """Number of parameters d."""
        return self.first.shape[0]

    def __getitem__(self, index: Any) -> Jet:
        key = index if isinstance(index, tuple) else (index,)
        return Jet(
            self.value[key],
            self.first[(slice(None), *key)],
            self.second[(slice(None), slice(None), *key)],
        )

    @staticmethod
    def stack(jets: Sequence[Jet]) -> Jet:
        """Joins jets along a new last axis of V."""
        return concatenate([x[..., None] for x in jets], -1)

    def contract(self, arrays: Array) -> Jet:
        """Sum of jets shape (…, e) times arrays of numbers (e, …)."""
        return self.map(lambda x: np.asarray(np.tensordot(x, arrays, 1)))

    def map(self, linear: Callable[[Array], Array]) -> Jet:
        """Linear map of value and derivatives, given as a function of arrays."""
        return Jet(linear(self.value), linear(self.first), linear(self.second))

    def __neg__(self) -> Jet:
        return Jet(-self.value, -self.first, -self.second)

    def __add__(self, other: Jet | ArrayLike) -> Jet:
        a, b = _matched(self, self._lift(other))
        return Jet(a.value + b.value, a.first + b.first, a.second + b.second)

    __radd__ = __add__

    def __sub__(self, other: Jet | ArrayLike) -> Jet:
        return self + (-self._lift(other))

    def __rsub__(self, other: Jet | ArrayLike) -> Jet:
        return self._lift(other) + (-self)

    def __mul__(self, other: Jet | ArrayLike) -> Jet:
        if not isinstance(other, Jet):
            factor = np.asarray(other, float)
            return _padded(self, factor.ndim).map(lambda x: x * factor)
        return _product(*_matched(self, other), np.multiply)

    __rmul__ = __mul__

    def __matmul__(self, other: Jet | Array) -> Jet:
        if not isinstance(other, Jet):
            return self.map(lambda x: x @ other)
        return _product(self, other, np.matmul)

    def __rmatmul__(self, other: Array) -> Jet:
        return self.map(lambda x: other @ x)

    def __truediv__(self, other: Jet | ArrayLike) -> Jet:
        return self * (other**-1 if isinstance(other, Jet) else 1 / np.asarray(other, float))

    def __rtruediv__(self, other: ArrayLike) -> Jet:
        return self**-1 * other

    def __pow__(self, exponent: float) -> Jet:
        """Real power, with derivatives by the chain rule."""
        if exponent == 2:
            return self * self
        x, k = self.value, exponent
        value, slope = x**k, k * x ** (k - 1)
        bend = k * (k - 1) * x ** (k - 2) * (self.first[:, None] * self.first)
        return Jet(value, slope * self.first, slope * self.second + bend)

    def _lift(self, other: Jet | ArrayLike) -> Jet:
        return other if isinstance(other, Jet) else self.like(other)


def _padded(a: Jet, ndim: int) -> Jet:
    """`a` with V extended on the left by axes of length 1 up to `ndim` axes."""
    missing = ndim - a.value.ndim
    if missing <= 0:
        return a
    padding, shape = (1,) * missing, a.value.shape
    return Jet(
        a.value.reshape(padding + shape),
        a.first.reshape((a.directions, *padding, *shape)),
        a.second.reshape((a.directions, a.directions, *padding, *shape)),
    )


def _matched(a: Jet, b: Jet) -> tuple[Jet, Jet]:
    return _padded(a, b.value.ndim), _padded(b, a.value.ndim)


def _product(a: Jet, b: Jet, bilinear: Callable[[Array, Array], Array]) -> Jet:
    """Product of two jets by `np.multiply` or `np.matmul`, with derivatives by Leibniz' rule."""
    value = bilinear(a.value, b.value)
    if not a.directions:  # operations on empty arrays take time, too
        return Jet(value, np.zeros((0, *value.shape)), np.zeros((0, 0, *value.shape)))
    first = bilinear(a.first, b.value) + bilinear(a.value, b.first)
    cross = bilinear(a.first[:, None], b.first[None, :])
    second = bilinear(a.second, b.value) + bilinear(a.value, b.second)
    return Jet(value, first, second + cross + cross.swapaxes(0, 1))


def variables(points: Array, names: Sequence[str], selected: Sequence[str]) -> dict[str, Jet]:
    """Jets of the independent variables by name, each of shape (S,), with slope 1 by itself.

    `points` (S, len(names)) are their values, `selected` the names to differentiate by, in the
    order of the derivatives.
    """
    jets = {name: Jet.constant(points[:, i], len(selected)) for i, name in enumerate(names)}
    for k, name in enumerate(selected):
        jets[name].first[k] = 1.0
    return jets


def inverse(a: Jet) -> Jet:
    """Inverse of square matrices, shape (..., n, n), by one factorisation."""
    x = np.linalg.inv(a.value)
    first = -x @ a.first @ x
    cross = -x @ a.first[:, None] @ first[None, :]
    return Jet(x, first, -x @ a.second @ x + cross + cross.swapaxes(0, 1))


def concatenate(parts: Sequence[Jet], axis: int) -> Jet:
    """Joins jets along a negative `axis` of V."""
    return Jet(
        *(
            np.concatenate([getattr(p, part) for p in parts], axis)
            for part in ("value", "first", "second")
        )
    )
