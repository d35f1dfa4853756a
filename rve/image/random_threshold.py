"""A random threshold: E over τ between proved bounds, its mean and its quantiles.

The stiffness falls as τ rises where the brighter phase is the stiffer one. Between two values of τ
it lies between the lower bound at the greater and the upper bound at the smaller; beyond the ends,
between those and the pure phases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.cuts import ImageBox, solve_cuts
from alphacut.rve.image.fields.conjugate_gradient import ConjugateGradient
from alphacut.rve.image.moduli import ModuliInterval, PlaneModuli
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class NormalThreshold:
    """Normal law of the threshold whose parameters may be intervals, as at one α-level.

    Args:
        mean: Least and greatest mean, in grey levels.
        deviation: Least and greatest standard deviation, in grey levels.

    Raises:
        ValueError: An interval runs backwards, or a deviation is not positive.
    """

    mean: tuple[float, float]
    deviation: tuple[float, float]

    def __post_init__(self) -> None:
        if not (self.mean[0] <= self.mean[1] and 0 < self.deviation[0] <= self.deviation[1]):
            raise ValueError(
                f"the law of the threshold has the mean {self.mean} and the deviation "
                f"{self.deviation}; intervals must rise and deviations be positive"
            )

    def probability(self, threshold: Array) -> tuple[Array, Array]:
        """Least and greatest probability of a threshold up to the given values.

        The distribution function is monotone in the mean and, at each value, in the deviation: its
        extremes are at corners.
        """
        values = [ndtr((threshold - m) / s) for m in self.mean for s in self.deviation]
        return np.minimum.reduce(values), np.maximum.reduce(values)


@dataclass(frozen=True)
class ThresholdResponse:
    """E of eq. 16 over the threshold, falling.

    Args:
        threshold: Nodes, rising, shape (n,).
        lower: Lower bound at each node, in Pa.
        upper: Upper bound at each node, in Pa.
        pure: Lower bound for the dark phase alone and upper bound for the bright one, in Pa.
    """

    threshold: Array
    lower: Array
    upper: Array
    pure: tuple[float, float]

    def mean(self, law: NormalThreshold) -> tuple[float, float]:
        """Proved bounds of the mean of E over all laws of the interval, in Pa."""
        least, greatest = law.probability(self.threshold)
        below = np.diff(least, prepend=0.0, append=1.0) @ np.append(self.lower, self.pure[0])
        above = np.diff(greatest, prepend=0.0, append=1.0) @ np.append(self.pure[1], self.upper)
        return float(below), float(above)

    def quantile(self, law: NormalThreshold, share: float) -> tuple[float, float]:
        """Proved bounds of the E that is not exceeded with probability `share`, in Pa.

        It is E at the threshold that is not exceeded with probability 1 − share.
        """
        least, greatest = law.probability(self.threshold)
        after = int(np.searchsorted(least, 1 - share, side="left"))  # nodes certainly not before it
        before = int(np.searchsorted(greatest, 1 - share, side="right"))  # nodes certainly before
        low = self.lower[after] if after < len(self.lower) else self.pure[0]
        high = self.upper[before - 1] if before else self.pure[1]
        return float(low), float(high)


def threshold_response(
    grey: Array,
    thresholds: Sequence[float],
    phases: Sequence[ModuliInterval],
    *,
    aspect: float = 1.0,
    solver: ConjugateGradient | None = None,
) -> ThresholdResponse:
    """E over the threshold of two phases.

    Args:
        grey: Grey values, shape (rows, columns).
        thresholds: Nodes, rising.
        phases: Moduli of the darker and of the brighter phase, the stiffer in K + G/3 and in G.
        aspect: Height of a pixel over its width.
        solver: Stopping rule.

    Raises:
        ValueError: The phases have no such order, so E need not fall with the threshold.
    """
    dark, bright = phases
    if not (bright.lower.bulk >= dark.upper.bulk and bright.lower.shear >= dark.upper.shear):
        raise ValueError(
            "a random threshold needs a brighter phase that is stiffer in K + G/3 and in G; "
            "a fuzzy threshold, whose cuts need no order, does not"
        )
    boxes = [ImageBox([(value, value)], phases) for value in thresholds]
    cuts = solve_cuts(grey, boxes, aspect=aspect, solver=solver)
    ends = np.array([cut.bounds.modulus for cut in cuts])
    lower = np.maximum.accumulate(ends[::-1, 0])[::-1]  # E exceeds before what it falls to later
    upper = np.minimum.accumulate(ends[:, 1])
    pure = _modulus(dark.lower)[0], _modulus(bright.upper)[1]
    return ThresholdResponse(np.array(thresholds, float), lower, upper, pure)


def _modulus(moduli: PlaneModuli) -> tuple[float, float]:
    """E of eq. 16 of one material, in Pa."""
    k, g = moduli.bulk, moduli.shear
    stiffness = np.array([[k + g, k - g, 0], [k - g, k + g, 0], [0, 0, g]])
    return StiffnessBounds(stiffness, stiffness).modulus
