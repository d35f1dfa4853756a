"""Transformation method, reduced and general (Hanss, 2005), and the signed plan.

Level j of m counts m + 1 − j points per input: the ends of its cut, and between them the midpoints
of neighbouring points of the next level up. The general method runs the model on the grid of these
points, the reduced method on the corners of each cut only. In the signed plan known signs of
effects name the corner of each bound, and inputs without a sign take all points.

A sign is *proved* where the caller states it and no sample contradicts it; samples in which one
stated input changes alone test it. Otherwise it is *observed*: differences at probes of the box all
have it, with a margin. That is evidence, not proof, and bounds that rest on it are attained only.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from math import prod
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.errors import require, require_choice
from alphacut.fuzzy.campaign.call import Samples
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs
from alphacut.fuzzy.plans.design import bounds_of_samples, guaranteed_bounds
from alphacut.fuzzy.result import Bounds, Ends
from alphacut.fuzzy.sets.boxes import Domain, quasi_random_points
from alphacut.fuzzy.sets.numbers import FuzzyNumber

Model = Callable[[Array], Array]
# share of the support: points of two levels closer than this differ by round-off only
_ROUND_OFF = 1e-13
_PROBES = 4  # points inside a box, besides its extreme corners and the nominal point
_MARGIN = 0.05  # of the range of the slopes over the probes, which the least slope must exceed
_STEP = 1e-3  # of a finite difference, over the width of the box


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


def level_grids(domain: Domain, *, inner: bool) -> list[list[list[float]]]:
    """Return `hanss_points` of all inputs, as a list by level of lists by input."""
    columns = [hanss_points(x, domain.alpha, inner=inner) for x in domain.inputs.values()]
    return [list(level) for level in zip(*columns, strict=True)]


def bounds_at(campaign: Campaign, domain: Domain, points: Array, method: str) -> Bounds:
    """Evaluate points (n, inputs), equal ones once, and return the bounds that they attain."""
    distinct = np.unique(points, axis=0)
    return bounds_of_samples(domain, Samples(distinct, campaign(distinct)), method)


def corners_suffice(domain: Domain, signs: Signs) -> Mask:
    """Return the outputs with a sign of every input that has a width, a mask (outputs,)."""
    lower, upper = domain.boxes
    return np.asarray(((signs != 0) | (lower[0] == upper[0])).all(axis=1))


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
    takes_inner_points: ClassVar[bool] = True

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Bounds by all combinations of points, guaranteed where corners are known to suffice."""
        grids = level_grids(domain, inner=self.takes_inner_points)
        require_budget(sum(prod(map(len, grid)) for grid in grids), campaign, self.name)
        points = np.array([point for grid in grids for point in product(*grid)])
        bounds = bounds_at(campaign, domain, points, self.name)
        signs = campaign.knowledge.stated_signs(domain.names, bounds.outputs)
        return guaranteed_bounds(bounds, campaign, corners_suffice(domain, signs))


@dataclass(frozen=True)
class Reduced(General):
    """Reduced transformation method: corners of each cut; exact where monotone."""

    name = "reduced"
    takes_inner_points = False


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
        """Bounds by the corners that the signs name, guaranteed where all signs are stated."""
        columns = campaign.output_names(domain)
        for name in self.outputs:
            require_choice("output", name, columns)
        outputs = self.outputs or columns
        signs = find_effects(campaign, domain, outputs)
        grids = level_grids(domain, inner=True)
        require_budget(_sample_count(signs, grids), campaign, self.name)
        levels = zip(signs, grids, strict=True)
        points = [_level_points(np.unique(x, axis=0), grid) for x, grid in levels]
        at_corners = bounds_at(campaign, domain, np.concatenate(points), self.name)
        stated = campaign.knowledge.stated_signs(domain.names, at_corners.outputs)
        proved = corners_suffice(domain, stated) & np.isin(at_corners.outputs, outputs)
        guaranteed = guaranteed_bounds(at_corners, campaign, proved)
        bounds = bounds_of_samples(domain, campaign.samples, self.name)
        return replace(
            bounds,
            nature=guaranteed.nature,
            natures=guaranteed.natures,
            basis=guaranteed.basis,
            inner=Ends(bounds.lower, bounds.upper),
            notes=effect_notes(domain, outputs, signs),
        )


def _sample_count(signs: Signs, grids: list[list[list[float]]]) -> float:
    """Number of samples of the signed plan, a float: there may be too many to list."""
    total = 0.0
    for level_signs, grid in zip(signs, grids, strict=True):
        counts = np.array([len(points) for points in grid], float)
        patterns = np.unique(level_signs == 0, axis=0)
        total += 2 * np.where(patterns, counts, 1.0).prod(axis=1).sum()
    return total


def _level_points(signs: Signs, grid: list[list[float]]) -> Array:
    """Return the points of the signed plan on one level, shape (n, inputs)."""
    # a row of signs names two opposite corners; inputs without a sign take all their points
    rows: list[tuple[float, ...]] = []
    for pattern in np.concatenate([signs, -signs]):
        pairs = zip(pattern, grid, strict=True)
        rows += product(*(x if sign == 0 else [x[0 if sign > 0 else -1]] for sign, x in pairs))
    return np.array(rows)


def effect_notes(domain: Domain, outputs: Sequence[str], signs: Signs) -> tuple[str, ...]:
    """Return a sentence for each effect of unknown sign, with the highest such level.

    `signs` are of shape (levels, outputs, inputs), as of `find_effects`.
    """
    return tuple(
        f"output {output} is not monotone in input {name}, or not surely, up to α ="
        f" {domain.alpha[np.flatnonzero(by_level == 0)[-1]]:g}"
        for row, output in enumerate(outputs)
        for name, by_level in zip(domain.names, signs[:, row].T, strict=True)
        if (by_level == 0).any()
    )


def find_effects(campaign: Campaign, domain: Domain, outputs: tuple[str, ...]) -> Signs:
    """Return the sign of each input's effect on each output, shape (levels, outputs, inputs).

    It is +1, −1, or 0 where neither holds; an input without width has +1.

    Stated signs are tested at pairs of points; the others are observed at probes, from the widest
    box to the narrowest. A sign holds on all narrower boxes.
    """
    signs = campaign.knowledge.stated_signs(domain.names, outputs)
    lowers, uppers = domain.boxes
    # pairs with an input at either end, the others at nominal values or at an extreme corner
    corners = _extreme_corners(signs, lowers[0], uppers[0])
    points = np.repeat(np.concatenate([domain.nominal[None], corners]), 2, axis=0)
    for column in np.flatnonzero(signs.any(axis=0)):
        pairs = points.copy()
        pairs[::2, column], pairs[1::2, column] = lowers[0, column], uppers[0, column]
        campaign(np.unique(pairs, axis=0))

    def model(points: Array) -> Array:
        """The outputs at points (n, inputs), shape (n, outputs)."""
        values = campaign(points)
        return values.array[:, [values.column(name) for name in outputs]]

    levels = []
    for row in range(len(lowers)):
        box = lowers[row], uppers[row]
        signs = np.where(box[1] == box[0], np.int8(1), signs)
        if (signs == 0).any():
            signs = np.where(signs == 0, _observed_signs(model, box, domain.nominal, signs), signs)
        levels.append(signs)
    return np.array(levels)


def _extreme_corners(signs: Signs, lower: Array, upper: Array) -> Array:
    """Return the corners of least and greatest output for each distinct row of signs."""
    rises = np.unique(signs >= 0, axis=0)
    return np.concatenate([np.where(rises, lower, upper), np.where(rises, upper, lower)])


def _observed_signs(model: Model, box: tuple[Array, Array], nominal: Array, stated: Signs) -> Signs:
    """Return the sign of the slopes at all probes of a box, (outputs, inputs), 0 where unsure."""
    # unsure: slopes differ in sign, or the smallest is below 5 % of their range; 1 for an input
    # without any effect; only inputs without a sign in `stated` are probed
    lower, upper = box
    free = np.flatnonzero((stated == 0).any(axis=0))
    first = np.nan_to_num(np.sign(_slopes(model, box, nominal[None], free)[0])).astype(np.int8)
    corners = _extreme_corners(np.where(stated != 0, stated, first), lower, upper)
    inside = lower + quasi_random_points(len(lower), _PROBES) * (upper - lower)
    slopes = _slopes(model, box, np.concatenate([nominal[None], corners, inside]), free)
    smallest, largest = slopes.min(axis=0), slopes.max(axis=0)
    margin = _MARGIN * (largest - smallest)
    rises = (smallest > 0) & (smallest >= margin)
    falls = (largest < 0) & (-largest >= margin)
    has_no_effect = (smallest == 0) & (largest == 0)  # either end will do
    return np.asarray((rises | has_no_effect).astype(np.int8) - falls.astype(np.int8))


def _slopes(model: Model, box: tuple[Array, Array], points: Array, inputs: Ints) -> Array:
    """Return one-sided differences by some inputs inside a box, (n, outputs, inputs)."""
    (lower, upper), values = box, model(points)
    slopes = np.zeros((*values.shape, points.shape[1]))
    for column in inputs:
        step = _STEP * (upper[column] - lower[column])
        steps = np.where(points[:, column] + step > upper[column], -step, step)
        stepped = points.copy()
        stepped[:, column] += steps
        slopes[:, :, column] = (model(stepped) - values) / steps[:, None]
    return slopes
