"""Homogeneous polynomials of d variables, packed: one coefficient a monomial.

A monomial u_i u_j … of degree m is a rising list of m variables; its place among all of that
degree is Σ_k C(i_k + k, k + 1), k = 0 … m − 1. A vector polynomial is an array of shape
(monomials, n). The sum of magnitudes of its coefficients bounds it over the unit box, and is
small where terms cancel.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement
from math import comb, factorial

import numpy as np
from numba import njit

from alphacut.frame.dual.expansion import Expansion
from alphacut.fuzzy.arrays import Array, Rows

MOST = 24
"""Greatest degree that places are counted for."""


@cache
def monomials(d: int, degree: int) -> Rows:
    """All rising lists of `degree` out of d variables by place, shape (monomials, degree)."""
    every = list(combinations_with_replacement(range(d), degree))
    rows = np.array(every, np.int64).reshape(len(every), degree)
    return rows[np.argsort(places(rows, d))]


@cache
def binomials(d: int) -> Rows:
    """C(i + k, k + 1) for variables i and k, shape (d, MOST)."""
    return np.array([[comb(i + k, k + 1) for k in range(MOST)] for i in range(d)], np.int64)


def places(lists: Rows, d: int) -> Rows:
    """Places of rising lists (N, m), shape (N,)."""
    table = binomials(d)
    return np.asarray(
        sum((table[lists[:, k], k] for k in range(lists.shape[1])), np.zeros(len(lists), int))
    )


@cache
def places_of_both(d: int, m: int, q: int) -> Rows:
    """Places of the products of all monomials of degree m with all of degree q, shape (M, Q)."""
    one, other = monomials(d, m), monomials(d, q)
    out = np.empty((len(one), len(other)), np.int64)
    _merge(one, other, binomials(d), out)
    return out


@njit(cache=True)
def _merge(one: Rows, other: Rows, table: Rows, out: Rows) -> None:
    m, q = one.shape[1], other.shape[1]
    for x in range(len(one)):
        for y in range(len(other)):
            place, i, j = 0, 0, 0
            for k in range(m + q):
                if j == q or (i < m and one[x, i] <= other[y, j]):
                    place += table[one[x, i], k]
                    i += 1
                else:
                    place += table[other[y, j], k]
                    j += 1
            out[x, y] = place


@njit(cache=True, nogil=True)
def multiply(a: Array, b: Array, places: Rows, out: Array) -> None:
    """Adds products: out[place of both, i] += a[α, i, j] b[β, j].

    Args:
        a: Matrix polynomial, shape (monomials, n, l).
        b: Vector polynomial, shape (monomials, l).
        places: Places of the products of their monomials.
        out: Vector polynomial, shape (monomials, n).
    """
    n, width = a.shape[1], a.shape[2]
    for x in range(len(a)):
        used = False
        for i in range(n):
            for j in range(width):
                used = used or a[x, i, j] != 0.0
        if not used:
            continue
        for y in range(len(b)):
            place = places[x, y]
            for i in range(n):
                total = 0.0
                for j in range(width):
                    total += a[x, i, j] * b[y, j]
                out[place, i] += total


def product(a: Array, b: Array, degrees: tuple[int, int], d: int) -> Array:
    """Matrix polynomial (monomials, n, l) times vector polynomial (monomials, l)."""
    out = np.zeros((comb(d + sum(degrees) - 1, sum(degrees)), a.shape[1]))
    multiply(a, b, places_of_both(d, *degrees), out)
    return out


@njit(cache=True, nogil=True)
def multiply_each(a: Array, b: Array, places: Rows, out: Array) -> None:
    """Adds products entry by entry: out[place of both, i] += a[α, i] b[β, i]."""
    for x in range(len(a)):
        for y in range(len(b)):
            place = places[x, y]
            for i in range(a.shape[1]):
                out[place, i] += a[x, i] * b[y, i]


def each(a: Array, b: Array, degrees: tuple[int, int], d: int) -> Array:
    """Products of vector polynomials (monomials, n), or (monomials, 1), entry by entry."""
    n = max(a.shape[1], b.shape[1])
    out = np.zeros((comb(d + sum(degrees) - 1, sum(degrees)), n))
    a, b = (np.ascontiguousarray(np.broadcast_to(x, (len(x), n))) for x in (a, b))
    multiply_each(a, b, places_of_both(d, *degrees), out)
    return out


def packed(whole: Array, degree: int) -> Array:
    """Coefficients (monomials, …) of a symmetric tensor (…, d, …, d)."""
    if degree == 0:
        return whole[None]
    d, kept = whole.shape[-1], whole.shape[: whole.ndim - degree]
    at, count = _in_tensor(d, degree)
    return np.asarray(np.moveaxis(whole.reshape(*kept, d**degree)[..., at] * count, -1, 0))


@cache
def _in_tensor(d: int, degree: int) -> tuple[Rows, Array]:
    """First places of all monomials in a flat tensor, and how often they stand there."""
    lists = monomials(d, degree)
    return np.asarray(np.ravel_multi_index(tuple(lists.T), (d,) * degree)), orders(lists)


def tensor(coefficients: Array, d: int, degree: int) -> Array:
    """Symmetric tensor (…, d, …, d) of coefficients (monomials, …)."""
    if degree == 0:
        return np.asarray(coefficients[0])
    lists = monomials(d, degree)
    every: Rows = np.sort(np.indices([d] * degree).reshape(degree, -1).T, axis=1).astype(np.int64)
    values = np.moveaxis(coefficients, 0, -1) / orders(lists)
    return np.asarray(values[..., places(every, d)].reshape(*coefficients.shape[1:], *[d] * degree))


def orders(lists: Rows) -> Array:
    """In how many orders each list may be written, shape (N,)."""
    degree = lists.shape[1]
    if degree == 0:
        return np.ones(1)
    run: Array = np.ones(len(lists))
    repeats: Array = np.ones(len(lists))
    for k in range(1, degree):
        run = np.where(lists[:, k] == lists[:, k - 1], run + 1, 1.0)
        repeats = repeats * run
    return np.asarray(factorial(degree) / repeats)


@dataclass(frozen=True, eq=False)
class Series:
    """A vector of n functions of the box, to a degree N of three or more.

    Args:
        parts: Homogeneous polynomials of degree 0 to N, packed, shapes (monomials, n).
        rest: Bound of what they leave out, shape (n,).
        inputs: Which of all inputs they depend on, shape (d,).
    """

    parts: list[Array]
    rest: Array
    inputs: Rows

    def sizes(self) -> list[Array]:
        """Bounds of the parts over the box, each (n,)."""
        return [np.asarray(np.abs(part).sum(0)) for part in self.parts]

    def through(self, rows: Array) -> Series:
        """Rows @ self for numbers `rows` (m, n); what cancels in the sums is not counted."""
        parts = [np.ascontiguousarray(part @ rows.T) for part in self.parts]
        return Series(parts, np.abs(rows) @ self.rest, self.inputs)

    def cut(self, degree: int) -> Series:
        """The same to a lower degree, with the sizes of the others in the rest."""
        rest = self.rest + sum(self.sizes()[degree + 1 :])
        return Series(self.parts[: degree + 1], np.asarray(rest), self.inputs)

    def __getitem__(self, which: slice) -> Series:
        """Some of the functions."""
        return Series([part[:, which] for part in self.parts], self.rest[which], self.inputs)

    def __mul__(self, other: Series) -> Series:
        """Products, entry by entry, or with one function."""
        N, d = len(self.parts) - 1, len(self.inputs)
        parts = [
            np.sum(
                [each(self.parts[i], other.parts[m - i], (i, m - i), d) for i in range(m + 1)], 0
            )
            for m in range(N + 1)
        ]
        s, t = self.sizes(), other.sizes()
        high = sum(s[i] * sum(t[N + 1 - i :]) for i in range(1, N + 1))
        rest = high + self.rest * (sum(t) + other.rest) + sum(s) * other.rest
        return Series(parts, np.asarray(rest), self.inputs)

    def over(self, one: Series) -> Series:
        """Quotients by one positive function.

        c̃ is the quotient's series, and what c̃ times the function leaves of the dividend is bounded.
        """
        N, d = len(self.parts) - 1, len(self.inputs)
        first, parts = one.parts[0][0], list[Array]()
        for m in range(N + 1):
            lower = sum(each(parts[m - j], one.parts[j], (m - j, j), d) for j in range(1, m + 1))
            parts.append((self.parts[m] - lower) / first)
        t = one.sizes()
        least = first - sum(t[1:]) - one.rest
        if not (least > 0).all():
            return Series(parts, np.full(len(self.rest), np.inf), self.inputs)
        sizes = [np.abs(part).sum(0) for part in parts]
        high = sum(sizes[i] * sum(t[N + 1 - i :]) for i in range(1, N + 1))
        return Series(parts, (high + self.rest + sum(sizes) * one.rest) / least, self.inputs)

    def expansion(self, d: int) -> Expansion:
        """The same in all d inputs, to third degree."""
        own, rest = len(self.inputs), self.rest + sum(self.sizes()[4:])
        parts = []
        for m, part in enumerate(self.parts[:4]):
            whole = np.zeros((*part.shape[1:], d**m))
            at = _within(self.inputs, d, m)
            whole[..., at] = tensor(part, own, m).reshape(*part.shape[1:], -1)
            parts.append(whole.reshape(*part.shape[1:], *[d] * m))
        return Expansion(tuple(parts), np.asarray(rest))


def _within(inputs: Rows, d: int, degree: int) -> Rows:
    """Places of a tensor of some inputs in that of all d, both flat."""
    at = np.zeros(1, np.int64)
    for _ in range(degree):
        at = (at[:, None] * d + inputs).ravel()
    return at
