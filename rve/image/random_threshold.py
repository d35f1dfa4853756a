"""A random threshold: stiffness over τ between proved bounds, its mean and the quantiles of E.

The stiffness falls as τ rises where the brighter phase is the stiffer one, and rises with τ where
the darker one is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from alphacut.rve.image.bounds import StiffnessBounds
from alphacut.rve.image.cuts import ImageBox, each_cut
from alphacut.rve.image.fields.energy import UNIT
from alphacut.rve.image.fields.solver import Solver
from alphacut.rve.image.moduli import ModuliInterval
from alphacut.stochastic.theta.truncated_normal import Array

NODES = 65  # most thresholds at which an image is solved
REACH = 4.0  # deviations from the mean to the outermost nodes


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

    @property
    def mirrored(self) -> NormalThreshold:
        """The law of minus the threshold."""
        return NormalThreshold((-self.mean[1], -self.mean[0]), self.deviation)


def threshold_nodes(grey: Array, law: NormalThreshold) -> Array:
    """Thresholds at which the response over a law is wanted, rising.

    All images that a threshold within `REACH` deviations makes, where these are few: then each pair
    of nodes holds one image, and the mean is as close as that image's bounds. Else even steps. The
    next grey value on either side is a node too, since the image is the same up to there.

    Args:
        grey: Grey values, shape (rows, columns).
        law: Law of the threshold; the widest, where it is fuzzy.
    """
    reach = REACH * law.deviation[1]
    low, high = law.mean[0] - reach, law.mean[1] + reach
    values = np.unique(grey).astype(float)
    before, after = values[values < low][-1:], values[values > high][:1]
    values = values[(values >= low) & (values <= high)]
    if len(values) > NODES:
        return np.concatenate([before, np.linspace(low, high, NODES), after])
    values = np.concatenate([before, values, after])
    return np.sort(np.concatenate([values, np.nextafter(values, np.inf)]))


@dataclass(frozen=True, eq=False)
class ThresholdResponse:
    """Stiffness over the threshold of two phases, falling in the Loewner order with its argument.

    Args:
        argument: Nodes, rising, shape (n,): the threshold, or minus it where the dark phase is the
            stiffer one.
        lower: Below the stiffness at each node, shape (n, 3, 3), in Pa.
        upper: Above it, same shape.
        pure: Stiffness of the softer and of the stiffer phase alone, each (3, 3), in Pa: below and
            above what lies beyond the nodes.
        sign: 1, or −1 where the argument is minus the threshold.
    """

    argument: Array
    lower: Array
    upper: Array
    pure: tuple[Array, Array]
    sign: int = 1

    @property
    def threshold(self) -> Array:
        """Nodes as thresholds, in the order of the other arrays, shape (n,)."""
        return self.sign * self.argument

    @property
    def modulus(self) -> tuple[Array, Array]:
        """Bounds of E of eq. 16 at the nodes, each of shape (n,), in Pa, falling."""
        pairs = [StiffnessBounds(*pair) for pair in zip(self.lower, self.upper, strict=True)]
        for one in (*pairs, *(StiffnessBounds(pure, pure) for pure in self.pure)):
            one.require_rising("give the threshold as a fuzzy number, or phases of less contrast")
        ends = np.array([pair.modulus for pair in pairs])
        lower = np.maximum.accumulate(ends[::-1, 0])[::-1]  # E exceeds before what it falls to
        return lower, np.minimum.accumulate(ends[:, 1])

    def stiffness(self, law: NormalThreshold) -> StiffnessBounds:
        """Proved bounds of the mean stiffness over all laws of the interval.

        Between two nodes the stiffness lies between the lower bound at the greater and the upper
        bound at the smaller one; the law's least and greatest distribution functions are the
        extremes of the mean of what falls.
        """
        below, above = self._weights(law)
        lower = np.tensordot(below, np.concatenate([self.lower, self.pure[:1]]), axes=1)
        upper = np.tensordot(above, np.concatenate([self.pure[1:], self.upper]), axes=1)
        slack = (len(below) + 8) * UNIT * np.abs(self.pure[1]).sum() * np.eye(3)
        return StiffnessBounds(lower - slack, upper + slack)

    def mean(self, law: NormalThreshold) -> tuple[float, float]:
        """Proved bounds of the mean of E over all laws of the interval, in Pa."""
        below, above = self._weights(law)
        lower, upper = self.modulus
        low, high = below @ [*lower, self._pure[0]], above @ [self._pure[1], *upper]
        slack = (len(below) + 8) * UNIT * self._pure[1]
        return float(low - slack), float(high + slack)

    def quantile(self, law: NormalThreshold, share: float) -> tuple[float, float]:
        """Proved bounds of the E that is not exceeded with probability `share`, in Pa.

        It is E at the argument that is not exceeded with probability 1 − share.
        """
        lower, upper = self.modulus
        least, greatest = self._law(law).probability(self.argument)
        after = int(np.searchsorted(least, 1 - share, side="left"))  # nodes certainly not before it
        before = int(np.searchsorted(greatest, 1 - share, side="right"))  # nodes certainly before
        low = lower[after] if after < len(lower) else self._pure[0]
        high = upper[before - 1] if before else self._pure[1]
        return float(low), float(high)

    def _weights(self, law: NormalThreshold) -> tuple[Array, Array]:
        """Probabilities between the nodes, for the lower and for the upper mean, (n + 1,)."""
        least, greatest = self._law(law).probability(self.argument)
        return (np.diff(least, prepend=0.0, append=1.0), np.diff(greatest, prepend=0.0, append=1.0))

    def _law(self, law: NormalThreshold) -> NormalThreshold:
        return law if self.sign > 0 else law.mirrored

    @property
    def _pure(self) -> tuple[float, float]:
        """E of the softer and of the stiffer phase alone, in Pa."""
        low, high = self.pure
        return StiffnessBounds(low, low).modulus[0], StiffnessBounds(high, high).modulus[1]


def threshold_response(
    grey: Array,
    thresholds: Sequence[float] | Array,
    phases: Sequence[ModuliInterval],
    *,
    aspect: float = 1.0,
    solver: Solver | None = None,
    division: int = 1,
) -> ThresholdResponse:
    """Stiffness over the threshold of two phases.

    The nodes rise; the phases are the darker and the brighter one, one stiffer in K + G/3 and in G.
    The rest is as in `each_cut`.

    Raises:
        ValueError: The phases have no such order, so nothing need fall with the threshold.
    """
    soft, stiff, sign = ordered(phases)
    values = sign * grey.astype(float)
    argument = np.sort(sign * np.asarray(thresholds, float))
    # a pixel at the threshold is bright, so in the mirrored image not yet of the stiffer phase
    at = argument if sign > 0 else np.nextafter(argument, np.inf)
    boxes = [ImageBox([(value, value)], [soft, stiff]) for value in map(float, at)]
    cuts = each_cut(values, boxes, aspect=aspect, solver=solver, division=division)
    bounds = np.array([(cut.bounds.lower, cut.bounds.upper) for cut in cuts])
    pure = soft.lower.stiffness, stiff.upper.stiffness
    return ThresholdResponse(argument, bounds[:, 0], bounds[:, 1], pure, sign)


def ordered(phases: Sequence[ModuliInterval]) -> tuple[ModuliInterval, ModuliInterval, int]:
    """The softer and the stiffer phase, and −1 where the darker one is the stiffer."""
    dark, bright = phases
    for soft, stiff, sign in ((dark, bright, 1), (bright, dark, -1)):
        if stiff.lower.bulk >= soft.upper.bulk and stiff.lower.shear >= soft.upper.shear:
            return soft, stiff, sign
    raise ValueError(
        "a random threshold needs one phase that is stiffer in K + G/3 and in G; "
        "a fuzzy threshold, whose cuts need no order, does not"
    )
