"""Fit of the radius map to a sample by f_r dr = f_θ dθ and least squares (section 4.2).

The map that carries the law of θ to the sample is r(θ) = Q(F_Θ(θ)), Q the sample's quantile
function: a staircase. Its distance to the Hermite cubic, ∫ (r − H)² f_Θ dθ, is a quadratic in (a2,
a4) whose integrals over the steps are known in closed form. Where the minimiser is not monotone,
the nearest monotone one in the same norm is taken.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import product
from typing import ClassVar

import numpy as np
from numpy.polynomial import Polynomial, polynomial
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.radius_map import HermiteMap
from alphacut.stochastic.theta.distribution import TruncatedNormal
from alphacut.stochastic.theta.quadrature import gauss_rule

# h1 … h4 of eq. 12 in powers of ξ
SHAPES = np.array([[1.0, 0, -3, 2], [0, 1, -2, 1], [0, 0, 3, -2], [0, 0, -1, 1]])
XI = np.linspace(0, 1, 401)
# least slope at the points XI, in units of a3 − a1: keeps it positive between them
MARGIN = 2e-5
STEEPEST = 3.0  # times the chord's slope, up to which both slopes make a monotone cubic
# their slopes, shape (4, 401)
SLOPES = np.array([polynomial.polyval(XI, polynomial.polyder(h)) for h in SHAPES])


@dataclass(frozen=True)
class HermiteFit:
    """Least-squares fit of the slopes a2, a4 of a Hermite map between two limits a1, a3 of r_n."""

    a1: float
    a3: float

    distribution: ClassVar[TruncatedNormal] = TruncatedNormal()

    def slopes(self, sample: AreaWeighted, weights: Array | None = None) -> tuple[float, float]:
        """Slopes a2, a4 of the monotone cubic H nearest to the sample between the limits.

        The distance is ∫ (Q(F_Θ(θ)) − H(θ))² f_Θ dθ, Q the quantile function of the sample; the
        bootstrap gives its values other weights.
        """
        cumulated = sample.cumulated if weights is None else np.minimum(np.cumsum(weights), 1.0)
        probability = np.concatenate([[0.0], cumulated])
        probability[-1] = 1.0
        # normal equations: ∫ h_i (Q − a1 h1 − a3 h3) f_Θ dθ, Q constant between probabilities
        weights_at_nodes, shape = self._shapes_at_nodes
        ends = shape[[1, 3]] * weights_at_nodes @ (self.a1 * shape[0] + self.a3 * shape[2])
        right_side = np.diff(self._integrals(probability), axis=1) @ sample.values - ends
        best = np.asarray(np.linalg.solve(self._gram, right_side), float)
        a2, a4 = best if self.is_monotone(best) else self._nearest_monotone(best)
        return float(max(a2, 0)), float(max(a4, 0))

    def map(self, slopes: tuple[float, float]) -> HermiteMap:
        """Return the radius map with slopes (a2, a4)."""
        return HermiteMap(self.a1, slopes[0], self.a3, slopes[1], self.distribution)

    def misfit(self, sample: AreaWeighted, slopes: tuple[float, float]) -> float:
        """Root mean square over θ of the sample's quantiles less the map with slopes (a2, a4)."""
        probability = (np.arange(20_000) + 0.5) / 20_000
        fitted = self.map(slopes)(self.distribution.quantile(probability))
        return float(np.sqrt(np.mean((sample.quantile(probability) - fitted) ** 2)))

    @cached_property
    def _powers(self) -> Array:
        """Functions h2 and h4 in powers of θ, shape (2, 4)."""
        law = self.distribution
        xi = Polynomial([-law.lower, 1.0]) / (law.upper - law.lower)
        return np.array([Polynomial(h)(xi).coef for h in SHAPES[[1, 3]]])

    def _integrals(self, probability: Array) -> Array:
        """Integrals ∫ h_i f_Θ dθ of h2, h4 up to quantiles of probabilities (n,), (2, n)."""
        # the moments ∫ θ^k f_Θ dθ follow from each other by partial integration, as f' = −θ f
        law = self.distribution
        theta = law.quantile(probability)
        density, first = law.pdf(theta), law.pdf(law.lower)
        moments = [probability, first - density]
        for k in (2, 3):
            ends = law.lower ** (k - 1) * first - theta ** (k - 1) * density
            moments.append((k - 1) * moments[k - 2] + ends)
        return np.asarray(self._powers @ np.array(moments))

    @cached_property
    def _shapes_at_nodes(self) -> tuple[Array, Array]:
        """Weights (8,) of a Gauss rule of f_Θ, and h1 … h4 at its nodes, shape (4, 8)."""
        rule = gauss_rule(self.distribution, points=8)
        law = self.distribution
        xi = (rule.nodes - law.lower) / (law.upper - law.lower)
        return rule.weights, np.array([polynomial.polyval(xi, h) for h in SHAPES])

    @cached_property
    def _gram(self) -> Array:
        """Gram matrix ∫ h_i h_j f_Θ dθ of h2 and h4, shape (2, 2)."""
        weights, shape = self._shapes_at_nodes
        return np.asarray(shape[[1, 3]] * weights @ shape[[1, 3]].T)

    @property
    def base_slopes(self) -> Array:
        """Slopes of the map at the points XI with a2 = a4 = 0, less a margin, shape (401,)."""
        return np.asarray(self.a1 * SLOPES[0] + self.a3 * SLOPES[2] - MARGIN * (self.a3 - self.a1))

    def is_monotone(self, slopes: ArrayLike) -> bool:
        """Return whether the map with slopes (a2, a4) rises at all points XI."""
        return bool((self.base_slopes + np.asarray(slopes) @ SLOPES[[1, 3]] >= -1e-12).all())

    @property
    def mean_shapes(self) -> tuple[float, float]:
        """Means ∫ h2 f_Θ dθ and ∫ |h4| f_Θ dθ."""
        weights, shape = self._shapes_at_nodes
        return float(weights @ shape[1]), float(-weights @ shape[3])

    def _nearest_monotone(self, best: Array) -> Array:
        """Slopes (2,) of the monotone map nearest to the map with slopes `best` (2,)."""
        # least distance programming by non-negative least squares (Lawson, Hanson 1974, chapter
        # 23): the least |x| with G x ≥ h, x = Lᵀ (slopes − best) and L Lᵀ the Gram matrix
        from scipy.optimize import nnls

        L = np.linalg.cholesky(self._gram)
        G_transposed = np.linalg.solve(L, SLOPES[[1, 3]])
        h = -self.base_slopes - SLOPES[[1, 3]].T @ best  # what each slope lacks
        scale = np.linalg.norm(G_transposed, axis=0)
        system = np.vstack([G_transposed / scale, h / scale])
        weights, _ = nnls(system, np.array([0.0, 0.0, 1.0]))
        residual = system @ weights - (0, 0, 1)
        return np.asarray(best + np.linalg.solve(L.T, -residual[:2] / residual[2]))


@dataclass(frozen=True)
class SlopeBand:
    """Lower end, fitted value and upper end of each slope in their joint band."""

    a2: tuple[float, float, float]
    a4: tuple[float, float, float]

    def monotone_part(self, fit: HermiteFit) -> SlopeBand:
        """Largest part of the band around the fitted slopes with four monotone corners."""
        # slopes beyond are those of no radius map. The ends are cut at slopes from zero to three
        # times the chord's (Fritsch and Carlson 1980), then moved towards the fitted ones until all
        # corners rise
        chord = fit.a3 - fit.a1
        least, greatest = MARGIN * chord, (STEEPEST - 4 * MARGIN) * chord
        lower, fitted, upper = np.array([self.a2, self.a4]).T
        lower = np.minimum(np.clip(lower, least, greatest), fitted)
        upper = np.maximum(np.clip(upper, least, greatest), fitted)
        for fraction in np.linspace(1, 0, 201):
            low, high = fitted + fraction * (lower - fitted), fitted + fraction * (upper - fitted)
            if all(map(fit.is_monotone, product(*zip(low, high, strict=True)))):
                break
        ends = zip(low, fitted, high, strict=True)
        a2, a4 = ((float(x), float(y), float(z)) for x, y, z in ends)
        return SlopeBand(a2, a4)


def slope_band(
    fit: HermiteFit,
    sample: AreaWeighted,
    *,
    level: float,
    resamples: int,
    generator: np.random.Generator,
) -> SlopeBand:
    """Fitted slopes and their joint band of confidence `level` in (0, 1), by the bootstrap.

    The half width is a quantile of Student's t, with one degree of freedom less than there are
    groups, times the bootstrap standard error; the probability of error is halved (Bonferroni).
    """
    from scipy.special import stdtrit

    a2, a4 = fit.slopes(sample)
    weights = sample.bootstrap_weights(resamples, generator)
    errors = np.std([fit.slopes(sample, w) for w in weights], axis=0, ddof=1)
    quantile = float(stdtrit(sample.groups.max(), 1 - (1 - level) / 4))
    a2_half, a4_half = (quantile * float(error) for error in errors)
    return SlopeBand((a2 - a2_half, a2, a2 + a2_half), (a4 - a4_half, a4, a4 + a4_half))


@dataclass(frozen=True)
class PBox:
    """A Hermite map with fuzzy slopes a2, a4: lower end, nominal value, upper end of each."""

    fit: HermiteFit
    a2: tuple[float, float, float]
    a4: tuple[float, float, float]

    def bounds(self, theta: Array) -> tuple[Array, Array]:
        """Return least and greatest radius at `theta`, two arrays of its shape."""
        least, greatest = (self.a2[0], self.a4[2]), (self.a2[2], self.a4[0])
        return self.fit.map(least)(theta), self.fit.map(greatest)(theta)

    @property
    def area(self) -> float:
        """Area between the two distribution functions, in units of r_n."""
        h2, h4 = self.fit.mean_shapes
        return (self.a2[2] - self.a2[0]) * h2 + (self.a4[2] - self.a4[0]) * h4

    def excess(self, sample: AreaWeighted) -> float:
        """Largest distance, a probability, of the sample's distribution outside the p-box."""
        values, before, after = sample.steps
        law = self.fit.distribution
        theta = np.asarray(np.linspace(law.lower, law.upper, 20_001), float)
        least_radius, greatest_radius = self.bounds(theta)
        probability = law.cdf(theta)
        lower_cdf = np.interp(values, greatest_radius, probability)
        upper_cdf = np.interp(values, least_radius, probability)
        return float(max((lower_cdf - before).max(), (after - upper_cdf).max(), 0.0))


def least_pbox(
    fit: HermiteFit, sample: AreaWeighted, band: float, *, required: SlopeBand | None = None
) -> PBox:
    """P-box of least area around the map fitted to a sample of r_n that contains the sample's band.

    Args:
        fit: Ends of the map and law of θ.
        sample: r_n within the ends.
        band: Half width of the band by which the p-box may miss the sample's distribution function,
            in probability, in [0, 1).
        required: Slopes that the supports must contain as well, as far as their maps are monotone,
            such as their bootstrap band: where data are few, the misfit alone is little fuzzy.

    Raises:
        FailedError: No p-box of monotone cubics with these ends contains the sample.
    """
    # a linear program in the ends of the supports, (a2L, a2U, a4L, a4U): which contain these slopes
    from scipy.optimize import linprog

    a2, a4 = fit.slopes(sample)
    part = SlopeBand((a2,) * 3, (a4,) * 3) if required is None else required.monotone_part(fit)
    inner_a2, inner_a4 = (a2, *part.a2), (a4, *part.a4)
    limits = [(0, min(inner_a2)), (max(inner_a2), None), (0, min(inner_a4)), (max(inner_a4), None)]
    # at each step of the sample's distribution function the greatest radius must reach the value
    # where the band's lower edge rises, and the least must not pass it where the upper edge does
    steps, before, after = sample.steps
    lower, upper = before + band < 1, after - band > 0
    probability = np.concatenate([(before + band)[lower], (after - band)[upper]])
    values = np.concatenate([steps[lower], steps[upper]])
    is_lower_edge = np.arange(len(values)) < lower.sum()
    law = fit.distribution
    xi = (law.quantile(probability) - law.lower) / (law.upper - law.lower)
    h1, h2, h3, h4 = (polynomial.polyval(xi, h) for h in SHAPES)
    rest, zero = values - fit.a1 * h1 - fit.a3 * h3, np.zeros_like(h2)  # for a2 h2 + a4 h4
    greatest = np.stack([zero, -h2, -h4, zero], axis=1)
    least = np.stack([h2, zero, zero, h4], axis=1)
    containment = np.where(is_lower_edge[:, None], greatest, least)
    monotone = np.zeros((4, SLOPES.shape[1], 4))  # of the maps at the four corners
    for corner, (i, j) in enumerate(product((0, 1), (2, 3))):
        monotone[corner, :, i], monotone[corner, :, j] = -SLOPES[1], -SLOPES[3]
    h2, h4 = fit.mean_shapes
    result = linprog(
        [-h2, h2, -h4, h4],
        A_ub=np.concatenate([containment, *monotone]),
        b_ub=np.append(np.where(is_lower_edge, -rest, rest), np.tile(fit.base_slopes + 1e-9, 4)),
        bounds=limits,
    )
    if result.status != 0:
        what = f"no p-box of monotone cubics from {fit.a1:g} to {fit.a3:g}"
        raise FailedError(f"{what} contains the distribution", "widen the limits, or the band")
    least_a2, greatest_a2, least_a4, greatest_a4 = map(float, result.x)
    return PBox(fit, (least_a2, a2, greatest_a2), (least_a4, a4, greatest_a4))
