"""Jets, which are truncated Taylor polynomials of degree 2, and products of polynomials.

A jet is a value with its first and second derivatives with respect to d parameters. With d = 0 it
is a plain array that costs nothing more, so the same code computes values alone.

Polynomials of any degree are kept by their homogeneous parts. A monomial u_i u_j … of degree m is
written as the rising list (i, j, …) of the m indices of its variables. All monomials of one degree
are ordered by the combinatorial number system: the place of (i_0, …, i_(m−1)) is Σ_k binomial(i_k +
k, k + 1). A homogeneous polynomial is an array of coefficients whose first axis runs over the
monomials in this order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from math import comb
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from alphacut.base.arrays import Ints
from alphacut.base.kernels import compiled

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


@cache
def count(d: int, degree: int) -> int:
    """Return the number of monomials of one degree in d variables."""
    if d == 0:
        return int(degree == 0)
    return comb(d + degree - 1, degree)


def zero_part(d: int, degree: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Array:
    """Return the coefficients of a zero polynomial of one degree, shape (monomials, *shape)."""
    return np.zeros((count(d, degree), *shape), dtype)


@cache
def monomials(d: int, degree: int) -> Ints:
    """Return all monomials of one degree, in order, as rising lists: shape (monomials, degree)."""
    lists = list(combinations_with_replacement(range(d), degree))
    rows = np.array(lists, np.int64).reshape(len(lists), degree)
    return rows[np.argsort(places(rows, d))]


@cache
def _place_terms(d: int, degree: int) -> Ints:
    """Return binomial(i + k, k + 1) for variables i and k = 0 … degree − 1, shape (d, degree)."""
    terms = np.zeros((d, degree), np.int64)
    for i in range(d):
        for k in range(degree):
            terms[i, k] = comb(i + k, k + 1)
    return terms


def places(lists: Ints, d: int) -> Ints:
    """Return the places of monomials among all of their degree in d variables.

    The place of u_i u_j u_k … with i ≤ j ≤ k ≤ … is binomial(i, 1) + binomial(j + 1, 2) +
    binomial(k + 2, 3) + …, which numbers all monomials of a degree from 0 on without gaps
    (combinatorial number system).

    Args:
        lists: Rising lists of the indices of the variables, one monomial in each row, shape (N,
            degree).
        d: Number of variables; indices are below it.

    Returns:
        Shape (N,); zeros for the degree 0, which has one monomial.
    """
    degree = lists.shape[1]
    if degree == 0:
        return np.zeros(len(lists), np.int64)
    return np.asarray(_place_terms(d, degree)[lists, np.arange(degree)].sum(1))


@cache
def product_places(d: int, m: int, q: int) -> Ints:
    """Return the places of the products of each monomial of degree m with each of degree q.

    Monomials of a degree in d variables have the order of `monomials(d, degree)`, and a place is
    the index in this order. Results are cached; callers must not change them.

    Returns:
        Array of shape (monomials of degree m, monomials of degree q): the place, among those of
        degree m + q, of the product of the monomials in the places of row and column.
    """
    a = monomials(d, m)
    b = monomials(d, q)
    first_factors = np.repeat(a, len(b), axis=0)
    second_factors = np.tile(b, (len(a), 1))
    # The list of a product is both lists together, sorted.
    products = np.sort(np.concatenate([first_factors, second_factors], axis=1), axis=1)
    return places(products, d).reshape(len(a), len(b))


@cache
def exponents(d: int, degree: int) -> Ints:
    """Return the exponent of each variable in each monomial, shape (monomials, d)."""
    lists = monomials(d, degree)
    return np.asarray((lists[:, :, None] == np.arange(d)).sum(1))


@cache
def _last_factors(d: int, degree: int) -> tuple[Ints, Ints]:
    """Return the last variable of each monomial, and the place of the product of all others.

    Both have shape (monomials,); the place is among the monomials of one degree less.
    """
    lists = monomials(d, degree)
    return lists[:, -1], places(lists[:, :-1], d)


def monomial_values(u: Array, degree: int) -> Array:
    """Return the values of all monomials of degrees 0 … `degree` in d variables at points.

    Args:
        u: Points, shape (S, d).
        degree: Highest degree, not negative.

    Returns:
        Shape (S, terms): the constant 1, then the monomials of degree 1, and so on, those of each
        degree in the order of `monomials(d, degree)`. It is a view of an array whose rows are the
        monomials.
    """
    d = u.shape[1]
    coordinates = np.ascontiguousarray(u.T)
    values: Array = np.ones((comb(d + degree, degree), len(u)))
    first_of_lower_degree = 0
    begin = 1
    for m in range(1, degree + 1):
        variable, other_factors = _last_factors(d, m)
        end = begin + len(variable)
        # A monomial is its last variable times a monomial of one degree less.
        lower = values[first_of_lower_degree + other_factors]
        values[begin:end] = lower * coordinates[variable]
        first_of_lower_degree = begin
        begin = end
    return values.T


def convolve(
    a: Array, b: Array, degrees: tuple[int, int], d: int, bilinear: Callable[[Array, Array], Array]
) -> Array:
    """Return the product of two homogeneous polynomials in d variables.

    A homogeneous polynomial is an array of coefficients, whose first axis runs over the monomials
    of its degree in the order of `monomials(d, degree)`; a coefficient is an array itself.

    Args:
        a: Coefficients of the first one, shape (monomials, *shape of a coefficient); there is at
            least one monomial.
        b: Coefficients of the second one. Coefficients of both have equally many axes.
        degrees: Degrees of both.
        d: Number of variables.
        bilinear: Product of coefficients, `np.multiply` or `matmul` of this module, which
            broadcasts over the first axes.

    Returns:
        Coefficients of the product, whose degree is the sum of both: a new array, complex if a or b
        is.
    """
    # Multiplications up to which compiled loops over all pairs of monomials are faster than one
    # product of arrays for each coefficient of the shorter factor. It is tuned: beyond it NumPy's
    # matrix products win over loops.
    few_multiplications = 300_000

    at = product_places(d, degrees[0], degrees[1])
    shape = bilinear(a[0], b[0]).shape
    out = zero_part(d, sum(degrees), shape, np.result_type(a, b))
    inner = 1
    if bilinear == matmul:
        inner = a.shape[-1]
    if max(len(a), len(b)) * out[0].size * inner <= few_multiplications:
        if bilinear == matmul and a.ndim == b.ndim == 3:
            _add_by_parts(_add_matrix_products, a, b, at, out)
            return out
        if bilinear == np.multiply:
            flat = out.reshape(len(out), -1)
            _add_by_parts(_add_products, _rows(a, shape), _rows(b, shape), at, flat)
            return out
    # Each coefficient of the shorter factor is multiplied by all of the longer one. Their products
    # have different places, since x y = x z only if y = z: so the sum by indices misses none.
    if len(a) <= len(b):
        for x in np.flatnonzero(a.reshape(len(a), -1).any(1)):
            out[at[x]] += bilinear(a[x][None], b)
    else:
        for y in np.flatnonzero(b.reshape(len(b), -1).any(1)):
            out[at[:, y]] += bilinear(a, b[y][None])
    return out


def _add_by_parts(
    add: Callable[[Array, Array, Ints, Array], None], a: Array, b: Array, at: Ints, out: Array
) -> None:
    """Add products by a kernel of real numbers, once for each pair of real and imaginary parts.

    So one kernel is compiled, where another one of complex numbers would take as long again.

    Args:
        add: `_add_products` or `_add_matrix_products`.
        a: Coefficients of the first factor, real or complex.
        b: Those of the second one.
        at: Place of each product.
        out: Sums of products, complex if a or b is; changed.
    """
    if not np.iscomplexobj(out):
        add(_in_rows(a), _in_rows(b), at, out)
        return
    for i, x in enumerate((a.real, a.imag) if np.iscomplexobj(a) else (a,)):
        for j, y in enumerate((b.real, b.imag) if np.iscomplexobj(b) else (b,)):
            products = np.zeros(out.shape)
            add(_in_rows(x), _in_rows(y), at, products)
            np.add(out, 1j ** (i + j) * products, out=out)


def _in_rows(a: Array) -> Array:
    """Return an array, or a copy in C order if it is read-only or in another order.

    Numba would compile a kernel for each such kind.
    """
    return a if a.flags.writeable and a.flags.c_contiguous else a.copy()


def _rows(coefficients: Array, shape: tuple[int, ...]) -> Array:
    """Return coefficients, broadcast to a shape, as rows: shape (monomials, entries)."""
    rows = coefficients
    if coefficients.shape[1:] != shape:
        rows = np.empty((len(coefficients), *shape), coefficients.dtype)
        rows[...] = coefficients
    return rows.reshape(len(rows), -1)


def product_part(
    a: Sequence[Array],
    b: Sequence[Array],
    degree: int,
    d: int,
    bilinear: Callable[[Array, Array], Array],
    lowest: tuple[int, int] = (0, 0),
) -> Array:
    """Return the homogeneous part of one degree of the product of two polynomials.

    Args:
        a: Homogeneous parts of the first polynomial by degree, from 0, at least one; those of
            higher degrees are zero. A part has the shape (monomials of the degree, *shape of a
            coefficient), in the order of `monomials(d, degree)`.
        b: Those of the second one.
        degree: Degree of the part that is returned.
        d: Number of variables.
        bilinear: Product of coefficients, `np.multiply` or `matmul` of this module.
        lowest: Degrees of a and of b below which parts are taken as zero.

    Returns:
        Coefficients, shape (monomials of the degree, *shape of a product); zeros if no parts of a
        and b have this degree together.
    """
    shape = bilinear(a[0][0], b[0][0]).shape
    total = zero_part(d, degree, shape, np.result_type(a[0], b[0]))
    # k is the degree of the factor from b, and degree − k, that of the factor from a, must be
    # there.
    first = max(lowest[1], degree - len(a) + 1)
    last = min(degree - lowest[0], len(b) - 1)
    for k in range(first, last + 1):
        total += convolve(a[degree - k], b[k], (degree - k, k), d, bilinear)
    return total


@compiled
def _add_products(a: Array, b: Array, at: Ints, out: Array) -> None:
    """Add the elementwise products a[x] b[y] to out[at[x, y]] for all pairs of monomials x, y.

    a, b and out have the shape (monomials, v), each with its own number of monomials; `at`, of
    shape (monomials of a, monomials of b), has the place of each product in `out`.
    """
    for x in range(len(a)):
        if not a[x].any():
            continue
        for y in range(len(b)):
            p = at[x, y]
            for k in range(a.shape[1]):
                out[p, k] += a[x, k] * b[y, k]


@compiled
def _add_matrix_products(a: Array, b: Array, at: Ints, out: Array) -> None:
    """Add the matrix products a[x] @ b[y] to out[at[x, y]] for all pairs of monomials x, y.

    a, b and out have the shapes (monomials, p, q), (monomials, q, r) and (monomials, p, r), each
    with its own number of monomials; `at`, of shape (monomials of a, monomials of b), has the place
    of each product in `out`.
    """
    for x in range(len(a)):
        if not a[x].any():
            continue
        for y in range(len(b)):
            p = at[x, y]
            for i in range(a.shape[1]):
                for j in range(a.shape[2]):
                    factor = a[x, i, j]
                    for k in range(b.shape[2]):
                        out[p, i, k] += factor * b[y, j, k]


def matmul(a: Array, b: Array) -> Array:
    """Return products of matrices, as `numpy.matmul` does for stacks of them.

    Args:
        a: Matrices, shape (…, p, q).
        b: Matrices, shape (…, q, r), or one. A stack of one matrix alone, shape (1, q, r), is
            multiplied as one product of tall matrices, which is faster than many small ones.

    Returns:
        Products, shape (…, p, r).
    """
    if b.ndim == 3 and len(b) == 1 and a.ndim > 2:
        return np.asarray(np.tensordot(a, b[0], 1))
    return np.asarray(np.matmul(a, b))


def derivative(part: Array, degree: int, direction: Array) -> Array:
    """Return the derivative Σ_i direction_i ∂p/∂u_i of a homogeneous polynomial p in d variables.

    Args:
        part: Coefficients of p, shape (monomials, *shape of a coefficient), in the order of
            `monomials(d, degree)`.
        degree: Degree of p, at least 1.
        direction: Weight of each partial derivative, shape (d,).

    Returns:
        Coefficients of the derivative, whose degree is one less, in the order of its monomials.
    """
    d = len(direction)
    # a monomial b of the derivative by u_i comes from u_i b alone, times the exponent of u_i there
    with_variable = product_places(d, 1, degree - 1)
    exponent_before = exponents(d, degree - 1).T + 1
    weight = direction[:, None] * exponent_before
    return np.asarray(np.einsum("ib,ib...->b...", weight, part[with_variable]))
