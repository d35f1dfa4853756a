"""Area-weighted distribution of r_n, with bootstrap bands (eq. 8, eq. 9, eq. 10, Figs. 12, 13)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import require


@dataclass(frozen=True, eq=False)
class AreaWeighted:
    """Weighted sample of r_n: a value's weight is the share of area or volume of its cell (eq. 9).

    Args:
        values: r_n, shape (n,); sorted when built by `from_values`.
        weights: shape (n,), sum 1.
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
        """Sample with the values sorted, the weights scaled to the sum 1, the groups numbered.

        By default weights are equal, and each value is a group.
        """
        values = np.asarray(values, float).ravel()
        weights = np.ones_like(values) if weights is None else np.asarray(weights, float).ravel()
        groups = np.arange(len(values)) if groups is None else np.asarray(groups).ravel()
        numbers = np.unique(groups, return_inverse=True)[1]
        order = np.argsort(values, kind="stable")
        return cls(values[order], weights[order] / weights.sum(), numbers[order])

    @cached_property
    def cumulated(self) -> Array:
        """Σ of the weights up to each value, shape (n,)."""
        return np.asarray(np.minimum(np.cumsum(self.weights), 1.0))

    @cached_property
    def steps(self) -> tuple[Array, Array, Array]:
        """Distinct values, and the distribution function before and at each, shape (k,) each."""
        step = np.append(np.diff(self.values) > 0, True)
        at = self.cumulated[step]
        return self.values[step], np.append(0.0, at[:-1]), at

    def cdf(self, radius: ArrayLike) -> Array:
        """Return the fraction of area with r_n ≤ radius, any shape."""
        count = np.searchsorted(self.values, radius, side="right")
        return np.asarray(np.append(0.0, self.cumulated)[count])

    def quantile(self, share: ArrayLike) -> Array:
        """Least value with at least `share` of the area at or below it, any shape."""
        row = np.searchsorted(self.cumulated, np.asarray(share) - 1e-12)
        return np.asarray(self.values[np.minimum(row, len(self.values) - 1)])

    @property
    def mean(self) -> float:
        """Mean of r_n."""
        return float(self.weights @ self.values)

    def share_within(self, lower: float, upper: float) -> float:
        """Return the fraction of area with lower ≤ r_n ≤ upper."""
        return float(self.weights[(self.values >= lower) & (self.values <= upper)].sum())

    def limits(self, share: float) -> tuple[float, float]:
        """Return limits of r_n with the fraction `share` of area between, equal ones outside."""
        return float(self.quantile((1 - share) / 2)), float(self.quantile((1 + share) / 2))

    def truncated(self, lower: float, upper: float) -> AreaWeighted:
        """Return the part within limits of r_n, of sum 1; refuse fewer than ten values."""
        inside = (self.values >= lower) & (self.values <= upper)
        count = int(inside.sum())
        value = f"[{lower:g}, {upper:g}] with {count} reduced radii"
        allowed, cure = "limits that contain ten or more", "take more particles"
        require(count >= 10, "limits", value=value, allowed=allowed, cure=cure)
        return AreaWeighted.from_values(
            self.values[inside], self.weights[inside], self.groups[inside]
        )

    def capped(self, most: float) -> AreaWeighted:
        """The same sample, its values above `most` taken as `most`."""
        return AreaWeighted(np.minimum(self.values, most), self.weights, self.groups)

    def bootstrap_weights(self, number: int, generator: np.random.Generator) -> Iterator[Array]:
        """Yield the weights of the values, (n,), sum 1, in each of `number` samples of groups."""
        count = int(self.groups.max()) + 1
        for _ in range(number):
            repetitions = np.bincount(generator.integers(count, size=count), minlength=count)
            weights = self.weights * repetitions[self.groups]
            yield weights / weights.sum()

    def band_half_width(self, level: float, number: int, generator: np.random.Generator) -> float:
        """Half width of the simultaneous bootstrap band of the distribution function F.

        It is the `level` quantile of sup |F* − F| over `number` resampled functions F*.

        Raises:
            RefusedError: There are fewer than five groups to draw from.
        """
        groups = int(self.groups.max()) + 1
        allowed = "five packings, or cells in five of the 25 patches of a section, or more"
        cure = "take more particles, and check the size of the section"
        require(groups >= 5, "groups of the bootstrap", value=groups, allowed=allowed, cure=cure)
        is_step = np.append(np.diff(self.values) > 0, True)  # the last of equal values
        distances = [
            np.abs((np.cumsum(weights) - self.cumulated)[is_step]).max()
            for weights in self.bootstrap_weights(number, generator)
        ]
        return float(np.quantile(distances, level))
