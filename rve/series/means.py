"""Means over θ of cells that a series solves: as many nodes as settle, to a declared error."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import FailedError
from alphacut.rve.result import StressCurve
from alphacut.rve.series.truncation import CellModuli, error_by_more_terms
from alphacut.rve.settings import require_continuous
from alphacut.stochastic import RadiusMap, ThetaRule, gauss_rule

_MOST_POINTS = 1200
_SAFETY = 1.6
_NOISE = 1e-13  # of a declared error: what rounding leaves


_cached_rule = lru_cache(maxsize=256)(gauss_rule)


class RuleError(FailedError):
    """No rule in θ reaches the wanted accuracy."""


@dataclass(frozen=True, eq=False)
class Mean:
    """One inclusion's cell over θ.

    Args:
        curve: With its stiffness.
        errors: Declared relative errors of the three mean moduli by source: space, theta.
        terms: Most terms of the series.
    """

    curve: StressCurve
    errors: dict[str, Array]
    terms: int


@dataclass(frozen=True, eq=False)
class _Averages:
    """All inclusions' cells at the nodes of one rule."""

    rule: ThetaRule
    cells: CellModuli

    @property
    def moduli(self) -> Array:
        """Means, shape (m, 3), in Pa."""
        return self.rule.mean(self.cells.moduli)

    @property
    def errors(self) -> Array:
        """Their relative errors by the series, shape (m, 3)."""
        return self.rule.mean(self.cells.moduli * self.cells.errors) / self.moduli


def converged_means(
    radius_map: RadiusMap,
    cells: Callable[[Array], CellModuli],
    *,
    points: int | None,
    accuracy: float,
) -> list[Mean]:
    """Means over θ for each inclusion, by Gauss rules refined until the mean moduli converge.

    The declared error of a rule is its distance from two finer rules, times a safety factor.

    Args:
        radius_map: Radius of the particle over θ.
        cells: Moduli at n radii for m inclusions.
        points: Nodes of the rule, or None for as many as the accuracy asks.
        accuracy: Relative error allowed for every mean modulus.

    Raises:
        RuleError: No rule of up to `_MOST_POINTS` nodes converges.
        RefusedError: The map jumps, or gives radii outside (0, 1), or its law of θ is none.
    """
    require_continuous(radius_map)
    count = points or max(6, int(np.ceil(1 - 0.75 * np.log10(accuracy))))
    law = radius_map.distribution
    make_rule: Callable[..., ThetaRule] = _cached_rule if isinstance(law, Hashable) else gauss_rule
    averages: dict[int, _Averages] = {}
    means: dict[int, Mean] = {}
    while True:
        counts = [count, finer_count(count), finer_count(finer_count(count))]
        for n in counts:
            if n not in averages:
                rule = make_rule(law, points=n)
                averages[n] = _Averages(rule, cells(radius_map(rule.nodes)))
        coarse, finer, finest = (averages[n] for n in counts)
        distance = error_by_more_terms(coarse.moduli, finer.moduli, finest.moduli)
        errors = _SAFETY * distance + _NOISE
        for k in range(len(errors)):
            if k not in means and (points or errors[k].max() <= accuracy):
                # each inclusion by itself, whatever the others need
                means[k] = _mean_of_inclusion(k, coarse, finest, errors[k])
        if len(means) == len(errors):
            return [means[k] for k in range(len(errors))]
        if counts[-1] >= _MOST_POINTS:
            raise RuleError(
                f"the rule of {count} nodes in θ leaves a relative error of {errors.max():.1e};"
                f" {accuracy:.1e} is allowed: the radius map is not smooth",
                "allow a larger error, or give the number of nodes",
            )
        count = counts[1]


def _mean_of_inclusion(k: int, coarse: _Averages, finest: _Averages, theta_error: Array) -> Mean:
    """Mean of inclusion k by the coarse rule; its error in space is the larger of both rules'."""
    return Mean(
        curve=StressCurve.from_stiffness(coarse.rule, coarse.cells.matrix[:, k]),
        errors={"space": np.maximum(coarse.errors[k], finest.errors[k]), "theta": theta_error},
        terms=int(coarse.cells.terms[:, k].max()),
    )


def finer_count(count: int) -> int:
    """Nodes of the next finer rule: a third more."""
    return count + max(2, count // 3)
