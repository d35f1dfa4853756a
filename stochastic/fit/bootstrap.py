"""Bootstrap bands of the fitted slopes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.stochastic.fit.area_weighted import AreaWeighted
from alphacut.stochastic.fit.hermite_fit import HermiteFit


@dataclass(frozen=True)
class SlopeBand:
    """Fitted slopes and the ends of their joint band.

    Args:
        a2: Lower end, fitted value, upper end of a2.
        a4: The same of a4.
        level: Probability with which both true slopes lie inside.
    """

    a2: tuple[float, float, float]
    a4: tuple[float, float, float]
    level: float

    def holds(self, a2: float, a4: float) -> bool:
        """True if both slopes lie in the band."""
        return self.a2[0] <= a2 <= self.a2[2] and self.a4[0] <= a4 <= self.a4[2]


def slope_band(
    fit: HermiteFit,
    sample: AreaWeighted,
    *,
    level: float,
    resamples: int,
    generator: np.random.Generator,
) -> SlopeBand:
    """Fitted slopes ± a quantile of Student's t times their bootstrap standard error.

    The miss is halved between the two slopes (Bonferroni); t has one degree of freedom less than
    there are groups to draw.

    Args:
        fit: Ends of the map and law of θ.
        sample: r_n within the ends.
        level: Joint level, in (0, 1).
        resamples: Bootstrap resamples, at least 2.
        generator: Source of chance.
    """
    from scipy.special import stdtrit

    fitted = fit.slopes(sample)
    drawn = np.array(
        [fit.slopes(sample, weights) for weights in sample.resampled(resamples, generator)]
    )
    half = float(stdtrit(sample.groups.max(), 1 - (1 - level) / 4)) * drawn.std(axis=0, ddof=1)
    ends = [
        (float(value - h), float(value), float(value + h))
        for value, h in zip(fitted, half, strict=True)
    ]
    return SlopeBand(ends[0], ends[1], level)
