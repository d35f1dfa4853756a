"""Triangular fuzzy slopes of the least p-box that contains a sample (section 4.2, Fig. 13).

Since h2 ≥ 0 ≥ h4, the maps with a2, a4 anywhere in their supports lie between two of them: the
least radius at each θ belongs to (lower end of a2, upper end of a4), the greatest to (upper end of
a2, lower end of a4). Containing the sample's distribution function save for a band of half width c,
staying monotone, and the area between the two bounds are all linear in the four ends: a linear
programme.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.polynomial import polynomial

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import SHAPES, SLOPES, HermiteFit, SlopeBand


@dataclass(frozen=True)
class PBox:
    """A Hermite map with fuzzy slopes a2, a4: lower end, modal value, upper end of each."""

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
    """P-box of least area around the fitted map that contains the sample's band.

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
    modal = fit.slopes(sample)
    limits = _support_limits(modal, None if required is None else required.monotone_part(fit))
    ends = _least_area_supports(fit, limits, *_containment(fit, sample, band))
    return PBox(fit, (ends[0], modal[0], ends[1]), (ends[2], modal[1], ends[3]))


def _support_limits(
    modal: tuple[float, float], required: SlopeBand | None
) -> list[tuple[float, float | None]]:
    """Limits of the supports (a2L, a2U, a4L, a4U) that contain modal and required slopes."""
    bands = ((), ()) if required is None else (required.a2, required.a4)
    a2, a4 = ((slope, *band) for slope, band in zip(modal, bands, strict=True))
    return [(0, min(a2)), (max(a2), None), (0, min(a4)), (max(a4), None)]


def _containment(fit: HermiteFit, sample: AreaWeighted, band: float) -> tuple[Array, Array]:
    """Matrix (k, 4) and right side (k,) by which (a2L, a2U, a4L, a4U) contain the sample's band."""
    # at each step of the sample's distribution function the greatest radius must reach the value
    # where the band's lower edge rises, and the least must not pass it where the upper edge does
    probability, values, is_lower_edge = _band_corners(sample, band)
    law = fit.distribution
    xi = (law.quantile(probability) - law.lower) / (law.upper - law.lower)
    h1, h2, h3, h4 = (polynomial.polyval(xi, h) for h in SHAPES)
    rest, zero = values - fit.a1 * h1 - fit.a3 * h3, np.zeros_like(h2)  # for a2 h2 + a4 h4
    greatest = np.stack([zero, -h2, -h4, zero], axis=1)
    least = np.stack([h2, zero, zero, h4], axis=1)
    matrix = np.where(is_lower_edge[:, None], greatest, least)
    return matrix, np.where(is_lower_edge, -rest, rest)


def _band_corners(sample: AreaWeighted, band: float) -> tuple[Array, Array, Array]:
    """Probability, value of each corner of the sample's band, whether of the lower edge, (k,)."""
    values, before, after = sample.steps
    lower, upper = before + band < 1, after - band > 0
    return (
        np.concatenate([(before + band)[lower], (after - band)[upper]]),
        np.concatenate([values[lower], values[upper]]),
        np.arange(lower.sum() + upper.sum()) < lower.sum(),
    )


def _least_area_supports(
    fit: HermiteFit, limits: list[tuple[float, float | None]], matrix: Array, right_side: Array
) -> list[float]:
    """Supports (a2L, a2U, a4L, a4U) of least area, by a linear program: matrix @ ends ≤ right."""
    from scipy.optimize import linprog

    monotone = np.zeros((4, SLOPES.shape[1], 4))
    for corner, (i, j) in enumerate(product((0, 1), (2, 3))):
        monotone[corner, :, i], monotone[corner, :, j] = -SLOPES[1], -SLOPES[3]
    h2, h4 = fit.mean_shapes
    result = linprog(
        [-h2, h2, -h4, h4],
        A_ub=np.concatenate([matrix, *monotone]),
        b_ub=np.concatenate([right_side, np.tile(fit.base_slopes + 1e-9, 4)]),
        bounds=limits,
    )
    if result.status != 0:
        what = f"no p-box of monotone cubics from {fit.a1:g} to {fit.a3:g}"
        raise FailedError(f"{what} contains the distribution", "widen the limits, or the band")
    return [float(x) for x in result.x]
