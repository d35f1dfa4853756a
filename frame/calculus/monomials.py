"""Monomials of d variables and products of homogeneous polynomials.

A monomial u_i u_j … of degree m is written as the rising list (i, j, …) of the m indices of its
variables. All monomials of one degree are ordered by the combinatorial number system: the place of
(i_0, …, i_(m−1)) is Σ_k binomial(i_k + k, k + 1). A homogeneous polynomial is an array of
coefficients whose first axis runs over the monomials in this order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations_with_replacement
from math import comb
from typing import Any

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled


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
