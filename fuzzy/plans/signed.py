"""Signed plan: known signs of effects name the corner of each bound."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from alphacut.fuzzy.knowledge.known import Signs
from alphacut.fuzzy.plans.monotonicity import Effects, Verification, require_few, verified, verify
from alphacut.fuzzy.plans.transformation import General
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Model
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Array


@dataclass(frozen=True)
class Signed:
    """Two corners per level where all effects have a sign, else the general method's points.

    Signs are stated by the caller (`Known.signs`), proved from a range of the gradient, or seen at
    probes. The bounds are guaranteed where all signs are stated or proved, and inner otherwise.

    Args:
        outputs: Outputs whose bounds matter; all if none is named. The others are printed as the
            samples happen to bound them, without an error unless they are proved.
        verification: How signs are looked for where they are not stated.
        limit: Samples that the plan may take where signs are missing.
    """

    outputs: tuple[str, ...] = ()
    verification: Verification = field(default_factory=Verification)
    limit: int = 10_000

    stepwise = True  # samples depend on those before

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Verify the signs, run the corners, rearrange them into α-cuts."""
        domain.require_free("Signed")
        memo = Memo(model)
        effects = verify(memo, domain, self.verification, outputs=self.outputs)
        model.report(0.5, last=True)
        require_few(_size(effects, domain), self.limit, effects.notes(domain))
        design = Design.from_levels(domain, self._points(effects, domain))
        result = design.bounds(memo(design.points), plan="signed")
        return verified(result, memo, effects)

    def _points(self, effects: Effects, domain: Domain) -> list[Array]:
        """Corners that the signs name, times the general method's points of other inputs."""
        grids = General().grids(domain)
        return [
            _level_points(np.unique(signs, axis=0), grid)
            for signs, grid in zip(effects.signs, grids, strict=True)
        ]


def _size(effects: Effects, domain: Domain) -> int:
    """Samples of the plan, counted without listing them."""
    total = 0.0
    for signs, grid in zip(effects.signs, General().grids(domain), strict=True):
        counts = np.array([len(points) for points in grid])
        total += (
            2 * np.where(np.unique(signs == 0, axis=0), counts, 1).prod(axis=1, dtype=float).sum()
        )
    return int(total)


def _level_points(signs: Signs, grid: list[list[float]]) -> Array:
    rows: list[tuple[float, ...]] = []
    for pattern in np.unique(signs, axis=0):
        for sense in (1, -1):
            rows += product(
                *(_ends(points, sense * sign) for sign, points in zip(pattern, grid, strict=True))
            )
    return np.array(rows)


def _ends(points: list[float], sign: int) -> list[float]:
    """The first point where the effect rises, the last where it falls, all where it has no sign."""
    return points if sign == 0 else [points[0 if sign > 0 else -1]]
