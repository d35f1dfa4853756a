"""Response surfaces: fitted polynomials with their error on left-out samples (Fig. 2)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations_with_replacement
from math import comb

import numpy as np
from numpy.typing import NDArray

from alphacut.fuzzy.sets.numbers import Array
from alphacut.fuzzy.surrogates.chebyshev_polynomial import Polynomial, basis

_HIGHEST = 8
_SAMPLES_PER_TERM = 1.5


@dataclass(frozen=True, eq=False)
class ResponseSurface:
    """Polynomial of full total degree fitted by least squares.

    Args:
        polynomial: The surface, one output per column of the values.
        degree: Its total degree.
        error: Root mean square error at samples left out one at a time, shape (outputs,), in the
            unit of each output.
    """

    polynomial: Polynomial
    degree: int
    error: Array

    @classmethod
    def fit(cls, points: Array, values: Array, *, degree: int | None = None) -> ResponseSurface:
        """Fit points (n, inputs), values (n, outputs); the degree by left-out samples.

        Raises:
            ValueError: There are too few samples for the degree.
        """
        highest = _highest_degree(*points.shape)
        if degree is not None and not 0 <= degree <= highest:
            allowed = f"{len(points)} samples of {points.shape[1]} inputs allow 0 to {highest}"
            raise ValueError(f"the degree of the surface is {degree}; {allowed}")
        fits = [
            cls._fit(points, values, d)
            for d in ([degree] if degree is not None else range(highest + 1))
        ]
        scale = np.where(np.ptp(values, axis=0) > 0, np.ptp(values, axis=0), 1.0)
        return min(fits, key=lambda fit: float(np.mean(fit.error / scale)))

    @classmethod
    def _fit(cls, points: Array, values: Array, degree: int) -> ResponseSurface:
        lower, upper = points.min(axis=0), points.max(axis=0)
        degrees = total_degree(points.shape[1], degree)
        unit = np.divide(
            2 * points - lower - upper,
            upper - lower,
            out=np.zeros_like(points),
            where=upper > lower,
        )
        matrix = basis(unit, degrees)
        left, size, right = np.linalg.svd(matrix, full_matrices=False)
        # nested samples can leave some terms undetermined: take the least of them
        kept = size > size[0] * 1e-10
        coefficients = right[kept].T @ ((left[:, kept].T @ values) / size[kept, None])
        leverage = np.minimum((left[:, kept] ** 2).sum(axis=1), 1 - 1e-12)
        left_out = (values - matrix @ coefficients) / (1 - leverage)[:, None]
        return cls(
            Polynomial(lower, upper, degrees, coefficients),
            degree,
            np.sqrt((left_out**2).mean(axis=0)),
        )

    def __call__(self, points: Array) -> Array:
        """Values at points (n, inputs), shape (n, outputs)."""
        return self.polynomial(np.atleast_2d(points))


def total_degree(inputs: int, degree: int) -> NDArray[np.intp]:
    """Exponents of all terms up to a total degree, shape (terms, inputs)."""
    rows = []
    for total in range(degree + 1):
        for chosen in combinations_with_replacement(range(inputs), total):
            rows.append(np.bincount(np.array(chosen, int), minlength=inputs))
    return np.array(rows)


def _highest_degree(samples: int, inputs: int) -> int:
    degrees = [d for d in range(_HIGHEST + 1) if _SAMPLES_PER_TERM * comb(inputs + d, d) <= samples]
    return max(degrees, default=0)
