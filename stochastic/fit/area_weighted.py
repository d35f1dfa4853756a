"""Area-weighted distribution of r_n, with bootstrap bands (eq. 8, eq. 9, eq. 10, Figs. 12, 13)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import require


class Steps(NamedTuple):
    """Steps of a distribution function, arrays of shape (k,).

    Args:
        values: Rising values at which the function steps up.
        before: The function before each step.
        at: The function at each step.
    """

    values: Array
    before: Array
    at: Array


@dataclass(frozen=True, eq=False)
class AreaWeighted:
    """Weighted sample of reduced radii r_n (eq. 9).

    The weight of a value is the fraction of the area or volume that its cell takes.

    Args:
        values: Reduced radii r_n, shape (n,); sorted when built by `from_values`.
        weights: Weights, shape (n,), sum 1.
        groups: Number of each value's packing, or of its patch of a section, shape (n,); the
            bootstrap draws groups.
    """

    values: Array
    weights: Array
    groups: Ints

    @classmethod
    def from_values(
        cls, values: ArrayLike, weights: ArrayLike | None = None, groups: ArrayLike | None = None
    ) -> AreaWeighted:
        """Return a sample with sorted values, weights of the sum 1, and numbered groups.

        Args:
            values: Reduced radii in any order and shape, n of them, at least one.
            weights: Area or volume of the cell of each value, n of them in the same order, with a
                positive sum; equal by default.
            groups: Label of the group of each value, such as the number of its packing, n in the
                same order; the bootstrap draws whole groups. By default each value is a group.

        Returns:
            New arrays of shape (n,) in the order of rising values, with the labels replaced by the
            numbers 0, 1, … of their order. Lengths and values are not checked.
        """
        values = np.asarray(values, float).ravel()
        if weights is None:
            weights = np.ones_like(values)
        if groups is None:
            groups = np.arange(len(values))
        weights = np.asarray(weights, float).ravel()
        _, numbers = np.unique(np.asarray(groups).ravel(), return_inverse=True)
        order = np.argsort(values, kind="stable")
        return cls(values[order], weights[order] / weights.sum(), numbers[order])

    @cached_property
    def cumulated(self) -> Array:
        """Sum of the weights up to each value, shape (n,); rounding does not pass 1."""
        return np.asarray(np.minimum(np.cumsum(self.weights), 1.0))

    @cached_property
    def steps(self) -> Steps:
        """Steps of the distribution function, one for each distinct value."""
        at = self.cumulated[self._is_step]
        return Steps(self.values[self._is_step], before=np.append(0.0, at[:-1]), at=at)

    @property
    def _is_step(self) -> Mask:
        """Whether each value is the last one of equal values, shape (n,)."""
        return np.append(np.diff(self.values) > 0, True)

    def cdf(self, radius: ArrayLike) -> Array:
        """Return the fraction of area with r_n ≤ radius, any shape."""
        count = np.searchsorted(self.values, radius, side="right")
        return np.asarray(np.append(0.0, self.cumulated)[count])

    def quantile(self, fraction: ArrayLike) -> Array:
        """Return the smallest value with at least this fraction of the area at or below it.

        Args:
            fraction: Fractions of the area (of the volume for spheres), any shape. Those of 0 or
                less give the smallest value, and those of 1 or more the largest one. 1e-12 is
                allowed for rounding of the cumulated weights.

        Returns:
            Values of the sample, in the shape of `fraction`.
        """
        # The first value at which the cumulated weight reaches the fraction
        row = np.searchsorted(self.cumulated, np.asarray(fraction) - 1e-12)
        return np.asarray(self.values[np.minimum(row, len(self.values) - 1)])

    @property
    def mean(self) -> float:
        """Mean of r_n."""
        return float(self.weights @ self.values)

    def fraction_within(self, lower: float, upper: float) -> float:
        """Return the fraction of area with lower ≤ r_n ≤ upper."""
        return float(self.weights[(self.values >= lower) & (self.values <= upper)].sum())

    def limits(self, fraction: float) -> tuple[float, float]:
        """Return limits of r_n with a fraction of the area between, as much below as above."""
        lower = self.quantile((1 - fraction) / 2)
        upper = self.quantile((1 + fraction) / 2)
        return float(lower), float(upper)

    def truncated(self, lower: float, upper: float) -> AreaWeighted:
        """Return a new sample of the values within limits, the weights scaled to the sum 1.

        Args:
            lower: Lower limit of the reduced radius r_n; a value that is equal to it is kept.
            upper: Upper limit; likewise.

        Raises:
            RefusedError: Fewer than ten values are within the limits.
        """
        inside = (self.values >= lower) & (self.values <= upper)
        count = int(inside.sum())
        value = f"[{lower:g}, {upper:g}] with {count} reduced radii"
        allowed = "limits that contain ten or more"
        require(count >= 10, "limits", value=value, allowed=allowed, cure="take more particles")
        return AreaWeighted.from_values(
            self.values[inside], self.weights[inside], self.groups[inside]
        )

    def capped(self, maximum: float) -> AreaWeighted:
        """Return the same sample with larger values replaced by `maximum`."""
        return AreaWeighted(np.minimum(self.values, maximum), self.weights, self.groups)

    def bootstrap_weights(self, number: int, generator: np.random.Generator) -> Iterator[Array]:
        """Yield the weights of the values in each of `number` bootstrap samples.

        A bootstrap sample has as many groups as there are, drawn with replacement. A group that is
        not drawn has the weight 0 in it, one that is drawn twice has twice its weight.

        Args:
            number: Number of bootstrap samples.
            generator: Source of the draws; its state moves on.

        Yields:
            Weights in the order of `values`, shape (n,), with the sum 1.
        """
        count = int(self.groups.max()) + 1
        for _ in range(number):
            # Whole groups are drawn: cells of one packing are not independent of each other.
            repetitions = np.bincount(generator.integers(count, size=count), minlength=count)
            weights = self.weights * repetitions[self.groups]
            yield weights / weights.sum()

    def band_half_width(self, level: float, number: int, generator: np.random.Generator) -> float:
        """Return the half-width of the simultaneous bootstrap band of the distribution function F.

        It is the quantile of sup |F* − F| over resampled functions F*, a probability. The band
        estimates where the distribution function lies; it proves nothing.

        Args:
            level: Confidence of the band, the probability of the quantile, in (0, 1).
            number: Number of resampled functions, at least 1.
            generator: Source of the bootstrap samples; its state moves on.

        Raises:
            RefusedError: There are fewer than five groups to draw from.
        """
        groups = int(self.groups.max()) + 1
        require(
            groups >= 5,
            "groups of the bootstrap",
            value=groups,
            allowed="five packings, or cells in five of the 25 patches of a section, or more",
            cure="take more particles, and check the size of the section",
        )
        distances = []
        for weights in self.bootstrap_weights(number, generator):
            # Both functions are constant between the values. Of equal values only the last one
            # counts, where the step is complete.
            differences = (np.cumsum(weights) - self.cumulated)[self._is_step]
            distances.append(np.abs(differences).max())
        return float(np.quantile(distances, level))
