"""Fit of the radius map to a sample by f_r dr = f_θ dθ and least squares (section 4.2).

The map that carries the distribution of θ to the sample is r(θ) = Q(F_Θ(θ)), Q the sample's
quantile function: a staircase. Its distance to the Hermite cubic H, ∫ (r − H)² f_Θ dθ, is a
quadratic function of (a2, a4) whose integrals over the steps are known in closed form. Where the
minimiser is not monotone, the nearest monotone cubic in the same norm is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial, polynomial
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.radius_map import HermiteMap
from alphacut.stochastic.theta.distribution import TruncatedNormal
from alphacut.stochastic.theta.quadrature import gauss_rule

HERMITE = np.array([[1.0, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]])
"""Coefficients of h1 … h4 of eq. 12 by powers of ξ."""
MIN_SLOPE = 2e-5
"""Smallest slope of a map at 401 equally spaced ξ, in units of a3 − a1. Between the points the
slope of a cubic is smaller by (1/400)²/8 times its curvature at most, so that it stays positive."""


def _hermite_at(xi: ArrayLike) -> Array:
    """Return h1 … h4 at ξ of shape (n,), shape (4, n)."""
    return np.array([polynomial.polyval(np.asarray(xi, float), h) for h in HERMITE])


class SlopeEnds(NamedTuple):
    """Range of a slope with its nominal or fitted value inside."""

    lower: float
    nominal: float
    upper: float


@dataclass(frozen=True)
class HermiteFit:
    """Least-squares fit of the slopes a2, a4 of a Hermite map between two limits a1, a3 of r_n."""

    a1: float
    a3: float

    distribution: ClassVar[TruncatedNormal] = TruncatedNormal()

    def slopes(self, sample: AreaWeighted, weights: Array | None = None) -> tuple[float, float]:
        """Return the slopes a2, a4 of the monotone cubic H nearest to a sample.

        H = a1 h1 + a2 h2 + a3 h3 + a4 h4 with h1 = 1 − 3 ξ² + 2 ξ³, h2 = ξ − 2 ξ² + ξ³, h3 = 3 ξ² −
        2 ξ³ and h4 = ξ³ − ξ², where ξ runs from 0 to 1 over the support of θ: a1 and a3 are the
        values of H at its ends, a2 and a4 the slopes dH/dξ there. The distance is ∫ (Q(F_Θ(θ)) −
        H(θ))² f_Θ dθ, with Q the quantile function of the sample and F_Θ, f_Θ the distribution
        function and the density of θ.

        Args:
            sample: Reduced radii between the limits a1 and a3, with rising values.
            weights: Other weights of the values, by the bootstrap, shape (n,), sum 1; None for
                those of the sample.

        Returns:
            a2 and a4, 0 or more each.
        """
        cumulated = sample.cumulated
        if weights is not None:
            cumulated = np.minimum(np.cumsum(weights), 1.0)
        probability = np.append(0.0, cumulated)
        # The last one is 1 but for rounding.
        probability[-1] = 1.0

        # The normal equations for a2 and a4 have the right-hand sides ∫ h_i (Q − a1 h1 − a3 h3) f_Θ
        # dθ with i = 2, 4, and the Gram matrix of h2 and h4 on the left. Q is constant between two
        # probabilities. `_integrals` gives ∫ h_i f_Θ dθ up to each of them.
        rule_weights, h = self._hermite_at_nodes
        of_ends = h[[1, 3]] * rule_weights @ (self.a1 * h[0] + self.a3 * h[2])
        of_sample = np.diff(self._integrals(probability), axis=1) @ sample.values
        best = np.asarray(np.linalg.solve(self._gram, of_sample - of_ends), float)
        if not self.is_monotone(best):
            best = self._nearest_monotone(best)
        # Rounding may leave a slope just below 0, which no monotone map has.
        return float(max(best[0], 0)), float(max(best[1], 0))

    def map(self, slopes: tuple[float, float]) -> HermiteMap:
        """Return the radius map with slopes (a2, a4)."""
        return HermiteMap(self.a1, slopes[0], self.a3, slopes[1], self.distribution)

    def misfit(self, sample: AreaWeighted, slopes: tuple[float, float]) -> float:
        """Return the root mean square over θ of the sample's quantiles less the map.

        It is in units of the reduced radius r_n.

        Args:
            sample: Reduced radii between the limits.
            slopes: Slopes dr/dξ (a2, a4) of the map at the lower and at the upper end of θ, where ξ
                = 0 and 1.
        """
        # Midpoints of equal probabilities: the mean over θ is the mean over them.
        probability = (np.arange(20_000) + 0.5) / 20_000
        fitted = self.map(slopes)(self.distribution.quantile(probability))
        return float(np.sqrt(np.mean((sample.quantile(probability) - fitted) ** 2)))

    def _integrals(self, probability: Array) -> Array:
        """Return integrals ∫ h_i f_Θ dθ of two cubics from the lower end of θ to quantiles.

        They are h2 = ξ − 2 ξ² + ξ³ and h4 = ξ³ − ξ², which the slopes a2 and a4 of a map multiply,
        with ξ from 0 to 1 over the support of θ. The moments m_k = ∫ θ^k f_Θ dθ follow from each
        other by partial integration. With f' = −θ f of a normal density, m_k = (k − 1) m_{k−2} −
        [θ^{k−1} f].

        Args:
            probability: Probabilities of the quantiles, in [0, 1], shape (n,).

        Returns:
            Integrals, shape (2, n): of h2 in the first row, of h4 in the second.
        """
        lower = self.distribution.lower
        theta = self.distribution.quantile(probability)
        density = self.distribution.pdf(theta)
        density_at_lower = self.distribution.pdf(lower)
        moments = [probability, density_at_lower - density]
        for k in (2, 3):
            boundary = lower ** (k - 1) * density_at_lower - theta ** (k - 1) * density
            moments.append((k - 1) * moments[k - 2] + boundary)
        # h2 and h4 by powers of θ
        xi = Polynomial([-lower, 1.0]) / (self.distribution.upper - lower)
        coefficients = np.array([Polynomial(h)(xi).coef for h in HERMITE[[1, 3]]])
        return np.asarray(coefficients @ np.array(moments))

    @cached_property
    def _hermite_at_nodes(self) -> tuple[Array, Array]:
        """Weights, shape (8,), of a Gauss rule of f_Θ, and h1 … h4 at its nodes, shape (4, 8).

        These are h1 = 1 − 3 ξ² + 2 ξ³, h2 = ξ − 2 ξ² + ξ³, h3 = 3 ξ² − 2 ξ³ and h4 = ξ³ − ξ², with
        ξ from 0 to 1 over the support of θ. The rule is exact for polynomials of degree 15, and
        products of two cubics have degree 6.
        """
        rule = gauss_rule(self.distribution, points=8)
        width = self.distribution.upper - self.distribution.lower
        xi = (rule.nodes - self.distribution.lower) / width
        return rule.weights, _hermite_at(xi)

    @cached_property
    def _gram(self) -> Array:
        """Gram matrix ∫ h_i h_j f_Θ dθ of h2 and h4, shape (2, 2)."""
        weights, h = self._hermite_at_nodes
        return np.asarray(h[[1, 3]] * weights @ h[[1, 3]].T)

    @cached_property
    def _derivatives(self) -> Array:
        """Derivatives of h1 … h4 by ξ at 401 equally spaced ξ, shape (4, 401)."""
        xi = np.linspace(0, 1, 401)
        return np.array([polynomial.polyval(xi, polynomial.polyder(h)) for h in HERMITE])

    @property
    def slope_derivatives(self) -> Array:
        """Derivatives of h2 and h4 by ξ at 401 equally spaced ξ, shape (2, 401)."""
        return self._derivatives[[1, 3]]

    @property
    def base_slopes(self) -> Array:
        """Slopes of the map at 401 ξ with a2 = a4 = 0, less the smallest allowed, shape (401,)."""
        slopes = self.a1 * self._derivatives[0] + self.a3 * self._derivatives[2]
        return np.asarray(slopes - MIN_SLOPE * (self.a3 - self.a1))

    def is_monotone(self, slopes: ArrayLike) -> bool:
        """Return whether the map with slopes (a2, a4) rises at 401 equally spaced ξ."""
        excess = self.base_slopes + np.asarray(slopes) @ self.slope_derivatives
        return bool((excess >= -1e-12).all())

    @property
    def mean_shapes(self) -> tuple[float, float]:
        """Means ∫ h2 f_Θ dθ and ∫ |h4| f_Θ dθ; h4 is not positive."""
        weights, h = self._hermite_at_nodes
        return float(weights @ h[1]), float(-weights @ h[3])

    def _nearest_monotone(self, best: Array) -> Array:
        """Return the slopes a2, a4 of the monotone map nearest to another map, shape (2,).

        The distance is the root of the mean square over θ. At 401 even ξ in [0, 1] dr/dξ must be at
        least 2e-5 (a3 − a1). With L Lᵀ the Gram matrix of the functions that a2 and a4 multiply,
        the distance is |x| for x = Lᵀ (slopes − best), and the condition is G x ≥ h with a row for
        each ξ. The shortest such x comes from non-negative least squares (least distance
        programming: Lawson, Hanson 1974, chapter 23).

        Args:
            best: Slopes a2, a4 of the other map, which need not be monotone, shape (2,).
        """
        from scipy.optimize import nnls

        # In the norm of the Gram matrix |slopes − best| is the distance of the maps.
        L = np.linalg.cholesky(self._gram)
        G_transposed = np.linalg.solve(L, self.slope_derivatives)
        h = -self.base_slopes - self.slope_derivatives.T @ best
        # Rows of unit length keep the problem well scaled.
        scale = np.linalg.norm(G_transposed, axis=0)
        system = np.vstack([G_transposed / scale, h / scale])
        target = np.array([0.0, 0.0, 1.0])
        weights, _ = nnls(system, target)
        residual = system @ weights - target
        return np.asarray(best + np.linalg.solve(L.T, -residual[:2] / residual[2]))


@dataclass(frozen=True)
class SlopeBand:
    """Joint band of the slopes a2 and a4 around their fitted values."""

    a2: SlopeEnds
    a4: SlopeEnds

    def monotone_part(self, fit: HermiteFit) -> SlopeBand:
        """Return the largest part of the band around the fitted slopes with four monotone corners.

        The ends are first clipped to slopes between zero and three times the slope of the chord
        (Fritsch and Carlson 1980). Then all ends move together towards the fitted slopes, in steps
        of 1/200 of the way, until the maps at all four corners rise.

        Args:
            fit: Fit that the band belongs to; its fitted slopes give a monotone map.

        Returns:
            New band with the same fitted slopes; without width in the worst case.
        """
        chord = fit.a3 - fit.a1
        min_end = MIN_SLOPE * chord
        max_end = (3.0 - 4 * MIN_SLOPE) * chord
        lower, fitted, upper = np.array([self.a2, self.a4]).T
        lower = np.minimum(np.clip(lower, min_end, max_end), fitted)
        upper = np.maximum(np.clip(upper, min_end, max_end), fitted)
        # `fraction` is the part of the way that is left. At 0 only the fitted slopes are left,
        # which are monotone.
        for fraction in np.linspace(1, 0, 201):
            low = fitted + fraction * (lower - fitted)
            high = fitted + fraction * (upper - fitted)
            corners = product(*zip(low, high, strict=True))
            if all(fit.is_monotone(slopes) for slopes in corners):
                break
        ends = [SlopeEnds(*map(float, x)) for x in zip(low, fitted, high, strict=True)]
        return SlopeBand(a2=ends[0], a4=ends[1])


def slope_band(
    fit: HermiteFit,
    sample: AreaWeighted,
    *,
    level: float,
    resamples: int,
    generator: np.random.Generator,
) -> SlopeBand:
    """Return the fitted slopes and their joint confidence band, by the bootstrap.

    The half-width is a quantile of Student's t, with one degree of freedom less than there are
    groups, times the bootstrap standard error. The probability of error is halved, since both
    slopes shall lie in the band (Bonferroni), and halved again for the two sides.

    Args:
        fit: Fit of cubic radius maps r(ξ) between two limits; their slopes dr/dξ at ξ = 0 and 1 are
            a2 and a4.
        sample: Reduced radii between the limits, in at least two groups.
        level: Confidence of the band in (0, 1).
        resamples: Number of bootstrap samples, at least 2.
        generator: Source of the bootstrap samples; its state moves on.

    Returns:
        Lower end, fitted value and upper end of a2 and of a4. The ends may be negative or belong to
        no monotone map.
    """
    from scipy.special import stdtrit

    a2, a4 = fit.slopes(sample)
    all_weights = sample.bootstrap_weights(resamples, generator)
    resampled_slopes = [fit.slopes(sample, weights) for weights in all_weights]
    standard_errors = np.std(resampled_slopes, axis=0, ddof=1)
    # Groups are numbered from 0.
    degrees_of_freedom = sample.groups.max()
    quantile = float(stdtrit(degrees_of_freedom, 1 - (1 - level) / 4))
    a2_half = quantile * float(standard_errors[0])
    a4_half = quantile * float(standard_errors[1])
    return SlopeBand(
        a2=SlopeEnds(a2 - a2_half, a2, a2 + a2_half),
        a4=SlopeEnds(a4 - a4_half, a4, a4 + a4_half),
    )


@dataclass(frozen=True)
class PBox:
    """A Hermite map with fuzzy slopes: the supports of a2 and a4 with the nominal values inside."""

    fit: HermiteFit
    a2: SlopeEnds
    a4: SlopeEnds

    @property
    def nominal_slopes(self) -> tuple[float, float]:
        """Nominal slopes (a2, a4)."""
        return self.a2.nominal, self.a4.nominal

    def bounds(self, theta: Array) -> tuple[Array, Array]:
        """Return the smallest and the largest radius at `theta`, two arrays of its shape.

        The radius rises with the slope a2 and falls with a4, since the Hermite function h2, which
        a2 multiplies, is not negative and h4 not positive. So the smallest one has the lower end of
        a2 and the upper end of a4, at all θ together.

        Args:
            theta: Values of θ in its support.
        """
        smallest = self.fit.map((self.a2.lower, self.a4.upper))
        largest = self.fit.map((self.a2.upper, self.a4.lower))
        return smallest(theta), largest(theta)

    @property
    def area(self) -> float:
        """Area between the two distribution functions, in units of r_n."""
        h2, h4 = self.fit.mean_shapes
        return (self.a2.upper - self.a2.lower) * h2 + (self.a4.upper - self.a4.lower) * h4

    def excess(self, sample: AreaWeighted) -> float:
        """Return by how much the sample's distribution function leaves the p-box, a probability.

        It is the largest distance over all radii, and 0 if the function lies between the two of the
        p-box everywhere. These two are 0 below and 1 above the limits of the map.

        Args:
            sample: Reduced radii, at least one.
        """
        steps = sample.steps
        distribution = self.fit.distribution
        # The p-box's functions come from a table of 20,001 radii. The largest radius gives the
        # lower one.
        theta = np.asarray(np.linspace(distribution.lower, distribution.upper, 20_001), float)
        smallest_radius, largest_radius = self.bounds(theta)
        probability = distribution.cdf(theta)
        lower_cdf = np.interp(steps.values, largest_radius, probability)
        upper_cdf = np.interp(steps.values, smallest_radius, probability)
        below = (lower_cdf - steps.before).max()
        above = (steps.at - upper_cdf).max()
        return float(max(below, above, 0.0))


def least_pbox(
    fit: HermiteFit, sample: AreaWeighted, band: float, *, required: SlopeBand | None = None
) -> PBox:
    """Return the p-box of least area that contains a sample and the map fitted to it.

    The sample is of reduced radii r_n, the radius of a particle over half the side of a square or
    cube as large as its cell. The slopes a2 and a4 of a cubic map r(θ) may lie in two intervals,
    the supports. The p-box is the region between the distribution functions of the smallest and of
    the largest such map. A linear program gives the four ends of the supports.

    Args:
        fit: Ends a1 and a3 of the map, which are the limits of r_n, and distribution of θ.
        sample: Reduced radii within the limits.
        band: Half-width of the band by which the p-box may miss the sample's distribution function,
            in probability, in [0, 1).
        required: Slopes that the supports must contain as well, such as their bootstrap band; its
            part with monotone maps is used. It matters where data are few: the misfit alone then
            gives narrow supports.

    Returns:
        The fit with both supports, each with the fitted slope inside. All maps at their corners
        rise.

    Raises:
        FailedError: No p-box of monotone cubics with these ends contains the sample.
    """
    from scipy.optimize import linprog

    # The unknowns are a2 lower, a2 upper, a4 lower and a4 upper, in this order. The supports
    # contain the fitted slopes and the required ones.
    a2, a4 = fit.slopes(sample)
    inner_a2 = [a2]
    inner_a4 = [a4]
    if required is not None:
        part = required.monotone_part(fit)
        inner_a2 += part.a2
        inner_a4 += part.a4
    limits = [(0, min(inner_a2)), (max(inner_a2), None), (0, min(inner_a4)), (max(inner_a4), None)]

    # The maps at all four corners of the supports are monotone.
    derivatives = fit.slope_derivatives
    is_monotone = np.zeros((4, derivatives.shape[1], 4))  # corner, ξ, end of a support
    for corner, (a2_end, a4_end) in enumerate(product((0, 1), (2, 3))):
        is_monotone[corner, :, a2_end] = -derivatives[0]
        is_monotone[corner, :, a4_end] = -derivatives[1]
    # 1e-9 allows for the rounding of slopes that lie on the limit.
    base_slopes = np.tile(fit.base_slopes + 1e-9, 4)

    contains, bounds = _containment(fit, sample, band)
    h2, h4 = fit.mean_shapes
    result = linprog(
        [-h2, h2, -h4, h4],  # the area: the mean of the largest less the smallest radius
        A_ub=np.concatenate([contains, is_monotone.reshape(-1, 4)]),
        b_ub=np.append(bounds, base_slopes),
        bounds=limits,
    )
    if result.status != 0:
        what = f"no p-box of monotone cubics from {fit.a1:g} to {fit.a3:g}"
        raise FailedError(f"{what} contains the distribution", "widen the limits, or the band")
    ends = result.x.tolist()
    return PBox(fit, SlopeEnds(ends[0], a2, ends[1]), SlopeEnds(ends[2], a4, ends[3]))


def _containment(fit: HermiteFit, sample: AreaWeighted, band: float) -> tuple[Array, Array]:
    """Return inequalities A x ≤ b by which a p-box contains the band around a sample.

    A p-box is the region between the distribution functions of the smallest and of the largest
    radius. At each step of the sample's distribution function the largest radius must reach the
    value where the lower edge of the band rises, and the smallest radius must not pass the value
    where the upper edge does. Steps at which an edge is below 0 or above 1 give no inequality.

    Args:
        fit: Ends a1 and a3 of the cubic map r = a1 h1 + a2 h2 + a3 h3 + a4 h4 and distribution of
            θ.
        sample: Reduced radii within the ends.
        band: Half-width of the band around the sample's distribution function, in probability, in
            [0, 1).

    Returns:
        A of shape (inequalities, 4), for the ends x = (a2 lower, a2 upper, a4 lower, a4 upper) of
        the supports of both slopes, and b of shape (inequalities,).
    """
    # With F the sample's distribution function: the largest radius at the probability (F before a
    # step) + band must be the step's value or more, and the smallest radius at (F at the step) −
    # band must be the step's value or less.
    steps = sample.steps
    rises_in_lower_edge = steps.before + band < 1
    rises_in_upper_edge = steps.at - band > 0
    probability = np.concatenate(
        [(steps.before + band)[rises_in_lower_edge], (steps.at - band)[rises_in_upper_edge]]
    )
    values = np.concatenate([steps.values[rises_in_lower_edge], steps.values[rises_in_upper_edge]])
    is_lower_edge = np.arange(len(values)) < rises_in_lower_edge.sum()

    # r = a1 h1 + a2 h2 + a3 h3 + a4 h4, so a2 h2 + a4 h4 must be above or below `remaining`. As h4
    # is not positive, the largest radius has a2 upper and a4 lower.
    distribution = fit.distribution
    width = distribution.upper - distribution.lower
    xi = (distribution.quantile(probability) - distribution.lower) / width
    h1, h2, h3, h4 = _hermite_at(xi)
    remaining = values - fit.a1 * h1 - fit.a3 * h3
    zero = np.zeros_like(h2)
    largest = np.stack([zero, -h2, -h4, zero], axis=1)
    smallest = np.stack([h2, zero, zero, h4], axis=1)
    matrix = np.where(is_lower_edge[:, None], largest, smallest)
    return matrix, np.where(is_lower_edge, -remaining, remaining)
