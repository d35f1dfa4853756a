"""Random response at every fuzzy sample: what it gives beyond its mean (section 3.2).

At each sample of the fuzzy inputs the response is a curve over the basic random variable θ, hence
has a distribution. Over a cut the distributions lie between two bounds, a p-box; a quantile and a
probability of exceeding a limit are fuzzy numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.campaign.values import Samples, Values
from alphacut.fuzzy.plans.design import of_samples
from alphacut.fuzzy.refused import real, require
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import Domain

_STRATA = 2000  # equally likely parts of θ: the resolution of a probability is 1 / _STRATA


@dataclass(frozen=True, eq=False)
class RandomResponse:
    """A response that is random at every sample of the fuzzy inputs.

    Args:
        domain: Fuzzy inputs and levels.
        points: Samples of the fuzzy inputs, shape (n, inputs).
        ordered: Responses at equally likely θ in rising order, shape (n, strata).
    """

    domain: Domain
    points: Array
    ordered: Array

    @classmethod
    def from_curves(
        cls,
        domain: Domain,
        points: Array,
        curves: Array,
        *,
        theta: Array,
        quantile: Callable[[Array], Array],
    ) -> RandomResponse:
        """From the response at nodes of θ.

        Args:
            domain: Fuzzy inputs and levels.
            points: Samples of the fuzzy inputs, shape (n, inputs).
            curves: Response at the nodes, shape (n, nodes).
            theta: Nodes, rising, shape (nodes,).
            quantile: Quantile function of θ, any shape.
        """
        from scipy.interpolate import PchipInterpolator

        at = quantile((np.arange(_STRATA) + 0.5) / _STRATA)
        values = PchipInterpolator(theta, curves, axis=1, extrapolate=True)(at)
        return cls(domain, points, np.sort(values, axis=1))

    def mean(self) -> Bounds:
        """Fuzzy mean of the response; output `mean`."""
        return self._bounds("mean", self.ordered.mean(axis=1, keepdims=True))

    def p_box(self, at: ArrayLike) -> Bounds:
        """Bounds of the distribution function at responses `at` (m,), on each cut."""
        return self._bounds("cdf", self._below(at))

    def exceedance(self, limit: ArrayLike) -> Bounds:
        """Fuzzy probability that the response exceeds each limit (m,)."""
        return self._bounds("exceedance", 1 - self._below(limit))

    def quantile(self, probability: ArrayLike) -> Bounds:
        """Fuzzy quantiles of the response at probabilities (m,) inside (0, 1)."""
        at = np.atleast_1d(np.asarray(probability, float))
        inside = ((at > 0) & (at < 1)).all()
        require(inside, "probability", at.tolist(), "values inside (0, 1)")
        strata = (np.arange(self.ordered.shape[1]) + 0.5) / self.ordered.shape[1]
        table = np.array([np.interp(at, strata, row) for row in self.ordered])
        return self._bounds("quantile", table)

    def _below(self, at: ArrayLike) -> Array:
        """Probability of a response up to `at` (m,) at every sample, shape (n, m)."""
        responses = np.array([real("response", x) for x in np.atleast_1d(at).tolist()])
        return np.array([_share_below(row, responses) for row in self.ordered])

    def _bounds(self, name: str, table: Array) -> Bounds:
        """α-cuts of a quantity that each sample has, shape (n, m)."""
        values = Values(((name, table.shape[1:]),), table)
        bounds = of_samples(self.domain, Samples(self.points, values), "stored samples")
        return replace(bounds, notes=(f"probabilities resolve to 1/{self.ordered.shape[1]}",))


def _share_below(ordered: Array, at: Array) -> Array:
    """Probability of a response up to `at`, linear between the strata."""
    strata = (np.arange(len(ordered)) + 0.5) / len(ordered)
    share: Array = np.interp(at, ordered, strata)
    return np.where(at < ordered[0], 0.0, np.where(at >= ordered[-1], 1.0, share))
