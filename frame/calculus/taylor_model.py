"""Taylor models: polynomials over the unit box with a proved bound of all that they leave out.

A Taylor model stands for functions f(u) of inputs u in [−1, 1]^d: |f(u) − p(u)| ≤ remainder for all
u of the box, p a polynomial (Makino, Berz 2003). Sums, products, powers and solutions of linear
systems of Taylor models are Taylor models. What a product has above the order kept is bounded by
the sums of magnitudes of its factors' coefficients, a power's by the derivative of the next order.
So is the rounding of the coefficients, by γ_n of the operations that make them (Higham 2002,
section 3.1).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations_with_replacement
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array, Ints
from alphacut.frame.calculus.monomials import (
    convolve,
    count,
    derivative,
    exponents,
    matmul,
    monomial_values,
    monomials,
    places,
    product_part,
)
from alphacut.frame.calculus.rounding import UNIT_ROUNDOFF, gamma
from alphacut.frame.calculus.unproved import UnprovedError

ORDER = 3
"""Order of a Taylor model unless another is given."""
COMPLEX = 2
"""Roundings of a product of complex numbers beyond one: √2 γ_2 ≤ γ_3 (Higham 2002, lemma 3.5)."""


@dataclass(frozen=True, eq=False)
class TaylorModel:
    """Functions of the unit box, an array of shape V of them."""

    __array_ufunc__ = None  # an array on the left leaves the operation to the model

    # coefficients of degree 0, 1, …, (monomials, *V), real or complex; missing ones are zero
    parts: tuple[Array, ...]
    remainder: Array  # bound of what they leave out and of their rounding, V, never negative
    inputs: int  # number of inputs d
    order: int = ORDER  # degree to which products are kept

    @classmethod
    def constant(cls, value: ArrayLike, inputs: int, order: int = ORDER) -> TaylorModel:
        """Functions without dependence on the inputs, values of shape V."""
        array = _numbers(value)
        return cls((array[None],), np.zeros(array.shape), inputs, order)

    @classmethod
    def variables(cls, centre: Array, radius: Array, order: int = ORDER) -> TaylorModel:
        """The inputs themselves, centre + radius u, shape (d,), with the rounding of both."""
        parts = np.asarray(centre, float)[None], np.diag(np.asarray(radius, float))
        return cls(parts, gamma(2) * (np.abs(centre) + radius), len(centre), order)

    def like(self, value: ArrayLike) -> TaylorModel:
        """A constant of the same inputs and order."""
        return TaylorModel.constant(value, self.inputs, self.order)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape V."""
        return self.remainder.shape

    @property
    def value(self) -> Array:
        """Values of the polynomials in the middle of the box, shape V."""
        return np.asarray(self.parts[0][0])

    @property
    def T(self) -> TaylorModel:  # noqa: N802
        """Transposed matrices, shape (m, n) for (n, m)."""
        parts = tuple(part.swapaxes(-1, -2) for part in self.parts)
        return replace(self, parts=parts, remainder=self.remainder.swapaxes(-1, -2))

    @staticmethod
    def stack(models: Sequence[TaylorModel]) -> TaylorModel:
        """Joins Taylor models along a new last axis of V."""
        return concatenate([x[..., None] for x in models], -1)

    def homogeneous_part(self, degree: int) -> Array:
        """Coefficients of one degree, shape (monomials, *V)."""
        if degree < len(self.parts):
            return self.parts[degree]
        return np.zeros((count(self.inputs, degree), *self.shape), self.parts[0].dtype)

    def part_magnitudes(self) -> list[Array]:
        """Bounds of the parts over the box, each of shape V."""
        of_sums = len(self.parts) + 4
        return [np.abs(part).sum(0) * (1 + gamma(len(part) + of_sums)) for part in self.parts]

    def magnitude(self) -> Array:
        """Bound of |f| over the box, shape V."""
        return np.asarray(sum(self.part_magnitudes()) + self.remainder)

    def deviation(self) -> Array:
        """Bound of |f − value|, shape V."""
        return np.asarray(sum(self.part_magnitudes()[1:]) + self.remainder)

    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper bounds over the box, each of shape V."""
        reach = self.deviation() * (1 + gamma(2)) + UNIT_ROUNDOFF * np.abs(self.value)
        return self.value - reach, self.value + reach

    def widened(self, more: ArrayLike) -> TaylorModel:
        """Functions that may be off by `more`, shape V."""
        return replace(self, remainder=self.remainder + np.asarray(more))

    @cached_property
    def coefficients(self) -> Array:
        """Coefficients of all monomials by degree, as they stand in `monomial_values`."""
        return np.concatenate(self.parts)

    @property
    def exponents(self) -> Ints:
        """Exponents of these monomials, shape (terms, d)."""
        return np.concatenate([exponents(self.inputs, k) for k in range(len(self.parts))])

    def at(self, u: Array) -> Array:
        """The polynomials' values at points u (S, d), shape (S, *V)."""
        powers = monomial_values(u, len(self.parts) - 1)
        flat = self.coefficients.reshape(powers.shape[1], -1)
        return _real_times(powers, flat).reshape(len(u), *self.shape)

    def jets(self, u: Array) -> Array:
        """Values, gradients and Hessians' upper triangles of K functions at points u (S, d).

        Shape (S, q, K) with q = 1 + d + d (d + 1)/2.
        """
        powers = monomial_values(u, len(self.parts) - 1)
        tables = [_real_times(powers[:, : len(x)], x) for x in self._derivative_tables]
        return np.hstack(tables).reshape(len(u), -1, *self.shape)

    @cached_property
    def _derivative_tables(self) -> list[Array]:
        """Coefficients of all values, first and second derivatives, shapes (terms, functions)."""
        axes = np.eye(self.inputs)
        by_axes: dict[tuple[int, ...], Sequence[Array]] = {(): self.parts}
        tables = [self.coefficients]
        for order in (1, 2):
            derivatives = []
            for chosen in combinations_with_replacement(range(self.inputs), order):
                lower = enumerate(by_axes[chosen[:-1]][1:], 1)
                parts = [derivative(part, degree, axes[chosen[-1]]) for degree, part in lower]
                by_axes[chosen] = parts or [0 * self.parts[0]]
                derivatives.append(np.concatenate(by_axes[chosen]))
            tables.append(np.hstack(derivatives))
        return tables

    def active_inputs(self) -> Ints:
        """Inputs that the functions depend on."""
        found = np.zeros(self.inputs, bool)
        for degree, part in enumerate(self.parts[1:], 1):
            some = part.reshape(len(part), -1).any(1)
            found[monomials(self.inputs, degree)[some]] = True
        return np.flatnonzero(found)

    def restricted_to(self, inputs: Ints) -> TaylorModel:
        """The model as functions of the inputs at `inputs` (d,) alone; it depends on no others."""
        d = len(inputs)
        lists = (inputs[monomials(d, degree)] for degree in range(len(self.parts)))
        rows = [places(chosen, self.inputs) for chosen in lists]
        parts = tuple(part[at] for part, at in zip(self.parts, rows, strict=True))
        return TaylorModel(parts, self.remainder, d, self.order)

    def embedded(self, inputs: Ints, d: int) -> TaylorModel:
        """The same functions as functions of d inputs, of which theirs are at `inputs`, rising.

        Functions of d inputs stay as they are.
        """
        if self.inputs == d:
            return self
        parts = []
        for degree, part in enumerate(self.parts):
            full = np.zeros((count(d, degree), *self.shape))
            full[places(inputs[monomials(self.inputs, degree)], d)] = part
            parts.append(full)
        return TaylorModel(tuple(parts), self.remainder, d, self.order)

    @property
    def real(self) -> TaylorModel:
        """Real parts."""
        return replace(self, parts=tuple(part.real for part in self.parts))

    @property
    def imag(self) -> TaylorModel:
        """Imaginary parts."""
        return replace(self, parts=tuple(part.imag for part in self.parts))

    @property
    def polynomial(self) -> TaylorModel:
        """The polynomials alone, functions that have no remainder."""
        return replace(self, remainder=np.zeros(self.shape))

    def truncated(self, order: int) -> TaylorModel:
        """The same, whose products are kept to `order`; sizes of higher parts go into the rest."""
        remainder = np.asarray(self.remainder + sum(self.part_magnitudes()[order + 1 :]))
        return TaylorModel(self.parts[: order + 1], remainder, self.inputs, order)

    def on_subbox(self, low: Array, high: Array) -> TaylorModel:
        """The model over the part low ≤ u ≤ high, (d,) each, in unit coordinates of the part."""
        middle, half = (low + high) / 2, (high - low) / 2
        shifted = [np.zeros_like(part) for part in self.parts]  # of p(middle + v)
        for degree, part in enumerate(self.parts):
            term = part  # (middle·∇)^k p / k!
            for k in range(degree + 1):
                shifted[degree - k] = shifted[degree - k] + term
                if k < degree:
                    term = derivative(term, degree - k, middle) / (k + 1)
        parts = []
        for degree, part in enumerate(shifted):
            scale = half[monomials(self.inputs, degree)].prod(-1)
            parts.append(scale.reshape(-1, *[1] * self.remainder.ndim) * part)
        # sums of d terms, once for each derivative, of |middle| + half ≤ 1
        rounding = gamma((len(self.parts) + 1) * (self.inputs + 4)) * np.sum(
            self.part_magnitudes(), 0
        )
        return TaylorModel(tuple(parts), self.remainder + rounding, self.inputs, self.order)

    def reshaped(self, *shape: int) -> TaylorModel:
        """The same functions in another shape V."""
        parts = tuple(part.reshape(len(part), *shape) for part in self.parts)
        return replace(self, parts=parts, remainder=self.remainder.reshape(shape))

    def __getitem__(self, index: Any) -> TaylorModel:
        key = index if isinstance(index, tuple) else (index,)
        parts = tuple(part[(slice(None), *key)] for part in self.parts)
        return replace(self, parts=parts, remainder=self.remainder[key])

    def __add__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        """Sum entry by entry, with its rounding in the remainder."""
        b = other if isinstance(other, TaylorModel) else self.like(_numbers(other))
        degrees, n = range(max(len(self.parts), len(b.parts))), max(len(self.shape), len(b.shape))
        parts = tuple(
            _padded(self.homogeneous_part(k), n) + _padded(b.homogeneous_part(k), n)
            for k in degrees
        )
        remainder, order = self.remainder + b.remainder, max(self.order, b.order)
        return TaylorModel(parts, remainder, self.inputs, order).with_rounding(1)

    __radd__ = __add__

    def __neg__(self) -> TaylorModel:
        return replace(self, parts=tuple(-part for part in self.parts))

    def __sub__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        return self + -(other if isinstance(other, TaylorModel) else _numbers(other))

    def __rsub__(self, other: ArrayLike) -> TaylorModel:
        return -self + other

    def __mul__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        """Product entry by entry; a constant scales the parts and the remainder."""
        if isinstance(other, TaylorModel):
            return _product(self, other, np.multiply)
        factor = _numbers(other)
        parts = tuple(_padded(part, factor.ndim) * factor for part in self.parts)
        remainder = self.remainder * np.abs(factor)
        return TaylorModel(parts, remainder, self.inputs, self.order).with_rounding(1 + COMPLEX)

    __rmul__ = __mul__

    def __matmul__(self, other: TaylorModel | Array) -> TaylorModel:
        if isinstance(other, TaylorModel):
            return _product(self, other, matmul)
        return self._linear(np.matmul, _numbers(other), self.shape[-1])

    def __rmatmul__(self, other: Array) -> TaylorModel:
        factor = _numbers(other)
        return self._linear(lambda x, y: np.matmul(y, x), factor, factor.shape[-1])

    def __truediv__(self, other: TaylorModel | ArrayLike) -> TaylorModel:
        return self * (other**-1.0 if isinstance(other, TaylorModel) else 1.0 / _numbers(other))

    def __rtruediv__(self, other: ArrayLike) -> TaylorModel:
        return self**-1.0 * other

    def __pow__(self, exponent: float) -> TaylorModel:
        """Real power of positive functions f, by the Taylor series in f − value to the order kept.

        The remainder has the rounding of the series and Lagrange's bound of what it leaves out.

        Raises:
            UnprovedError: A function is not known to be positive.
        """
        middle, spread, N = self.value, self.deviation(), self.order
        least = middle - spread
        if not (least > 0).all():
            raise UnprovedError(
                "a quantity that must be positive is not known to be so over the box",
                "take narrower inputs",
            )
        step, factor = self - middle, 1.0
        out, term = self.like(middle**exponent), self.like(np.ones_like(middle))
        rounding = gamma(4) * middle**exponent
        for k in range(1, N + 1):
            factor = factor * (exponent - k + 1) / k
            term = term * step
            scale = factor * middle ** (exponent - k)
            out = out + term * scale
            rounding = rounding + gamma(4 * k + 4) * np.abs(scale) * term.magnitude()
        next_factor, power = abs(factor * (exponent - N) / (N + 1)), exponent - N - 1
        largest_power = np.maximum(least**power, (middle + spread) ** power)
        truncation = next_factor * largest_power * spread ** (N + 1) * (1 + gamma(8 * N + 8))
        return out.widened(rounding + truncation)

    def contract(self, arrays: Array) -> TaylorModel:
        """Sum of functions shape (…, e) times arrays of numbers (e, …)."""
        factor = _numbers(arrays)
        return self._linear(lambda x, y: np.asarray(np.tensordot(x, y, 1)), factor, len(factor))

    def with_rounding(self, count: int) -> TaylorModel:
        """The same after `count` roundings of coefficients and rest, whose sums did not cancel."""
        return self.widened(
            gamma(count) * np.sum(self.part_magnitudes(), 0) + gamma(count + 3) * self.remainder
        )

    def _linear(
        self, bilinear: Callable[[Array, Array], Array], factor: Array, terms: int
    ) -> TaylorModel:
        """Product with numbers, each entry a sum of `terms`, with its rounding in the remainder."""
        remainder = np.asarray(bilinear(self.remainder, np.abs(factor))) * (1 + gamma(terms + 2))
        rounding = gamma(terms + COMPLEX) * bilinear(
            np.sum(self.part_magnitudes(), 0), np.abs(factor)
        )
        parts = tuple(np.asarray(bilinear(part, factor)) for part in self.parts)
        return TaylorModel(parts, remainder + rounding, self.inputs, self.order)


def concatenate(models: Sequence[TaylorModel], axis: int) -> TaylorModel:
    """Joins Taylor models along a negative `axis` of V."""
    degrees = range(max(len(x.parts) for x in models))
    parts = tuple(np.concatenate([x.homogeneous_part(k) for x in models], axis) for k in degrees)
    remainder = np.concatenate([x.remainder for x in models], axis)
    return TaylorModel(parts, remainder, models[0].inputs, max(x.order for x in models))


def all_on_subbox(models: Sequence[TaylorModel], low: Array, high: Array) -> list[TaylorModel]:
    """Each model over the part low ≤ u ≤ high, in the part's unit coordinates, as by `within`.

    All are restricted together, as one array of functions.
    """
    restricted = concatenate([x.reshaped(-1) for x in models], -1).on_subbox(low, high)
    end, found = 0, list[TaylorModel]()
    for x in models:
        begin, end = end, end + x.remainder.size
        found.append(replace(restricted[begin:end].reshaped(*x.shape), order=x.order))
    return found


def inverse_bound(matrix: TaylorModel) -> Array | None:
    """Bound of |A⁻¹| over the box, entry by entry, by Neumann's series, shape (n, n).

    It is None where the series diverges, or may. Of a matrix that is diagonal in the middle it is
    the inverse of Ostrowski's comparison matrix (1937).
    """
    C, n = np.linalg.inv(matrix.value), len(matrix.value)
    in_middle = np.abs(np.eye(n) - C @ matrix.value)
    in_middle += gamma(n + 1) * (np.abs(C) @ np.abs(matrix.value))
    ratio = np.abs(C) @ matrix.deviation() + in_middle  # bounds |I − C A|
    # with (I − |I − C A|)⁻¹ ≥ 0 the spectral radius of a matrix of positive entries is below 1
    inverse = np.linalg.inv(np.eye(n) - ratio) * (1 + gamma(8 * n * n))
    if not ((inverse >= 0).all() and np.abs(np.linalg.eigvals(ratio)).max(initial=0.0) < 1):
        return None
    return np.asarray(inverse @ np.abs(C))


def solution_series(matrix: TaylorModel, right: TaylorModel) -> TaylorModel:
    """Polynomials Y, degree by degree, of A Y ≈ B for A (n, n) and B (n, m); without remainders."""
    d, order = matrix.inputs, max(matrix.order, right.order) if matrix.inputs else 0
    middle_inverse = np.linalg.inv(matrix.value)
    parts = [middle_inverse @ right.homogeneous_part(0)]
    for degree in range(1, order + 1):
        lower_degrees = product_part(matrix.parts, parts, degree, d, matmul)
        parts.append(middle_inverse @ (right.homogeneous_part(degree) - lower_degrees))
    return TaylorModel(tuple(parts), np.zeros(right.shape), d, order)


def solve(matrix: TaylorModel, right: TaylorModel) -> TaylorModel:
    """Taylor model of the solution Y of A Y = B, for A (n, n) and B (n, m).

    Raises:
        UnprovedError: A may be singular.
    """
    middle_inverse: Any = np.linalg.inv(matrix.value)
    matrix, right = middle_inverse @ matrix, middle_inverse @ right
    found, bound = solution_series(matrix, right), inverse_bound(matrix)
    if bound is None:
        raise UnprovedError("a matrix may be singular in the box", "take narrower inputs")
    return found.widened(bound @ (matrix @ found - right).magnitude())


def _numbers(value: ArrayLike) -> Array:
    array = np.asarray(value)
    return array if np.iscomplexobj(array) else np.asarray(array, float)


def _real_times(real: Array, coefficients: Array) -> Array:
    """Product real @ coefficients (terms, K), in which `real` is not made complex."""
    if not np.iscomplexobj(coefficients):
        return np.asarray(real @ coefficients)
    of_both_parts = np.ascontiguousarray(coefficients).view(float)
    return np.asarray((real @ of_both_parts).view(complex))


def _padded(part: Array, ndim: int) -> Array:
    """A part with V extended on the left by axes of length 1 up to `ndim` axes."""
    missing = ndim - (part.ndim - 1)
    return part.reshape(len(part), *[1] * max(missing, 0), *part.shape[1:])


def _product(
    a: TaylorModel, b: TaylorModel, bilinear: Callable[[Array, Array], Array]
) -> TaylorModel:
    """Product a b by `bilinear` (elementwise or matrix), kept to the higher order of both."""
    d, order, ndim = a.inputs, max(a.order, b.order), max(a.remainder.ndim, b.remainder.ndim)
    a_sizes, b_sizes = a.part_magnitudes(), b.part_magnitudes()
    remainder = bilinear(a.remainder, np.asarray(sum(b_sizes)) + b.remainder)
    remainder = remainder + bilinear(np.asarray(sum(a_sizes)), b.remainder)
    degrees = range(min(order, len(a_sizes) + len(b_sizes) - 2) + 1)
    kind = np.result_type(a.parts[0], b.parts[0])
    parts = [np.zeros((count(d, k), *remainder.shape), kind) for k in degrees]
    inner = a.shape[-1] if bilinear == matmul else 1
    for i, x in enumerate(a.parts):
        for j, y in enumerate(b.parts):
            omitted = 1.0  # fraction of the parts' product that the polynomial leaves out
            if i + j <= order:
                parts[i + j] += convolve(_padded(x, ndim), _padded(y, ndim), (i, j), d, bilinear)
                # rounding of sums over all ways to split a monomial into factors of degree i and j
                omitted = gamma(inner * comb(i + j, i) + i + j + 1 + COMPLEX)
            remainder = remainder + omitted * bilinear(a_sizes[i], b_sizes[j])
    remainder = remainder * (1 + gamma(inner + (order + 1) ** 2))
    return TaylorModel(tuple(parts), np.asarray(remainder), d, order)
