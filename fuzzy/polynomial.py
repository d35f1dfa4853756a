"""Polynomials of several inputs in the Chebyshev basis of a box: evaluation, gradient, extremes over any box inside."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from fuzzy.numbers import Array

_SCAN = 10  # the search for an extreme first looks at 2**10 points and the corners of the box
_STARTS = 3  # and then descends from the best few
_CORNERS = 10  # inputs up to which all corners are looked at


@dataclass(frozen=True)
class Polynomial:
    """Sum of c[t] Π_i T_{degrees[t, i]}(x_i), x scaled from the box to [−1, 1].

    Args:
        lower: Lower corner of the box, shape (inputs,).
        upper: Upper corner of the box, shape (inputs,).
        degrees: Degree of each term in each input, shape (terms, inputs).
        coefficients: Shape (terms, outputs).
    """

    lower: Array
    upper: Array
    degrees: NDArray[np.intp]
    coefficients: Array

    def basis(self, points: Array) -> Array:
        """Every term without its coefficient at points (n, inputs), shape (n, terms)."""
        return basis(self._scaled(points), self.degrees)

    def __call__(self, points: Array) -> Array:
        """Values at points (n, inputs), shape (n, outputs)."""
        return self.basis(points) @ self.coefficients

    def gradient(self, points: Array, output: int) -> Array:
        """Gradient of one output at points (n, inputs), shape (n, inputs)."""
        x, scale = self._scaled(points), self._scale()
        columns = [basis(x, self.degrees, derivative=i) @ self.coefficients[:, output] * scale[i] for i in range(x.shape[1])]
        return np.stack(columns, axis=1)

    def minimum(self, lower: Array, upper: Array, *, output: int, sign: float = 1.0) -> tuple[Array, float]:
        """The least value of sign · output over a box, by a scan and descents from its best points.

        Returns:
            The place, shape (inputs,), and the output there.
        """
        scan = box_scan(lower, upper)
        values = sign * (self.basis(scan) @ self.coefficients[:, output])
        starts = scan[np.argsort(values)[:_STARTS]]
        place, least = min((self._descent(start, lower, upper, output=output, sign=sign) for start in starts), key=lambda found: found[1])
        return place, sign * least

    def _descent(self, start: Array, lower: Array, upper: Array, *, output: int, sign: float) -> tuple[Array, float]:
        from scipy.optimize import minimize

        span = np.where(upper > lower, upper - lower, 1.0)

        def objective(unit: Array) -> tuple[float, Array]:
            point = (lower + unit * span)[None]
            return sign * float(self(point)[0, output]), sign * self.gradient(point, output)[0] * span

        ends = [(0.0, 1.0 if b > a else 0.0) for a, b in zip(lower, upper, strict=True)]
        found = minimize(objective, (start - lower) / span, jac=True, bounds=ends, method="L-BFGS-B")
        return np.clip(lower + found.x * span, lower, upper), float(found.fun)

    def _scale(self) -> Array:
        width = self.upper - self.lower
        return np.divide(2.0, width, out=np.zeros_like(width), where=width > 0)

    def _scaled(self, points: Array) -> Array:
        return (points - (self.lower + self.upper) / 2) * self._scale()


def basis(x: Array, degrees: NDArray[np.intp], *, derivative: int | None = None) -> Array:
    """Products of Chebyshev polynomials at x (n, inputs) in [−1, 1], shape (n, terms); optionally differentiated by one input."""
    terms = np.ones((len(x), len(degrees)))
    for i in range(x.shape[1]):
        highest = int(degrees[:, i].max(initial=0))
        table = chebyshev.chebvander(x[:, i], highest)
        if derivative == i:
            table = chebyshev.chebval(x[:, i], chebyshev.chebder(np.eye(highest + 1))).T if highest else np.zeros((len(x), 1))
        terms *= table[:, degrees[:, i]]
    return terms


def box_scan(lower: Array, upper: Array) -> Array:
    """Corners of a box (up to 10 inputs) and 1,024 evenly spread points inside, shape (n, inputs)."""
    from scipy.stats import qmc

    inputs = len(lower)
    spread: Array = qmc.Sobol(inputs, scramble=False).random_base2(_SCAN)
    corners = np.array(list(product((0.0, 1.0), repeat=inputs))) if inputs <= _CORNERS else np.array([[0.0] * inputs, [1.0] * inputs])
    scan: Array = np.clip(lower + np.concatenate([corners, spread]) * (upper - lower), lower, upper)
    return scan
