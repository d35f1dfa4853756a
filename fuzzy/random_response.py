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

from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Values
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Array

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
        cls, result: FuzzyResult, curve: str, *, theta: str, quantile: Callable[[Array], Array]
    ) -> RandomResponse:
        """From an output that is a curve over θ.

        Args:
            result: A propagation whose samples hold the curve and its nodes.
            curve: Output with the response at the nodes.
            theta: Output with the nodes, rising.
            quantile: Quantile function of θ, any shape.
        """
        from scipy.interpolate import PchipInterpolator

        wanted = quantile((np.arange(_STRATA) + 0.5) / _STRATA)
        nodes, values = result.values.output(theta), result.values.output(curve)
        rows = [
            PchipInterpolator(nodes[i], values[i], extrapolate=True)(wanted)
            for i in range(len(nodes))
        ]
        return cls(result.domain, result.points, np.sort(np.array(rows), axis=1))

    def mean(self) -> FuzzyResult:
        """Fuzzy mean of the response; output `mean`."""
        return self._bounds("mean", self.ordered.mean(axis=1, keepdims=True))

    def p_box(self, at: ArrayLike) -> FuzzyResult:
        """Bounds of the distribution function at responses `at` (m,), on each cut."""
        return self._bounds("cdf", self._below(at))

    def exceedance(self, limit: ArrayLike) -> FuzzyResult:
        """Fuzzy probability that the response exceeds each limit (m,)."""
        return self._bounds("exceedance", 1 - self._below(limit))

    def quantile(self, probability: ArrayLike) -> FuzzyResult:
        """Fuzzy quantiles of the response at probabilities (m,) in (0, 1).

        Raises:
            ValueError: A probability lies outside (0, 1).
        """
        wanted = np.atleast_1d(np.asarray(probability, float))
        if not ((wanted > 0) & (wanted < 1)).all():
            raise ValueError(
                f"the probability of a quantile is {wanted.tolist()}; it must lie inside (0, 1)"
            )
        strata = (np.arange(self.ordered.shape[1]) + 0.5) / self.ordered.shape[1]
        return self._bounds(
            "quantile", np.array([np.interp(wanted, strata, row) for row in self.ordered])
        )

    def _below(self, at: ArrayLike) -> Array:
        """Probability of a response up to `at` (m,) at every sample, shape (n, m)."""
        responses = np.atleast_1d(np.asarray(at, float))
        if not np.isfinite(responses).all():
            raise ValueError(f"the responses are {responses.tolist()}; all must be finite")
        return np.array([_share_below(row, responses) for row in self.ordered])

    def _bounds(self, name: str, table: Array) -> FuzzyResult:
        """α-cuts of a quantity that each sample has, shape (n, m)."""
        values = Values(((name, table.shape[1:]),), table)
        result = Design.from_samples(self.domain, self.points).bounds(values, plan="polymorphic")
        return replace(result, notes=(f"probabilities resolve to 1/{self.ordered.shape[1]}",))


def _share_below(ordered: Array, at: Array) -> Array:
    """Probability of a response up to `at`, linear between the strata."""
    strata = (np.arange(len(ordered)) + 0.5) / len(ordered)
    share: Array = np.interp(at, ordered, strata)
    return np.where(at < ordered[0], 0.0, np.where(at >= ordered[-1], 1.0, share))
