"""Guaranteed integrals over slices of prisms, with quotients by det J, and their means over θ.

A slice of a prism at a fixed θ is the image of a triangle under quadratic polynomials with the
Jacobian matrix J. The energy of fields that are polynomials on the triangle is the integral of
N/det J with a polynomial N ≥ 0. On the range [a, b] of det J in the prism, 1/d is replaced by the
polynomial q of degree m with the least relative error,

    d q(d) = 1 − T(l(d))/T(l(0)),    l(d) = (2 d − a − b)/(b − a),

where T is Chebyshev's polynomial of degree m + 1 (Golub and Varga, Numer. Math. 3, 147, 1961). The
error is at most 1/|T(l(0))|. What remains is a polynomial, in the triangle and along θ, so that
quadrature and interpolation are exact. Its mean over θ follows from the moments of the distribution
in each layer, which the cumulative distribution function bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import Chebyshev, chebyshev

from alphacut.base.arrays import Array
from alphacut.rve.mesh.wedge import wedge
from alphacut.stochastic import ThetaDistribution

MAX_ERROR = 1e-6
"""Relative error of 1/det J that is aimed at (tuned), far below the distance of the bounds."""
MAX_DEGREE = 12
"""Largest degree of q (tuned); with it b/a = 4 leaves an error of 1e-6."""
STEPS = 2**16
"""Steps of θ in a layer by which moments are bounded (tuned)."""


@dataclass(frozen=True, eq=False)
class InverseDeterminant:
    """The polynomials q of some prisms, which approximate 1/det J.

    Args:
        ends: Bounds of det J in each prism, the lower ones positive, shape (2, prisms).
        degree: Degree m of q.
    """

    ends: Array
    degree: int

    @classmethod
    def of_ends(cls, ends: Array, ratio: float) -> InverseDeterminant:
        """Return polynomials with errors of at most `MAX_ERROR`, or of the degree `MAX_DEGREE`.

        Args:
            ends: Bounds of det J in each prism, the lower ones positive, shape (2, prisms).
            ratio: Largest quotient b/a > 1 of the bounds, also of prisms that others have.
        """
        # T of degree n is cosh(n arcosh l) at l > 1.
        at_zero = (ratio + 1) / (ratio - 1)
        degree = np.ceil(np.arccosh(1 / MAX_ERROR) / np.arccosh(at_zero)) - 1
        return cls(ends, int(np.clip(degree, 0, MAX_DEGREE)))

    @property
    def errors(self) -> Array:
        """Bound of |d q(d) − 1| in each prism, shape (prisms,)."""
        low, high = self.ends
        return np.asarray(1 / abs(self._chebyshev((high + low) / (high - low))))

    @property
    def _chebyshev(self) -> Chebyshev:
        """Return Chebyshev's polynomial T."""
        return Chebyshev.basis(self.degree + 1)

    def __call__(self, determinants: Array) -> Array:
        """Return q(det J) at points of the prisms, shape (prisms, points)."""
        low, high = self.ends[..., np.newaxis]
        at_zero = self._chebyshev(-(high + low) / (high - low))
        places = (2 * determinants - low - high) / (high - low)
        return np.asarray((1 - self._chebyshev(places) / at_zero) / determinants)


def planar_slopes(points: Array) -> Array:
    """Return derivatives of the 15 functions of a prism along x and y of its triangle.

    Args:
        points: Points (x, y, z) of the reference prism, shape (points, 3).

    Returns:
        Shape (2, points, 15).
    """
    return np.array(wedge(1).tabulate(1, points)[1:3]).reshape(2, len(points), -1)


def determinant_ranges(nodes: Array, low: float, high: float) -> Array:
    """Return bounds of the determinant of J in slices of prisms, shape (2, prisms).

    It is a polynomial of degree 2 in the triangle and 4 along θ, and lies between the smallest and
    the largest of its coefficients in the form of Bernstein and Bézier. Bounds are widened by far
    more than rounding, and are not equal. The lower one need not be positive.

    Args:
        nodes: Positions (x1, x2) of the 15 nodes of each prism, shape (prisms, 15, 2).
        low: Height of the lowest slice in the prisms, from 0.
        high: Height of the highest slice, to 1.
    """
    corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5)]
    t = np.linspace(0.0, 1.0, 5)
    points = np.array([(x, y, z) for z in low + t * (high - low) for x, y in corners])
    by_x, by_y = planar_slopes(points)[:, np.newaxis] @ nodes
    values = by_x[..., 0] * by_y[..., 1] - by_x[..., 1] * by_y[..., 0]
    # Values at the heights t are sums of Bernstein's polynomials of degree 4 times coefficients.
    k = np.arange(len(t))
    t = t[:, np.newaxis]
    bernstein = np.array([1, 4, 6, 4, 1]) * t**k * (1 - t) ** (4 - k)
    coefficients = np.linalg.solve(bernstein, values.reshape(-1, len(k), len(corners)))
    # The coefficient of an edge is twice its middle value less the mean of its ends.
    ends = (coefficients[..., [0, 0, 1]] + coefficients[..., [1, 2, 2]]) / 2
    coefficients[..., 3:] = 2 * coefficients[..., 3:] - ends
    smallest = coefficients.min(axis=(1, 2))
    largest = coefficients.max(axis=(1, 2))
    slack = 1e-9 * abs(largest)
    return np.array([smallest - slack, largest + slack])


def chebyshev_points(degree: int) -> Array:
    """Return degree + 1 rising heights in (0, 1) that interpolate polynomials of a degree along z.

    They are Chebyshev's points of the first kind.
    """
    return np.asarray((chebyshev.chebpts1(degree + 1) + 1) / 2)


def mean_over_theta(
    law: ThetaDistribution, low: float, high: float, values: Array
) -> tuple[Array, Array]:
    """Return the integral over θ of a polynomial times the density, and a bound of its error.

    Args:
        law: Distribution of θ; of it the cumulative distribution function is used.
        low: Lower end of the integral.
        high: Upper end.
        values: Values of the polynomial at low + z (high − low) with the heights z of
            `chebyshev_points`, shape (heights, …). They can be arrays.

    Returns:
        Integral and bound of the absolute error, shape (…) each.
    """
    count = len(values)
    # Coefficients of the interpolation in Chebyshev's polynomials, by their discrete orthogonality.
    at_points = chebyshev.chebvander(chebyshev.chebpts1(count), count - 1)
    factors = np.where(np.arange(count) == 0, 1, 2) / count
    coefficients = np.tensordot(factors[:, np.newaxis] * at_points.T, values, axes=1)

    x, width = np.linspace(-1, 1, STEPS + 1, retstep=True)
    probabilities = np.diff(law.cdf(low + (x + 1) / 2 * (high - low)))
    polynomials = chebyshev.chebvander(x, count - 1)
    # The mean of a linear function over a step is between its ends. A polynomial is linear there
    # but for width²/8 times its largest second derivative, which is k² (k² − 1)/3 at the ends.
    k = np.arange(count)
    curvature = width**2 / 8 * k**2 * (k**2 - 1) / 3
    moments = probabilities @ (polynomials[1:] + polynomials[:-1]) / 2
    errors = probabilities @ abs(np.diff(polynomials, axis=0)) / 2
    errors += curvature * probabilities.sum()
    integral = np.tensordot(moments, coefficients, axes=1)
    return integral, np.tensordot(errors, abs(coefficients), axes=1)
