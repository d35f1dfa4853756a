"""Compiled products and bounds of polynomials over the unit box that are cut at a total degree.

A polynomial of u in [−1, 1]^d is an array of N coefficients of all monomials up to a degree, in the
order of `monomials.monomial_values`, the constant first. A series is a polynomial in a further
variable τ in [0, 1] whose coefficients are such polynomials, an array of shape (terms, N).

Since |u_i| ≤ 1, the sum of the magnitudes of its coefficients bounds a polynomial.
"""

from __future__ import annotations

from functools import cache
from math import comb
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.kernels import compiled
from alphacut.frame.calculus.monomials import monomials, product_places

# Number of halvings after which a bound of a series over τ is no more refined (tuned: then the
# distance from the chord is 4⁻¹² of that over the whole interval).
MAX_HALVINGS = 12


class ProductTable(NamedTuple):
    """Which products of two monomials are kept, and where they stand.

    The factors of a monomial i with which it makes a monomial up to the degree kept are those from
    0 to `count[i] − 1`. `place[i, j]` is the place of the product with the factor j.
    """

    place: Ints  # (N, N)
    factors: Ints  # (N,)


@cache
def product_table(d: int, degree: int) -> ProductTable:
    """Return the table of products in d variables up to a total degree, which callers keep."""
    sizes = [len(monomials(d, k)) for k in range(degree + 1)]
    first = np.cumsum([0, *sizes])
    total = comb(d + degree, degree)
    place: Ints = np.zeros((total, total), np.int64)
    count: Ints = np.zeros(total, np.int64)
    for i in range(degree + 1):
        rows = slice(first[i], first[i + 1])
        count[rows] = first[degree - i + 1]
        for j in range(degree - i + 1):
            columns = slice(first[j], first[j + 1])
            place[rows, columns] = first[i + j] + product_places(d, i, j)
    return ProductTable(place, count)


@compiled
def magnitude(a: Array) -> float:
    """Return the sum of the magnitudes of the coefficients, which bounds a polynomial."""
    total = 0.0
    for x in a:
        total += abs(x)
    return total


@compiled
def multiply(a: Array, b: Array, table: ProductTable, out: Array) -> float:
    """Write the product a b up to the degree kept to `out`, and bound all that it leaves out.

    Returns:
        Σ |a_i b_j| over all pairs of monomials whose product has a higher degree.
    """
    out[:] = 0.0
    left_out = 0.0
    for i in range(len(a)):
        if a[i] == 0.0:
            continue
        kept = table.factors[i]
        for j in range(kept):
            out[table.place[i, j]] += a[i] * b[j]
        above = 0.0
        for j in range(kept, len(b)):
            above += abs(b[j])
        left_out += abs(a[i]) * above
    return left_out


@compiled
def reciprocal(a: Array, table: ProductTable, out: Array) -> bool:
    """Write an approximation of 1 / a to `out`; return False where a may be near zero.

    Newton's iteration r ← r (2 − a r) doubles the degree up to which r is the Taylor series of
    1 / a. Nothing is proved of what the series leaves out.
    """
    others = magnitude(a) - abs(a[0])
    # Beyond a spread of nine tenths the series converges too slowly to be of use (tuned).
    if not others < 0.9 * abs(a[0]):
        return False
    out[:] = 0.0
    out[0] = 1 / a[0]
    product = np.empty_like(a)
    old = np.empty_like(a)
    degree = 1
    while degree < len(a):
        multiply(a, out, table, product)
        product *= -1.0
        product[0] += 2.0
        old[:] = out
        multiply(old, product, table, out)
        degree *= 2
    return True


@compiled
def at_time(series: Array, terms: int, tau: float, out: Array) -> None:
    """Write the polynomial to `out` that a series has at τ, by Horner's rule."""
    out[:] = series[terms - 1]
    for k in range(terms - 2, -1, -1):
        for i in range(len(out)):
            out[i] = out[i] * tau + series[k, i]


@compiled
def max_at(series: Array, terms: int, tau: float, work: Array) -> float:
    """Return an upper bound of a series at τ over the box; `work` is overwritten, shape (N,)."""
    at_time(series, terms, tau, work)
    return float(work[0] + magnitude(work[1:]))


@compiled
def upper_bound(
    series: Array, terms: int, begin: float, end: float, gap: float, enough: float
) -> float:
    """Return an upper bound of a series over begin ≤ τ ≤ end and over the box.

    Over an interval of width w the function exceeds its chord by at most w²/8 times its largest
    second derivative, and its slope differs from that at the midpoint by at most w/2 times that. An
    interval is halved until the first of both is below `gap`, or the slope has one sign, so that
    the maximum lies at an end.

    Args:
        series: Coefficients by powers of τ and monomials, shape (terms or more, N).
        terms: Number of terms that count, at least 1.
        begin: Begin of the interval, not below 0.
        end: End of the interval, not above 1.
        gap: By how much the bound may exceed the largest value at a τ that was tried.
        enough: Bound that needs no refinement.
    """
    work = np.empty(series.shape[1])
    # On [0, 1] the sum of the magnitudes of all coefficients bounds the second derivative.
    curvature = 0.0
    for k in range(2, terms):
        curvature += k * (k - 1) * magnitude(series[k])
    slope = np.empty((max(terms - 1, 1), series.shape[1]))
    slope[0] = 0.0
    for k in range(1, terms):
        slope[k - 1] = k * series[k]
    best = max(max_at(series, terms, begin, work), max_at(series, terms, end, work))
    bound = best
    stack = np.empty((MAX_HALVINGS + 2, 3))  # begin, width and halvings of open intervals
    stack[0] = (begin, end - begin, 0.0)
    n = 1
    while n:
        n -= 1
        low, width, halvings = stack[n]
        at_low = max_at(series, terms, low, work)
        at_high = max_at(series, terms, low + width, work)
        best = max(best, at_low, at_high)
        chord_error = curvature * width**2 / 8
        if (
            max(at_low, at_high) + chord_error <= max(best + gap, enough)
            or halvings == MAX_HALVINGS
        ):
            bound = max(bound, max(at_low, at_high) + chord_error)
            continue
        at_time(slope, max(terms - 1, 1), low + width / 2, work)
        spread = magnitude(work[1:]) + curvature * width / 2
        if abs(work[0]) >= spread:  # monotonic: the maximum lies at an end
            bound = max(bound, at_low, at_high)
            continue
        stack[n] = (low, width / 2, halvings + 1)
        stack[n + 1] = (low + width / 2, width / 2, halvings + 1)
        n += 2
    return float(bound)
