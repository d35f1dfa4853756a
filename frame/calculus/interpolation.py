"""Interpolation on the unit box [−1, 1]^d at tensor grids, and bounds of polynomials on it.

A polynomial whose degree in each of the d inputs is at most n is given by its values at a grid of
(n + 1)^d Chebyshev–Lobatto points cos(π i / n), the first input running slowest. All functions take
arrays whose last axis runs over such a grid. Since |T_k| ≤ 1, the sum of the magnitudes of its
Chebyshev coefficients bounds a polynomial; Bernstein coefficients bound it from both sides, and
more closely (Farouki 2012).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from itertools import product
from math import comb

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from alphacut.base.arrays import Array

LARGEST_PRODUCT = 2**18
"""Most entries of a matrix for all inputs at once, which is faster up to there (tuned)."""


@cache
def lobatto_points(degree: int) -> Array:
    """Return the Chebyshev–Lobatto points cos(π i / degree), shape (degree + 1,); 0 of degree 0."""
    if degree == 0:
        return np.zeros(1)
    return np.asarray(np.cos(np.pi * np.arange(degree + 1) / degree))


@cache
def grid(inputs: int, degree: int) -> Array:
    """Return the tensor grid of Chebyshev–Lobatto points, shape ((degree + 1)^inputs, inputs)."""
    points = list(product(lobatto_points(degree), repeat=inputs))
    return np.array(points).reshape(len(points), inputs)


@cache
def chebyshev_matrix(degree: int) -> Array:
    """Return the matrix from values at Lobatto points to Chebyshev coefficients."""
    return np.asarray(np.linalg.inv(chebvander(lobatto_points(degree), degree)))


@cache
def refining_matrix(degree: int, finer: int) -> Array:
    """Return the matrix from values at Lobatto points of one degree to those of a higher one."""
    return np.asarray(chebvander(lobatto_points(finer), degree) @ chebyshev_matrix(degree))


@cache
def bernstein_matrix(degree: int, pieces: int = 1) -> Array:
    """Return the matrix from powers of τ to Bernstein coefficients on parts of 0 ≤ τ ≤ 1.

    Args:
        degree: Degree n of the polynomials.
        pieces: Number of equal parts of the interval.

    Returns:
        Matrices of the parts one below the other, shape (pieces (n + 1), n + 1).
    """
    rows = []
    # τ^j has the Bernstein coefficients binomial(i, j) / binomial(n, j) on [0, 1].
    powers = [[comb(i, j) / comb(degree, j) for j in range(degree + 1)] for i in range(degree + 1)]
    for piece in range(pieces):
        low = piece / pieces
        width = 1 / pieces
        # (low + width σ)^k by powers of σ
        shifted = np.zeros((degree + 1, degree + 1))
        for k in range(degree + 1):
            for j in range(k + 1):
                shifted[j, k] = comb(k, j) * low ** (k - j) * width**j
        rows.append(np.array(powers) @ shifted)
    return np.concatenate(rows)


@cache
def part_matrix(degree: int, kept: int, parts: int) -> Array:
    """Return the matrix from values at Lobatto points to Bernstein coefficients on parts.

    Args:
        degree: Degree of the points.
        kept: Degree n of the polynomials, at most that of the points.
        parts: Number of equal parts of [−1, 1].

    Returns:
        Matrices of the parts one below the other, shape (parts (n + 1), degree + 1).
    """
    local = (lobatto_points(kept) + 1) / 2  # points within a part, in [0, 1]
    bernstein = np.array(
        [[comb(kept, i) * s**i * (1 - s) ** (kept - i) for i in range(kept + 1)] for s in local]
    )
    from_values = np.linalg.inv(bernstein)
    rows = []
    for part in range(parts):
        points = -1 + 2 * (part + local) / parts
        values = chebvander(points, kept) @ chebyshev_matrix(degree)[: kept + 1]
        rows.append(from_values @ values)
    return np.concatenate(rows)


@cache
def _whole(make: Callable[..., Array], inputs: int, *arguments: int) -> Array:
    """Return the matrix for all inputs at once, of one for each."""
    whole: Array = np.ones((1, 1))
    for _ in range(inputs):
        whole = np.asarray(np.kron(whole, make(*arguments)), float)
    return whole


def along_inputs(values: Array, inputs: int, make: Callable[..., Array], *arguments: int) -> Array:
    """Apply a matrix along each input of arrays over a grid.

    Args:
        values: Shape (…, n^inputs).
        inputs: Number of inputs.
        make: Function that returns the matrix, shape (rows, n).
        arguments: Its arguments.

    Returns:
        Shape (…, rows^inputs).
    """
    matrix = make(*arguments)
    rows, n = matrix.shape
    head = values.shape[:-1]
    if matrix.size**inputs <= LARGEST_PRODUCT:
        whole = _whole(make, inputs, *arguments)
        found = values.reshape(-1, values.shape[-1]) @ whole.T
        return np.asarray(found.reshape(*head, len(whole)))
    # The first input of the grid is moved behind the others, once for each input.
    for _ in range(inputs):
        rest = values.reshape(-1, n, values.shape[-1] // n)
        moved = np.matmul(rest.swapaxes(1, 2), matrix.T)
        values = moved.reshape(*head, values.shape[-1] // n * rows)
    return values


def coefficients(values: Array, inputs: int, degree: int) -> Array:
    """Return the Chebyshev coefficients of polynomials on a grid; the first one is the constant."""
    return along_inputs(values, inputs, chebyshev_matrix, degree)


def magnitude(values: Array, inputs: int, degree: int) -> Array:
    """Return bounds over the box of the magnitudes of polynomials on a grid, shape (…)."""
    return np.asarray(np.abs(coefficients(values, inputs, degree)).sum(axis=-1))


def box_maxima(values: Array, inputs: int, degree: int) -> Array:
    """Return upper bounds of polynomials over the box, by Chebyshev coefficients, shape (…)."""
    found = coefficients(values, inputs, degree)
    return np.asarray(found[..., 0] + np.abs(found[..., 1:]).sum(axis=-1))


def part_maxima(
    values: Array, inputs: int, degree: int, parts: int, kept: int | None = None
) -> Array:
    """Return upper bounds of polynomials on equal parts of the box.

    Args:
        values: Values on the grid, shape (…, (degree + 1)^inputs).
        inputs: Number of inputs.
        degree: Degree of the grid.
        parts: Number of parts along each input.
        kept: Degree of the polynomials in each input, if it is lower.

    Returns:
        Largest Bernstein coefficients, shape (…, parts^inputs); the first input runs slowest.
    """
    if inputs == 0:
        return values
    kept = degree if kept is None else kept
    head = values.shape[:-1]
    if not values.size:
        return np.zeros((*head, parts**inputs))
    found = along_inputs(values, inputs, part_matrix, degree, kept, parts)
    for _ in range(inputs):
        # the last input's coefficients are reduced, and its parts moved to the front
        found = found.reshape(*head, -1, parts, kept + 1)
        # NumPy reduces a short last axis slowly.
        largest = found[..., 0]
        for number in range(1, kept + 1):
            largest = np.maximum(largest, found[..., number])
        found = np.moveaxis(largest, -1, len(head))
        found = found.reshape(*head, -1)
    return found
