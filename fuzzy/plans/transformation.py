"""Transformation method: reduced, general and extended (Hanss, 2005), and the signed plan.

Level j of m counts m + 1 − j points per input: the ends of its cut, and between them the midpoints
of neighbouring points of the next level up. The general method runs the model on the grid of these
points, the reduced method on the corners of each cut only, the extended method takes the ends only
of those inputs in which the model is monotone. In the signed plan known signs of effects name the
corner of each bound.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import prod

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs
from alphacut.fuzzy.plans.design import Design, bounds_of_samples, guaranteed_bounds
from alphacut.fuzzy.plans.monotonicity import Effects, verify
from alphacut.fuzzy.refused import require
from alphacut.fuzzy.result import Bounds, Ends
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.numbers import FuzzyNumber

# share of the support: points of two levels closer than this differ by round-off only
_ROUND_OFF = 1e-13


def hanss_points(
    number: FuzzyNumber, alpha: Sequence[float], *, inner: bool = True
) -> list[list[float]]:
    """Return the points of every level by the recursion of the transformation method (Hanss 2005).

    Args:
        number: A fuzzy number or interval.
        alpha: Rising levels.
        inner: Whether to add points between the ends of a cut.

    Returns:
        For each level, from the lowest, its points in rising order: n at the top (one where the cut
        is a single value, otherwise its two ends), n + 1 at the next level down, and so on.
    """
    points: list[float] = []  # of all levels so far, in rising order
    by_level: list[list[float]] = []  # from the top down
    for level in reversed(alpha):
        lower, upper = number.cut(level)
        level_points = [lower]
        if lower < upper:
            if by_level and inner:
                level_points += [(left + right) / 2 for left, right in pairwise(by_level[-1])]
            level_points.append(upper)
        by_level.append([_listed_point(x, points, number.support.width) for x in level_points])
    return by_level[::-1]


def _listed_point(x: float, points: list[float], width: float) -> float:
    """The point in the sorted list that equals x but for round-off; else x, which is inserted."""
    index = bisect_left(points, x - _ROUND_OFF * width)
    if index < len(points) and points[index] - x <= _ROUND_OFF * width:
        return points[index]
    points.insert(index, x)
    return x


def grids(domain: Domain, refined: Collection[str]) -> list[list[list[float]]]:
    """Return the points of each level and input, rising, as a list by level of lists by input.

    Points between the ends of a cut are added for inputs in `refined` only.
    """
    columns = [
        hanss_points(number, domain.alpha, inner=name in refined)
        for name, number in domain.inputs.items()
    ]
    return [list(level) for level in zip(*columns, strict=True)]


def _full_design(
    campaign: Campaign, domain: Domain, refined: Collection[str], method: str
) -> Design:
    """Design with all combinations of the inputs' points on each level, within the budget."""
    levels = grids(domain, refined)
    require_budget(sum(prod(map(len, grid)) for grid in levels), campaign, method)
    return Design.from_levels(domain, [np.array(list(product(*grid))) for grid in levels])


def _bounds_of_combinations(
    campaign: Campaign, domain: Domain, refined: Collection[str], method: str
) -> Bounds:
    """Evaluate all combinations of points; their bounds, guaranteed where corners suffice."""
    design = _full_design(campaign, domain, refined, method)
    bounds = design.bounds(campaign(design.points), method)
    monotone = campaign.knowledge.monotone_in(domain.names, bounds.outputs)
    return guaranteed_bounds(bounds, campaign, corners_suffice(domain, monotone))


def corners_suffice(domain: Domain, monotone: Mask) -> Mask:
    """Return the outputs that are monotone in every input that has a width, a mask (outputs,).

    `monotone` says whether each output is in each input, shape (outputs, inputs).
    """
    lower, upper = domain.boxes
    return np.asarray((monotone | (lower[0] == upper[0])).all(axis=1))


def require_budget(samples: float, campaign: Campaign, method: str) -> None:
    """Refuse a design that needs more evaluations than the budget, before any is made."""
    cure = f"the method {method} takes {samples:,.0f} evaluations here: take a larger budget,"
    cure += " fewer levels, state signs (Knowledge) for Signed, or take Automatic"
    remaining, allowed = f"{campaign.remaining:,} evaluations", f"{samples:,.0f} or more"
    require(samples <= campaign.remaining, "budget", value=remaining, allowed=allowed, cure=cure)


@dataclass(frozen=True)
class General:
    """General transformation method: all combinations of the recursion's points."""

    name = "general"

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Evaluate the samples and rearrange them into α-cuts."""
        return _bounds_of_combinations(campaign, domain, domain.names, self.name)


@dataclass(frozen=True)
class Reduced:
    """Reduced transformation method: corners of each cut; exact where monotone."""

    name = "reduced"

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Evaluate the samples and rearrange them into α-cuts."""
        return _bounds_of_combinations(campaign, domain, (), self.name)


@dataclass(frozen=True)
class Extended:
    """Extended transformation method: ends of monotone inputs, all points of the others.

    Monotone are those that the caller names (`Knowledge`), and others of which probes show it.

    Args:
        outputs: Outputs whose bounds matter; all if none is named.
    """

    outputs: tuple[str, ...] = ()

    name = "extended"

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Find the monotone inputs, evaluate the samples, rearrange them into α-cuts."""
        effects = verify(campaign, domain, self.outputs)
        stated = campaign.knowledge.monotone_in(domain.names, effects.outputs)
        monotone = ((effects.signs[0] != 0) | stated).all(axis=0)  # by input, for all outputs
        refined = {name for name, x in zip(domain.names, monotone, strict=True) if not x}
        design = _full_design(campaign, domain, refined, self.name)
        return _bounds_by_effects(design, campaign, effects, self.name)


@dataclass(frozen=True)
class Signed:
    """Two corners per level where all effects have a sign, else the general method's points.

    Signs are stated by the caller (`Knowledge.signs`) or seen at probes. Where all are stated, the
    bounds are guaranteed, else attained.

    Args:
        outputs: Outputs whose bounds matter; all if none is named. The others are as the samples
            happen to bound them.

    Example:
        >>> from alphacut.fuzzy import Interval, Knowledge, propagate
        >>> inputs, rises = {"x": Interval(0, 2)}, Knowledge(signs={"x": 1})
        >>> cube = propagate(lambda x: x**3, inputs, Signed(), alpha=[0], knowledge=rises)
        >>> cube.upper.item(), str(cube.nature)
        (8.0, 'guaranteed')
    """

    outputs: tuple[str, ...] = ()

    name = "signed"

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Verify the signs, run the corners, rearrange them into α-cuts."""
        effects = verify(campaign, domain, self.outputs)
        require_budget(_sample_count(effects, domain), campaign, self.name)
        levels = zip(effects.signs, grids(domain, domain.names), strict=True)
        points = [_level_points(np.unique(signs, axis=0), grid) for signs, grid in levels]
        return _bounds_by_effects(Design.from_levels(domain, points), campaign, effects, self.name)


def _bounds_by_effects(design: Design, campaign: Campaign, effects: Effects, method: str) -> Bounds:
    """Evaluate a design; bounds of all samples, guaranteed where all signs are stated."""
    at_corners = design.bounds(campaign(design.points), method)
    stated = campaign.knowledge.stated_signs(design.domain.names, at_corners.outputs) != 0
    proved = corners_suffice(design.domain, stated) & np.isin(at_corners.outputs, effects.outputs)
    guaranteed = guaranteed_bounds(at_corners, campaign, proved)
    bounds = bounds_of_samples(design.domain, campaign.samples, method)
    return replace(
        bounds,
        nature=guaranteed.nature,
        natures=guaranteed.natures,
        basis=guaranteed.basis,
        inner=Ends(bounds.lower, bounds.upper),
        notes=effects.notes(design.domain),
    )


def _sample_count(effects: Effects, domain: Domain) -> float:
    """Number of samples of the signed plan, a float: there may be too many to list."""
    total = 0.0
    for signs, grid in zip(effects.signs, grids(domain, domain.names), strict=True):
        counts = np.array([len(points) for points in grid], float)
        patterns = np.unique(signs == 0, axis=0)
        total += 2 * np.where(patterns, counts, 1.0).prod(axis=1).sum()
    return total


def _level_points(signs: Signs, grid: list[list[float]]) -> Array:
    """Return the points of the signed plan on one level, shape (n, inputs).

    Each row of signs (rows, inputs) names two opposite corners; inputs without a sign take all
    their points.
    """
    rows: list[tuple[float, ...]] = []
    for pattern in np.concatenate([signs, -signs]):
        pairs = zip(pattern, grid, strict=True)
        rows += product(*(x if sign == 0 else [x[0 if sign > 0 else -1]] for sign, x in pairs))
    return np.array(rows)
