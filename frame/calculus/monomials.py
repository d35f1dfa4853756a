"""Monomials of d variables: their places among all of one degree, and products of polynomials.

A monomial u_i u_j … of degree m is a rising list of m variables; its place among all of that
degree is Σ_k C(i_k + k, k + 1), k = 0 … m − 1 (the combinatorial number system). A homogeneous
polynomial is an array whose first axis runs over the monomials.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations_with_replacement
from math import comb

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled

SMALL = 300_000
"""Multiplications by one coefficient up to which a loop over all pairs is faster than products of
arrays, one for each coefficient."""


def count(d: int, degree: int) -> int:
    """Number of monomials of one degree."""
    return comb(d + degree - 1, degree) if d else int(degree == 0)


@cache
def monomials(d: int, degree: int) -> Ints:
    """All rising lists of `degree` out of d variables by place, shape (monomials, degree)."""
    lists = list(combinations_with_replacement(range(d), degree))
    rows = np.array(lists, np.int64).reshape(len(lists), degree)
    return rows[np.argsort(places(rows, d))]


@cache
def _binomials(d: int, degree: int) -> Ints:
    """C(i + k, k + 1) for variables i and k, shape (d, degree)."""
    return np.array([[comb(i + k, k + 1) for k in range(degree)] for i in range(d)], np.int64)


def places(lists: Ints, d: int) -> Ints:
    """Places of rising lists (N, m), shape (N,)."""
    degree = lists.shape[1]
    if degree == 0:
        return np.zeros(len(lists), np.int64)
    return np.asarray(_binomials(d, degree)[lists, np.arange(degree)].sum(1))


@cache
def product_places(d: int, m: int, q: int) -> Ints:
    """Places of the products of all monomials of degree m with all of degree q, shape (M, Q)."""
    a, b = monomials(d, m), monomials(d, q)
    pairs = np.concatenate([np.repeat(a, len(b), axis=0), np.tile(b, (len(a), 1))], axis=1)
    return places(np.sort(pairs, axis=1), d).reshape(len(a), len(b))


@cache
def exponents(d: int, degree: int) -> Ints:
    """How often each variable stands in each monomial, shape (monomials, d)."""
    lists = monomials(d, degree)
    return np.asarray((lists[:, :, None] == np.arange(d)).sum(1))


@cache
def _last_factors(d: int, degree: int) -> tuple[Ints, Ints]:
    """The last variable of each monomial, and the place of the product of the others."""
    lists = monomials(d, degree)
    return lists[:, -1], places(lists[:, :-1], d)


def monomial_values(u: Array, degree: int) -> Array:
    """Values of all monomials up to a degree at points u (S, d), by degree, shape (S, terms)."""
    d, points = u.shape[1], np.ascontiguousarray(u.T)
    values: Array = np.ones((comb(d + degree, degree), len(u)))
    lower, begin = 0, 1
    for m in range(1, degree + 1):
        variable, other_factors = _last_factors(d, m)
        end = begin + len(variable)
        values[begin:end] = values[lower + other_factors] * points[variable]
        lower, begin = begin, end
    return values.T


def convolve(
    a: Array, b: Array, degrees: tuple[int, int], d: int, bilinear: Callable[[Array, Array], Array]
) -> Array:
    """Product of homogeneous polynomials in d variables by a bilinear product of coefficients.

    a and b, of `degrees`, have shapes (monomials, …); `bilinear` broadcasts over their first axes.
    """
    at, total = product_places(d, *degrees), count(d, sum(degrees))
    shape = bilinear(a[0], b[0]).shape
    out = np.zeros((total, *shape), np.result_type(a, b))
    inner, longer = (a.shape[-1] if bilinear == matmul else 1), max(len(a), len(b))
    if longer * out[0].size * inner <= SMALL:
        if bilinear == matmul and a.ndim == b.ndim == 3:
            _add_matrix_products(_writable(a), _writable(b), at, out)
            return out
        if bilinear == np.multiply:
            wide = (np.broadcast_to(c, (len(c), *shape)).reshape(len(c), -1) for c in (a, b))
            _add_products(*map(_writable, wide), at, out.reshape(total, -1))
            return out
    if len(a) <= len(b):
        for x in np.flatnonzero(a.reshape(len(a), -1).any(1)):
            out[at[x]] += bilinear(a[x][None], b)
    else:
        for y in np.flatnonzero(b.reshape(len(b), -1).any(1)):
            out[at[:, y]] += bilinear(a, b[y][None])
    return out


def _writable(a: Array) -> Array:
    """Return an array, or a copy where it is read-only: Numba compiles kernels for each kind."""
    return np.require(a, requirements="W")


def product_part(
    a: Sequence[Array],
    b: Sequence[Array],
    degree: int,
    d: int,
    bilinear: Callable[[Array, Array], Array],
    lowest: tuple[int, int] = (0, 0),
) -> Array:
    """Part of one degree of the product of two polynomials in d variables, as by `convolve`.

    a and b are their parts by degree; missing ones count as zero, as those below `lowest` do.
    """
    total = np.zeros(
        (count(d, degree), *bilinear(a[0][0], b[0][0]).shape), np.result_type(a[0], b[0])
    )
    for k in range(max(lowest[1], degree - len(a) + 1), min(degree - lowest[0], len(b) - 1) + 1):
        total += convolve(a[degree - k], b[k], (degree - k, k), d, bilinear)
    return total


@compiled
def _add_products(a: Array, b: Array, at: Ints, out: Array) -> None:
    """Add a[x] b[y], entry by entry, (v,), to out[at[x, y]] for all pairs of monomials x, y."""
    for x in range(len(a)):
        if not a[x].any():
            continue
        for y in range(len(b)):
            p = at[x, y]
            for k in range(a.shape[1]):
                out[p, k] += a[x, k] * b[y, k]


@compiled
def _add_matrix_products(a: Array, b: Array, at: Ints, out: Array) -> None:
    """Add a[x] @ b[y], (p, q) by (q, r), to out[at[x, y]] for all pairs of monomials x, y."""
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
    """Products of matrices, as `numpy.matmul`; as one where the right factor is one alone."""
    if b.ndim == 3 and len(b) == 1 and a.ndim > 2:
        return np.asarray(np.tensordot(a, b[0], 1))
    return np.asarray(np.matmul(a, b))


def derivative(part: Array, degree: int, direction: Array) -> Array:
    """Derivative of a homogeneous polynomial along a direction (d,), of one degree less."""
    d = len(direction)
    at, often = product_places(d, 1, degree - 1), exponents(d, degree - 1).T + 1
    weight = direction[:, None] * often
    return np.asarray(np.einsum("ib,ib...->b...", weight, part[at]))
