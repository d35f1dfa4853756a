"""Stiffness over a random threshold, its mean and the quantiles of E, level by level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.rve.image.cuts import nested
from alphacut.rve.image.model import ImageCut, ImageModel
from alphacut.rve.image.random_threshold import (
    ThresholdResponse,
    threshold_nodes,
    threshold_response,
)
from alphacut.stages.image.study import RANDOM, ImageStudy, Level, RandomThreshold
from alphacut.stochastic.theta.truncated_normal import Array


@dataclass(frozen=True)
class RandomResponse:
    """Responses of an image over its threshold.

    Args:
        random: The threshold.
        alpha: Levels, rising.
        by_level: Response for the phases at each level, and at their modal values (None).
    """

    random: RandomThreshold
    alpha: tuple[float, ...]
    by_level: dict[Level, ThresholdResponse]

    @property
    def modal(self) -> ThresholdResponse:
        """The response for the modal phases."""
        return self.by_level[None]

    @property
    def cuts(self) -> tuple[ImageCut, ...]:
        """Bounds of the mean stiffness and of its E at each level."""
        bounds = [self.by_level[a].stiffness(self.random.law(a)) for a in self.alpha]
        intervals = nested([b.modulus for b in bounds[::-1]])[::-1]
        return tuple(
            ImageCut(b, modulus, RANDOM, None, 0)
            for b, modulus in zip(bounds, intervals, strict=True)
        )

    @property
    def quantiles(self) -> Array:
        """Bounds of the quantiles of E at each level, shape (levels, shares, 2), in Pa."""
        found = np.array(
            [
                [self.by_level[a].quantile(self.random.law(a), s) for s in self.random.shares]
                for a in self.alpha
            ]
        )
        found[..., 0] = np.minimum.accumulate(found[::-1, :, 0])[::-1]
        found[..., 1] = np.maximum.accumulate(found[::-1, :, 1])[::-1]
        return found

    def width(self, threshold: Level, phases: Level) -> float:
        """Width of E of the mean stiffness, the law and the phases at levels, in Pa."""
        low, high = self.by_level[phases].stiffness(self.random.law(threshold)).modulus
        return high - low


def responses(study: ImageStudy, model: ImageModel, random: RandomThreshold) -> RandomResponse:
    """One response for each level's phases; crisp phases have one for all.

    Args:
        study: What is solved.
        model: How, with the division taken.
        random: Its threshold.

    Raises:
        ValueError: The phases have no order.
    """
    nodes = threshold_nodes(random.grey, random.law(study.alpha[0]))

    def solved(level: Level) -> ThresholdResponse:
        return threshold_response(
            random.grey,
            nodes,
            study.phases(level),
            aspect=model.aspect,
            solver=model.solver,
            division=model.parts,
        )

    by_level: dict[Level, ThresholdResponse] = {None: solved(None)}
    for level in study.alpha:
        same = study.phases(level) == study.phases(None)
        by_level[level] = by_level[None] if same else solved(level)
    return RandomResponse(random, study.alpha, by_level)
