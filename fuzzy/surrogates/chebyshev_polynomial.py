"""Polynomials in the Chebyshev basis of a box: values, gradients, extremes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from alphacut.fuzzy.sets.interaction import pulled
from alphacut.fuzzy.sets.numbers import Array

Slack = Callable[[Array], Array]
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
        columns = [
            basis(x, self.degrees, derivative=i) @ self.coefficients[:, output] * scale[i]
            for i in range(x.shape[1])
        ]
        return np.stack(columns, axis=1)

    def minimum(
        self,
        lower: Array,
        upper: Array,
        *,
        output: int,
        sign: float = 1.0,
        slack: Slack | None = None,
    ) -> tuple[Array, float]:
        """The least value of sign · output over a box, by a scan and descents from its best points.

        Args:
            lower: Lower corner of the box, shape (inputs,).
            upper: Upper corner of the box, shape (inputs,).
            output: Index of the output.
            sign: 1 for the least, −1 for the greatest value.
            slack: Function of points (n, inputs), not negative where they are allowed; everywhere
                if not given.

        Returns:
            The place, shape (inputs,), and the output there.

        Raises:
            ValueError: No point seems allowed.
        """
        scan = box_scan(lower, upper)
        if slack is not None:
            allowed = scan[slack(scan) >= 0]
            if not len(allowed):
                raise ValueError(
                    "no point of a cut fulfils its interactions: they leave too little room, or"
                    " none"
                )
            scan = allowed
        values = sign * (self.basis(scan) @ self.coefficients[:, output])
        starts = scan[np.argsort(values)[:_STARTS]]
        scale = dividing(np.ptp(values))
        search = _Search(self, lower, upper, output=output, sign=sign, scale=scale, slack=slack)
        place, least = min((search.descend(start) for start in starts), key=lambda found: found[1])
        return place, sign * least

    def _scale(self) -> Array:
        width = self.upper - self.lower
        return np.divide(2.0, width, out=np.zeros_like(width), where=width > 0)

    def _scaled(self, points: Array) -> Array:
        return (points - (self.lower + self.upper) / 2) * self._scale()


@dataclass(frozen=True)
class _Search:
    """Descent over a box in unit coordinates, the output in units of `scale`."""

    polynomial: Polynomial
    lower: Array
    upper: Array
    output: int
    sign: float
    scale: float
    slack: Slack | None

    def descend(self, start: Array) -> tuple[Array, float]:
        """The place of a local minimum near the start and sign · output there."""
        from scipy.optimize import minimize

        bounds = [(0.0, 1.0 if b > a else 0.0) for a, b in zip(self.lower, self.upper, strict=True)]
        unit = np.clip((start - self.lower) / self._span(), 0, 1)
        options: dict[str, Any] = {"method": "L-BFGS-B"}
        if slack := self.slack:
            room = {"type": "ineq", "fun": lambda unit: float(slack(self._point(unit))[0])}
            options = {"method": "SLSQP", "constraints": [room]}
        found = minimize(self._objective, unit, jac=True, bounds=bounds, **options)
        place = self._point(found.x)[0]
        if self.slack:
            place = pulled(place, start, self.slack)
        return place, self.sign * self._value(place[None])

    def _objective(self, unit: Array) -> tuple[float, Array]:
        point = self._point(unit)
        gradient = self.polynomial.gradient(point, self.output)[0] * self._span()
        factor = self.sign / self.scale
        return factor * self._value(point), factor * gradient

    def _value(self, point: Array) -> float:
        terms = self.polynomial.basis(point)[0]
        return float(terms @ self.polynomial.coefficients[:, self.output])

    def _point(self, unit: Array) -> Array:
        return np.clip(self.lower + unit * self._span(), self.lower, self.upper)[None]

    def _span(self) -> Array:
        return np.where(self.upper > self.lower, self.upper - self.lower, 1.0)


def dividing(*sizes: float) -> float:
    """The first size that outputs can be divided by, else 1: by a subnormal one they overflow."""
    return next((float(size) for size in sizes if size >= np.finfo(float).tiny), 1.0)


def basis(x: Array, degrees: NDArray[np.intp], *, derivative: int | None = None) -> Array:
    """Products of Chebyshev polynomials at x (n, inputs), shape (n, terms), or a derivative."""
    terms = np.ones((len(x), len(degrees)))
    for i in range(x.shape[1]):
        highest = int(degrees[:, i].max(initial=0))
        table = chebyshev.chebvander(x[:, i], highest)
        if derivative == i:
            table = (
                chebyshev.chebval(x[:, i], chebyshev.chebder(np.eye(highest + 1))).T
                if highest
                else np.zeros((len(x), 1))
            )
        terms *= table[:, degrees[:, i]]
    return terms


def corners(inputs: int) -> Array:
    """Corners of the unit cube, shape (2**inputs, inputs)."""
    return np.array(list(product((0.0, 1.0), repeat=inputs)))


def box_scan(lower: Array, upper: Array) -> Array:
    """Corners (up to 10 inputs) and 1,024 even points of a box, shape (n, inputs)."""
    from scipy.stats import qmc

    inputs = len(lower)
    spread: Array = qmc.Sobol(inputs, scramble=False).random_base2(_SCAN)
    unit = np.concatenate([corners(inputs), spread]) if inputs <= _CORNERS else spread
    return np.clip(lower + unit * (upper - lower), lower, upper)
