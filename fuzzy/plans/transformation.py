"""Transformation method, reduced and general (Hanss, 2005), and the monotonicity-based plan.

Level j of m counts m + 1 − j points per input: the ends of its cut, and between them the midpoints
of neighbouring points of the next level up. The general method runs the model on the grid of these
points, the reduced method on the corners of each cut only. In the monotonicity-based plan known
signs of effects name the corner of each bound, and inputs without a sign take all points.

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
from alphacut.base.errors import RefusedError, require_choice
from alphacut.fuzzy.campaign.call import Samples
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs
from alphacut.fuzzy.plans.design import bounds_of_samples, guaranteed_bounds
from alphacut.fuzzy.result import Bounds, Ends
from alphacut.fuzzy.sets.boxes import Domain, quasi_random_points
from alphacut.fuzzy.sets.numbers import FuzzyNumber

Model = Callable[[Array], Array]
"""Outputs (n, outputs) at points (n, inputs)."""
Grid = list[list[float]]
"""Points of each input on one level."""


def hanss_points(number: FuzzyNumber, alpha: Sequence[float], *, inner: bool = True) -> Grid:
    """Return the points of every level by the recursion of the transformation method (Hanss 2005).

    The points of a level are the two ends of its α-cut, or its value if it has no width, and the
    midpoints of neighbouring points of the next level up. So n points at the top become n + 1 at
    the next level down, and so on. Points of different levels that differ only by rounding are made
    equal, so that a model is evaluated there once.

    Args:
        number: A fuzzy number or interval.
        alpha: Rising levels in [0, 1], one or more.
        inner: Whether to take the midpoints; otherwise a level has the ends of its cut alone.

    Returns:
        For each level, from the lowest, its points in rising order.
    """
    points: list[float] = []  # of all levels so far, in rising order
    by_level: list[list[float]] = []  # from the top down
    for level in reversed(alpha):
        lower, upper = number.cut(level)
        level_points = [lower]
        if lower < upper:
            if by_level and inner:
                # Hanss (2005): with them level j has one point more than the level above.
                level_points += [(left + right) / 2 for left, right in pairwise(by_level[-1])]
            level_points.append(upper)
        by_level.append([_listed_point(x, points, number.support.width) for x in level_points])
    return by_level[::-1]


def _listed_point(x: float, points: list[float], width: float) -> float:
    """Return the point of a list that equals x up to rounding; else insert x, and return it.

    Args:
        x: The point.
        points: Other points in rising order; x is inserted in place if none equals it.
        width: Width of the support, of which a difference of up to 1e-13 is rounding.
    """
    rounding = 1e-13 * width
    index = bisect_left(points, x - rounding)
    if index < len(points) and points[index] - x <= rounding:
        return points[index]
    points.insert(index, x)
    return x


def level_grids(domain: Domain, *, inner: bool) -> list[Grid]:
    """Return the points of the transformation method for all inputs (Hanss 2005).

    Args:
        domain: Inputs and levels.
        inner: Whether to take, beside the ends of an α-cut, the midpoints of neighbouring points of
            the next level up.

    Returns:
        For each level, from the lowest, a list by input of its points in rising order.
    """
    columns = [hanss_points(x, domain.alpha, inner=inner) for x in domain.inputs.values()]
    return [list(level) for level in zip(*columns, strict=True)]


def bounds_at(campaign: Campaign, domain: Domain, points: Array, method: str) -> Bounds:
    """Evaluate some points, and return the bounds of the outputs that they attain.

    On each level the bounds are the extremes over the points in its cut, of the nature "attained".
    Samples that the campaign has taken for other reasons do not count.

    Args:
        campaign: Evaluates the points and keeps them as samples.
        domain: Inputs and levels; the cut of a level is the box of the α-cuts of all inputs.
        points: Points, one or more in each cut, shape (n, inputs).
        method: Name of the method, which is stated in the result.

    Raises:
        SpentError: The budget does not carry the evaluations.
        CampaignError: The model failed at some points.
        ValueError: No point lies in the cut of a level.
    """
    # Levels may share points, and each is evaluated once.
    distinct = np.unique(points, axis=0)
    return bounds_of_samples(domain, Samples(distinct, campaign(distinct)), method)


def corners_suffice(domain: Domain, signs: Signs) -> Mask:
    """Return the outputs with a known sign of the effect of every input that has a width.

    Such an output is monotone in each input over the box of the widest cut, so that two of its
    corners bound the output.

    Args:
        domain: Inputs and levels. An input has a width if its cut at the lowest level has one.
        signs: For each output and input +1 if the output rises with the input, −1 if it falls, 0 if
            neither is known, shape (outputs, inputs).

    Returns:
        True for such outputs, shape (outputs,); False for all if no input has a width. A single
        evaluation attains its value, and says nothing of what the function rounds.
    """
    lower, upper = domain.boxes
    has_width = lower[0] < upper[0]
    return np.asarray(((signs != 0) | ~has_width).all(axis=1) & has_width.any())


def require_budget(samples: float, campaign: Campaign, method: str) -> None:
    """Raise RefusedError if a design needs more evaluations than the budget has left.

    Args:
        samples: Number of points of the design; it may be too large for an integer array.
        campaign: Knows how many evaluations remain; nothing is evaluated here.
        method: Name of the method for the message.
    """
    if samples > campaign.remaining:
        raise RefusedError(
            "budget",
            f"{campaign.remaining:,} evaluations",
            f"{samples:,.0f} or more",
            f"the method {method} takes {samples:,.0f} evaluations here: take a larger budget,"
            " fewer levels, state signs (Knowledge) for Signed, or take Automatic",
        )


@dataclass(frozen=True)
class General:
    """General transformation method: all combinations of the recursion's points.

    Example:
        >>> from alphacut.fuzzy import General, Triangular, propagate
        >>> x = Triangular(-1, 0, 2)
        >>> found = propagate(lambda x: x * x, {"x": x}, General(), alpha=[0, 1], progress=False)
        >>> found.upper.tolist(), str(found.nature)
        ([[4.0], [0.0]], 'attained')
    """

    name = "general"
    takes_inner_points: ClassVar[bool] = True

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Return bounds of every output on every level, by all combinations of the inputs' points.

        An input has the ends of its α-cut on each level as points. The general method adds points
        between them (Hanss 2005); the reduced method, a subclass, does not.

        Args:
            campaign: Evaluates the model, and knows the signs of effects that the caller states.
            domain: Inputs and levels.

        Returns:
            Bounds, shape (levels, outputs). An output is guaranteed if signs of the effects of all
            inputs with a width are stated, since corners bound it then; the others are attained.

        Raises:
            RefusedError: The budget does not carry the points, a sample contradicts a sign, or the
                knowledge names an output that the model does not have.
            CampaignError: The model failed at some points.
            FailedError: The store of samples cannot be written, or a worker process died.
        """
        grids = level_grids(domain, inner=self.takes_inner_points)
        count = sum(prod(map(len, grid)) for grid in grids)
        require_budget(count, campaign, self.name)
        points = [point for grid in grids for point in product(*grid)]
        bounds = bounds_at(campaign, domain, np.array(points), self.name)
        signs = campaign.knowledge.stated_signs(domain.names, bounds.outputs)
        return guaranteed_bounds(bounds, campaign, corners_suffice(domain, signs))


@dataclass(frozen=True)
class Reduced(General):
    """Reduced transformation method: corners of each cut; exact where monotone."""

    name = "reduced"
    takes_inner_points = False


@dataclass(frozen=True)
class Signed:
    """Monotonicity-based plan: two corners per level where all effects have a sign.

    Inputs without a sign take all points of the general method. Signs are stated by the caller
    (`Knowledge.signs`) or seen at probes. Where all are stated, the bounds are guaranteed, else
    attained.

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
        """Return bounds of every output on every level by the corners that signs of effects name.

        If an output rises or falls with each input all over a box, two opposite corners of the box
        bound it. Signs are stated by the caller (`campaign.knowledge`), else observed at probes of
        the box. An input whose sign is unknown takes all points of the general transformation
        method. Only the outputs named in the field `outputs` choose points, or all if it is empty.

        Args:
            campaign: Evaluates the model within its budget.
            domain: Inputs and levels.

        Returns:
            Bounds, shape (levels, outputs). A chosen output is guaranteed if the signs of all
            inputs with a width are stated; the others are attained by the best sample. `notes` name
            the effects of unknown sign.

        Raises:
            RefusedError: There is no output of a given name, the budget does not carry the corners,
                a sample contradicts a stated sign, or the knowledge names an output that the model
                does not have.
            SpentError: The budget does not carry the probes, or the points of several outputs.
            CampaignError: The model failed at some points.
            FailedError: The store of samples cannot be written, or a worker process died.
        """
        all_outputs = campaign.output_names(domain)
        for name in self.outputs:
            require_choice("output", name, all_outputs)
        outputs = self.outputs or all_outputs
        signs = find_effects(campaign, domain, outputs)
        grids = level_grids(domain, inner=True)
        require_budget(_sample_count(signs, grids), campaign, self.name)
        points = [_level_points(signs[level], grid) for level, grid in enumerate(grids)]
        at_corners = bounds_at(campaign, domain, np.concatenate(points), self.name)
        stated = campaign.knowledge.stated_signs(domain.names, at_corners.outputs)
        proved = corners_suffice(domain, stated) & np.isin(at_corners.outputs, outputs)
        guaranteed = guaranteed_bounds(at_corners, campaign, proved)
        # For outputs that are not proved, the samples that found and tested the signs may attain
        # more than the corners.
        bounds = bounds_of_samples(domain, campaign.samples, self.name)
        return replace(
            bounds,
            nature=guaranteed.nature,
            natures=guaranteed.natures,
            basis=guaranteed.basis,
            inner=Ends(bounds.lower, bounds.upper),
            notes=effect_notes(domain, outputs, signs),
        )


def _sample_count(signs: Signs, grids: list[Grid]) -> float:
    """Return about how many samples the monotonicity-based plan takes, before they are listed.

    Points that several levels share are counted on each level. The number is a float, since there
    may be too many to list.

    Args:
        signs: For each level, output and input +1 if the output rises with the input, −1 if it
            falls, 0 if neither is known, shape (levels, outputs, inputs).
        grids: For each level the points of each input.
    """
    total = 0.0
    for level_signs, grid in zip(signs, grids, strict=True):
        counts = np.array([len(points) for points in grid], float)
        has_no_sign = np.unique(level_signs == 0, axis=0)
        # Two opposite corners of the inputs with a sign, times all points of the inputs without.
        # Without any sign the two are the same points. Outputs whose signs differ, but are unknown
        # for the same inputs, are counted once, so that there may be more samples.
        opposite_corners = np.where(has_no_sign.all(axis=1), 1, 2)
        total += (opposite_corners * np.where(has_no_sign, counts, 1.0).prod(axis=1)).sum()
    return total


def _level_points(signs: Signs, grid: Grid) -> Array:
    """Return the points of the monotonicity-based plan on one level, shape (n, inputs).

    The signs of an output name two opposite corners, where it has its minimum and its maximum.
    Inputs without a sign take all their points, in all combinations. Outputs with equal signs share
    points; others may repeat some.

    Args:
        signs: For each output and input +1 if the output rises with the input, −1 if it falls, 0 if
            neither is known, shape (outputs, inputs).
        grid: Points of each input, one or more, from the lower to the upper end of its cut.
    """
    distinct = np.unique(signs, axis=0)
    rows: list[tuple[float, ...]] = []
    for pattern in np.concatenate([distinct, -distinct]):
        # The minimum lies at the lower end if the output rises. The maximum is the minimum of the
        # opposite signs.
        choices = []
        for sign, points in zip(pattern, grid, strict=True):
            by_sign = {0: points, 1: points[:1], -1: points[-1:]}
            choices.append(by_sign[int(sign)])
        rows += product(*choices)
    return np.array(rows)


def effect_notes(domain: Domain, outputs: Sequence[str], signs: Signs) -> tuple[str, ...]:
    """Return a sentence for each effect of unknown sign, with the highest such level.

    Args:
        domain: Inputs and levels.
        outputs: Names of the outputs.
        signs: +1 or −1 where the output rises or falls with the input on a level, 0 where neither
            is known, shape (levels, outputs, inputs).

    Returns:
        Sentences by output, then by input; none where all signs are known.
    """
    notes = []
    for row, output in enumerate(outputs):
        for column, name in enumerate(domain.names):
            unknown_levels = np.flatnonzero(signs[:, row, column] == 0)
            if len(unknown_levels):
                alpha = domain.alpha[unknown_levels[-1]]
                notes.append(
                    f"output {output} is not monotone in input {name}, or not surely, up to α ="
                    f" {alpha:g}"
                )
    return tuple(notes)


def find_effects(campaign: Campaign, domain: Domain, outputs: tuple[str, ...]) -> Signs:
    """Return the sign of each input's effect on each output, on each level.

    Signs that the caller states (`campaign.knowledge`) are taken as they are. For their later test,
    pairs of points that differ in the stated input alone are evaluated. Other signs are observed at
    probes, from the widest box to the narrowest. A sign holds on all narrower boxes.

    Args:
        campaign: Evaluates the model and keeps the samples.
        domain: Inputs and rising levels; the box of a level consists of the α-cuts of the inputs.
        outputs: Names of some outputs.

    Returns:
        Signs of shape (levels, outputs, inputs): +1 where the output rises, −1 where it falls, 0
        where neither is known. An input without a width on a level has +1 there.

    Raises:
        SpentError: The budget does not carry the evaluations.
        CampaignError: The model failed at some points.
    """
    signs = campaign.knowledge.stated_signs(domain.names, outputs)
    lowers, uppers = domain.boxes

    # Evaluate pairs of points at which a stated input is at either end, and the others at their
    # nominal values or at an extreme corner. All pairs of samples are compared later, in the test
    # of a guarantee.
    corners = _extreme_corners(signs, lowers[0], uppers[0])
    points = np.concatenate([domain.nominal[None], corners])
    for column in np.flatnonzero(signs.any(axis=0)):
        at_lower = points.copy()
        at_upper = points.copy()
        at_lower[:, column] = lowers[0, column]
        at_upper[:, column] = uppers[0, column]
        campaign(np.unique(np.concatenate([at_lower, at_upper]), axis=0))

    def model(points: Array) -> Array:
        """Return the outputs at points (n, inputs), shape (n, outputs)."""
        values = campaign(points)
        return values.array[:, [values.column(name) for name in outputs]]

    levels = []
    for level in range(len(lowers)):
        lower: Array = lowers[level]
        upper: Array = uppers[level]
        # A crisp input has one point, whatever its sign.
        signs = np.where(upper == lower, np.int8(1), signs)
        if (signs == 0).any():
            observed = _observed_signs(model, lower, upper, nominal=domain.nominal, stated=signs)
            signs = np.where(signs == 0, observed, signs)
        levels.append(signs)
    return np.array(levels)


def _extreme_corners(signs: Signs, lower: Array, upper: Array) -> Array:
    """Return the corners of a box at which outputs have their minima, and then their maxima.

    Args:
        signs: +1 or −1 where an output rises or falls with an input, shape (outputs, inputs); 0
            counts as 1.
        lower: Lower ends of the box, shape (inputs,).
        upper: Upper ends, shape (inputs,).

    Returns:
        Corners of shape (2 n, inputs) for n distinct rows of signs: n minima, then n maxima.
    """
    rises = np.unique(signs >= 0, axis=0)
    return np.concatenate([np.where(rises, lower, upper), np.where(rises, upper, lower)])


def _observed_signs(
    model: Model, lower: Array, upper: Array, *, nominal: Array, stated: Signs
) -> Signs:
    """Return the sign that the slopes at all probes of a box have.

    The probes are the nominal point, the corners where the slopes at the nominal point put the
    extremes, and four points inside. A sign is unsure where slopes differ in sign, or the smallest
    magnitude of a slope is below 5 % of the range of the slopes over the probes. A sign is
    evidence, not proof.

    Args:
        model: Function from points, shape (n, inputs), to the outputs there, shape (n, outputs).
        lower: Lower ends of the box, shape (inputs,).
        upper: Upper ends, shape (inputs,).
        nominal: Nominal point, which lies in the box, shape (inputs,).
        stated: Signs that are known, 0 for none, shape (outputs, inputs). Only inputs with a 0 for
            some output are probed; they must have a width.

    Returns:
        Signs of shape (outputs, inputs): +1 or −1 where the output rises or falls at all probes, 0
        where unsure, and 1 for an input without any effect, or that was not probed.

    Raises:
        SpentError: The budget does not carry the evaluations.
        CampaignError: The model failed at some points.
    """
    free = np.flatnonzero((stated == 0).any(axis=0))
    nominal_slopes = _slopes(model, lower, upper, points=nominal[None], inputs=free)[0]
    # The corners are a guess from the slopes at one point; a wrong guess shows in slopes of both
    # signs.
    first = np.sign(nominal_slopes).astype(np.int8)
    corners = _extreme_corners(np.where(stated != 0, stated, first), lower, upper)
    inside = lower + quasi_random_points(len(lower), 4) * (upper - lower)
    probes = np.concatenate([nominal[None], corners, inside])
    slopes = _slopes(model, lower, upper, points=probes, inputs=free)
    smallest = slopes.min(axis=0)
    largest = slopes.max(axis=0)
    margin = 0.05 * (largest - smallest)
    # The margin: slopes that vary much over the probes may change their sign between them.
    rises = (smallest > 0) & (smallest >= margin)
    falls = (largest < 0) & (-largest >= margin)
    has_no_effect = (smallest == 0) & (largest == 0)  # either end will do
    return np.asarray((rises | has_no_effect).astype(np.int8) - falls.astype(np.int8))


def _slopes(model: Model, lower: Array, upper: Array, *, points: Array, inputs: Ints) -> Array:
    """Return the slopes of all outputs at points of a box, along some inputs.

    They are one-sided differences over a step of 1e-3 of the width of the box, to its inside.

    Args:
        model: Function from points, shape (n, inputs), to the outputs there, shape (n, outputs).
        lower: Lower ends of the box, shape (inputs,).
        upper: Upper ends, shape (inputs,).
        points: Points of the box, shape (n, inputs).
        inputs: Columns of the inputs that are changed; they must have a width.

    Returns:
        Slopes of shape (n, outputs, inputs), 0 for the other inputs.

    Raises:
        SpentError: The budget does not carry the evaluations.
        CampaignError: The model failed at some points.
    """
    values = model(points)
    slopes = np.zeros((*values.shape, points.shape[1]))
    for column in inputs:
        step = 1e-3 * (upper[column] - lower[column])
        steps = np.where(points[:, column] + step > upper[column], -step, step)
        stepped = points.copy()
        stepped[:, column] += steps
        slopes[:, :, column] = (model(stepped) - values) / steps[:, None]
    return slopes
