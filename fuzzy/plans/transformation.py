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
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import prod

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Known, Signs
from alphacut.fuzzy.plans.design import Design, of_samples, proving
from alphacut.fuzzy.plans.monotonicity import Effects, verify
from alphacut.fuzzy.refused import chosen, require
from alphacut.fuzzy.result import Bounds, Ends
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import FuzzyNumber

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
        inner: Whether there are points between the ends of a cut.

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
    def name(self) -> str:
        """The word for it in a case file."""
        return type(self).__name__.lower()

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
        return Design.from_levels(
            domain, [np.array(list(product(*grid))) for grid in self.grids(domain)]
        )

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Evaluate the samples and rearrange them into α-cuts."""
        domain.require_free(self.name)
        afford(self.size(domain), campaign, self.name)
        design = self.points(domain)
        bounds = design.bounds(campaign(design.points), self.name)
        return proving(bounds, campaign, corners_suffice(domain, bounds.outputs, campaign.known))


def corners_suffice(domain: Domain, outputs: Sequence[str], known: Known) -> Mask:
    """Outputs that are stated to be monotone in every input that has a width, shape (outputs,)."""
    lower, upper = domain.boxes
    monotone = known.monotone_in(domain.names, outputs)
    return np.asarray((monotone | (lower[0] == upper[0])).all(axis=1))


def afford(samples: float, campaign: Campaign, method: str) -> None:
    """Refuse a design that the budget does not carry, before any sample is run."""
    cure = f"the method {method} takes {samples:,.0f} evaluations here: take a larger budget,"
    cure += " fewer levels, state signs (Known) for Signed, or take Automatic"
    left, allowed = f"{campaign.left:,} evaluations", f"{samples:,.0f} or more"
    require(samples <= campaign.left, "budget", left, allowed, cure)


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
        outputs: Outputs whose bounds matter; all if none is named.
    """

    monotone: tuple[str, ...] | None = None
    outputs: tuple[str, ...] = ()

    def _refined(self, names: Sequence[str]) -> set[str]:
        for name in self.monotone or ():
            chosen("monotone input", name, names)
        return set(names) - set(self.monotone or ())

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Find the monotone inputs, evaluate the samples, rearrange them into α-cuts."""
        if self.monotone is not None:
            return super().run(campaign, domain)
        domain.require_free(self.name)
        effects = verify(campaign, domain, self.outputs)
        known = campaign.known.monotone_in(domain.names, effects.outputs)
        classes = (effects.signs[0] != 0) | known
        pairs = zip(domain.names, classes.all(axis=0), strict=True)
        plan = replace(self, monotone=tuple(name for name, holds in pairs if holds))
        design = plan.points(domain)
        afford(len(design.points), campaign, self.name)
        return _verified(design, campaign, effects, self.name)


@dataclass(frozen=True)
class Signed:
    """Two corners per level where all effects have a sign, else the general method's points.

    Signs are stated by the caller (`Known.signs`), verified by a range of the gradient, or seen at
    probes. The bounds are guaranteed where all signs are stated or verified, else attained.

    Args:
        outputs: Outputs whose bounds matter; all if none is named. The others are as the samples
            happen to bound them.
    """

    outputs: tuple[str, ...] = ()

    name = "signed"

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Verify the signs, run the corners, rearrange them into α-cuts."""
        domain.require_free(self.name)
        effects = verify(campaign, domain, self.outputs)
        afford(_size(effects, domain), campaign, self.name)
        design = Design.from_levels(domain, self._points(effects, domain))
        return _verified(design, campaign, effects, self.name)

    def _points(self, effects: Effects, domain: Domain) -> list[Array]:
        """Corners that the signs name, times the general method's points of other inputs."""
        grids = General().grids(domain)
        return [
            _level_points(np.unique(signs, axis=0), grid)
            for signs, grid in zip(effects.signs, grids, strict=True)
        ]


def _verified(design: Design, campaign: Campaign, effects: Effects, method: str) -> Bounds:
    """Bounds from the samples of a design, proved where all signs are stated or verified."""
    corners = design.bounds(campaign(design.points), method)
    proved = np.isin(corners.outputs, np.array(effects.outputs)[effects.proved.all(axis=(0, 2))])
    judged = proving(corners, campaign, proved)
    bounds = of_samples(design.domain, campaign.samples, method)
    return replace(
        bounds,
        nature=judged.nature,
        natures=judged.natures,
        basis=judged.basis,
        inner=Ends(bounds.lower, bounds.upper),
        notes=effects.notes(design.domain),
    )


def _size(effects: Effects, domain: Domain) -> float:
    """Samples of the plan, counted without listing them."""
    total = 0.0
    for signs, grid in zip(effects.signs, General().grids(domain), strict=True):
        counts = np.array([len(points) for points in grid], float)
        patterns = np.unique(signs == 0, axis=0)
        total += 2 * np.where(patterns, counts, 1.0).prod(axis=1).sum()
    return total


def _level_points(signs: Signs, grid: list[list[float]]) -> Array:
    rows: list[tuple[float, ...]] = []
    for pattern in np.unique(signs, axis=0):
        for sense in (1, -1):
            pairs = zip(pattern, grid, strict=True)
            rows += product(*(_ends(points, sense * sign) for sign, points in pairs))
    return np.array(rows)


def _ends(points: list[float], sign: int) -> list[float]:
    """The first point where the effect rises, the last where it falls, all where it has no sign."""
    return points if sign == 0 else [points[0 if sign > 0 else -1]]
