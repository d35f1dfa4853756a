"""Transformation method: reduced, general and extended (Hanss, 2005), and the signed plan.

Level j of m counts m + 1 − j points per input: the ends of its cut, and between them the midpoints
of neighbouring points of the next level up. The general method runs the model on the grid of these
points, the reduced method on the corners of each cut only, the extended method takes the ends only
of those inputs in which the model is monotone. In the signed plan known signs of effects name the
corner of each bound.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, product
from math import prod

import numpy as np

from alphacut.fuzzy.campaign.workers import require
from alphacut.fuzzy.knowledge.known import Known, Signs
from alphacut.fuzzy.plans.monotonicity import Effects, Verification, require_few, verified, verify
from alphacut.fuzzy.samples.design import Design
from alphacut.fuzzy.samples.model import Memo, Model
from alphacut.fuzzy.samples.result import FuzzyResult
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import Array, FuzzyNumber, Mask

# of the support: points of different levels closer than this differ by round-off only, and are one
# point
_SAME = 1e-13


def hanss_points(
    number: FuzzyNumber, alpha: Sequence[float], *, inner: bool = True
) -> list[list[float]]:
    """Points of every level by Hanss' recursion.

    Args:
        number: A fuzzy number or interval.
        alpha: Rising levels.
        inner: Whether points between the ends of a cut are wanted.

    Returns:
        For each level, from the lowest, its points in rising order: n at the top (one where the cut
        is a single value, otherwise its two ends), n + 1 at the next level down, and so on.
    """
    known: list[float] = []  # in rising order
    rows: list[list[float]] = []
    for level in reversed(alpha):
        lower, upper = number.cut(level)
        between = (
            [(left + right) / 2 for left, right in pairwise(rows[-1])] if rows and inner else []
        )
        rows.append(
            [
                _settled(x, known, number.support.width)
                for x in ([lower, *between, upper] if lower < upper else [lower])
            ]
        )
    return rows[::-1]


def _settled(x: float, known: list[float], width: float) -> float:
    """The known point that differs from x by round-off only, otherwise x."""
    place = bisect_left(known, x - _SAME * width)
    if place < len(known) and known[place] - x <= _SAME * width:
        return known[place]
    known.insert(place, x)
    return x


@dataclass(frozen=True)
class _Transformation:
    """Base of the methods: a grid per level, and the retransformation."""

    @property
    def stepwise(self) -> bool:
        """All samples are known beforehand."""
        return False

    def _refined(self, names: Sequence[str]) -> set[str]:
        """Inputs that get the recursion's inner points."""
        raise NotImplementedError

    def grids(self, domain: Domain) -> list[list[list[float]]]:
        """For each level and input, the points in rising order."""
        refined = self._refined(domain.names)
        columns = []
        for name, number in domain.inputs.items():
            columns.append(hanss_points(number, domain.alpha, inner=name in refined))
        return [list(level) for level in zip(*columns, strict=True)]

    def size(self, domain: Domain) -> int:
        """Samples over all levels, counted without listing them."""
        return sum(prod(len(points) for points in grid) for grid in self.grids(domain))

    def points(self, domain: Domain) -> Design:
        """The samples of every level, each distinct one listed once."""
        require(self.size(domain), len(domain.names))
        return Design.from_levels(
            domain, [np.array(list(product(*grid))) for grid in self.grids(domain)]
        )

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Evaluate the samples and rearrange them into α-cuts."""
        domain.require_free(type(self).__name__)
        design = self.points(domain)
        result = design.bounds(model(design.points), plan=type(self).__name__.lower())
        return result.proving(
            lambda bounds: corners_suffice(bounds, model.known), model.known.words
        )


def corners_suffice(result: FuzzyResult, known: Known) -> Mask:
    """Bounds that corners prove: the output is stated to be monotone in every input."""
    lower, upper = result.domain.boxes
    monotone = known.monotone_in(result.inputs, result.outputs)
    return np.asarray((monotone[None] | (lower == upper)[:, None, :]).all(axis=2))


@dataclass(frozen=True)
class General(_Transformation):
    """General transformation method: all combinations of the recursion's points."""

    def _refined(self, names: Sequence[str]) -> set[str]:
        return set(names)


@dataclass(frozen=True)
class Reduced(_Transformation):
    """Reduced transformation method: corners of each cut; exact where monotone."""

    def _refined(self, names: Sequence[str]) -> set[str]:
        return set()


@dataclass(frozen=True)
class Extended(_Transformation):
    """Extended transformation method: ends of monotone inputs, all points of the others.

    Args:
        monotone: Inputs in which the model rises or falls throughout. If not given, what the caller
            knows of the model, and for the other inputs a verification at probes.
        verification: How monotonicity is looked for.
        outputs: Outputs whose bounds matter; all if none is named.
        limit: Samples that the plan may take where monotonicity is not found in enough inputs.
    """

    monotone: tuple[str, ...] | None = None
    verification: Verification = field(default_factory=Verification)
    outputs: tuple[str, ...] = ()
    limit: int = 10_000

    @property
    def stepwise(self) -> bool:
        """True if monotonicity is looked for first."""
        return self.monotone is None

    def _refined(self, names: Sequence[str]) -> set[str]:
        unknown = set(self.monotone or ()) - set(names)
        if unknown:
            raise ValueError(
                f"the monotone inputs name {sorted(unknown)}, which is no fuzzy input; there are"
                f" {list(names)}"
            )
        return set(names) - set(self.monotone or ())

    def run(self, model: Model, domain: Domain) -> FuzzyResult:
        """Find the monotone inputs, evaluate the samples, rearrange them into α-cuts."""
        if self.monotone is not None:
            known = replace(model.known, monotone=(*model.known.monotone, *self.monotone))
            result = super().run(model, domain)
            return result.proving(lambda bounds: corners_suffice(bounds, known), known.words)
        memo = Memo(model)
        effects = verify(memo, domain, self.verification, outputs=self.outputs)
        widest = effects.signs[0] != 0
        classes = (widest | model.known.monotone_in(domain.names, effects.outputs)).all(axis=0)
        names = tuple(name for name, holds in zip(domain.names, classes, strict=True) if holds)
        chosen = replace(self, monotone=names)
        model.report(0.5, last=True)
        require_few(chosen.size(domain), self.limit, effects.notes(domain))
        return verified(super(Extended, chosen).run(memo, domain), memo, effects)


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
