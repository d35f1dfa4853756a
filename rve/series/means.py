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


_kept_rule = lru_cache(maxsize=256)(gauss_rule)


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


def settled_means(
    radius_map: RadiusMap,
    cells: Callable[[Array], CellModuli],
    *,
    points: int | None,
    accuracy: float,
) -> list[Mean]:
    """Each inclusion's mean, whose nodes are added until the mean moduli settle.

    Two finer rules tell how large the error of a rule is: its distance from them, with a margin.

    Args:
        radius_map: The map.
        cells: Moduli at n radii for m inclusions; cheap.
        points: Nodes, or None for as many as settle.
        accuracy: Relative error of every mean modulus that counts as settled.

    Raises:
        RuleError: No rule in reach settles.
        RefusedError: The map jumps, or gives radii outside (0, 1), or its law of θ is none.
    """
    require_continuous(radius_map)
    count = points or max(6, int(np.ceil(1 - 0.75 * np.log10(accuracy))))
    law = radius_map.distribution
    make_rule: Callable[..., ThetaRule] = _kept_rule if isinstance(law, Hashable) else gauss_rule
    averages: dict[int, _Averages] = {}
    means: dict[int, Mean] = {}
    while True:
        counts = [count, finer_count(count), finer_count(finer_count(count))]
        for n in counts:
            if n not in averages:
                rule = make_rule(law, points=n)
                averages[n] = _Averages(rule, cells(radius_map(rule.nodes)))
        coarse, finer, finest = (averages[n] for n in counts)
        left = _SAFETY * error_by_more_terms(coarse.moduli, finer.moduli, finest.moduli) + _NOISE
        for k in range(len(left)):
            if k not in means and (points or left[k].max() <= accuracy):
                # each inclusion by itself, whatever its companions need
                means[k] = _mean(coarse, finest, left[k], k)
        if len(means) == len(left):
            return [means[k] for k in range(len(left))]
        if counts[-1] >= _MOST_POINTS:
            raise RuleError(
                f"the rule of {count} nodes in θ leaves a relative error of {left.max():.1e};"
                f" {accuracy:.1e} is allowed: the radius map is not smooth",
                "allow a larger error, or give the number of nodes",
            )
        count = counts[1]


def _mean(result: _Averages, judge: _Averages, in_theta: Array, k: int) -> Mean:
    """Inclusion k by a rule; what the rule that judges it is off by is in no error yet."""
    return Mean(
        curve=StressCurve.from_stiffness(result.rule, result.cells.matrix[:, k]),
        errors={"space": np.maximum(result.errors[k], judge.errors[k]), "theta": in_theta},
        terms=int(result.cells.terms[:, k].max()),
    )


def finer_count(count: int) -> int:
    """Nodes of the next finer rule: a third more."""
    return count + max(2, count // 3)
