"""One α-cut in unit coordinates: values of an output there, and descents by gradients."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import inf

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.settings import SEARCH
from alphacut.fuzzy.sets.boxes import Domain, corners


@dataclass(frozen=True)
class Bound:
    """The lower (`sign` 1) or upper (`sign` −1) bound of an output: minimum of sign · output."""

    output: str
    sign: float


class CutSearch:
    """One α-cut under search, in unit coordinates of its uncertain inputs.

    An input is uncertain if its cut has a width. Unit coordinates are 0 at the lower and 1 at the
    upper end of the cut of an input.

    Attributes:
        level: Index of the α-level.
        lower: Lower ends of the cuts of all inputs, shape (inputs,).
        upper: Upper ends of the cuts, shape (inputs,).
        near: Distance from a face of the cut within which a point lies on the face, shape
            (inputs,).
        uncertain_inputs: Columns of the uncertain inputs.
    """

    def __init__(self, campaign: Campaign, domain: Domain, level: int) -> None:
        self.campaign = campaign
        self.domain = domain
        self.level = level
        lower, upper = domain.boxes
        self.lower: Array = lower[level]
        self.upper: Array = upper[level]
        # This is far above the rounding of a coordinate and far below any distance of interest.
        self.near = 1e-9 * (self.upper - self.lower)
        self.uncertain_inputs = np.flatnonzero(self.upper > self.lower)

    @cached_property
    def corners(self) -> Array:
        """Corners of the unit cube [0, 1]^d of the d inputs whose cuts have a width.

        They have the shape (2^d, d), or (0, d) for more than six inputs.
        """
        inputs = len(self.uncertain_inputs)
        # Six inputs have 64 corners, no more than other samples of a search; 20 have a million.
        if inputs > 6:
            return np.empty((0, inputs))
        return corners(np.zeros(inputs), np.ones(inputs))

    def points(self, unit: Array) -> Array:
        """Return the values of all inputs at points of the unit cube, shape (n, inputs).

        Args:
            unit: Coordinates of the inputs whose cuts have a width, from 0 at the lower to 1 at the
                upper end of the cut, shape (n, uncertain inputs). The other inputs have one value.
        """
        points = np.repeat(self.lower[None], len(unit), axis=0)
        width = (self.upper - self.lower)[self.uncertain_inputs]
        points[:, self.uncertain_inputs] = self.lower[self.uncertain_inputs] + unit * width
        # lower + 1 · (upper − lower) can exceed upper by rounding, where the model need not exist.
        return np.clip(points, self.lower, self.upper)

    def unit(self, points: Array) -> Array:
        """Return points (n, inputs) in unit coordinates, shape (n, uncertain inputs)."""
        width = (self.upper - self.lower)[self.uncertain_inputs]
        return np.asarray(np.clip((points - self.lower)[:, self.uncertain_inputs] / width, 0, 1))

    def contains(self, points: Array) -> Mask:
        """Return which of the points (n, inputs) lie in the cut, shape (n,)."""
        return np.asarray(self.domain.inside(points)[self.level])

    def values(self, unit: Array, bound: Bound) -> Array:
        """Return sign · output at points of the unit cube, shape (n,).

        Points that have not been evaluated before cost evaluations, and become samples of
        `self.campaign`.

        Args:
            unit: Coordinates of the inputs whose cuts have a width, from 0 at the lower to 1 at the
                upper end of the cut, shape (n, uncertain inputs); n may be 0.
            bound: Name of the output, and the sign by which it is multiplied: 1 where its minimum
                is searched, −1 where its maximum is.

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at a point.
        """
        if not len(unit):
            return np.empty(0)
        outputs = self.campaign(self.points(unit))
        return bound.sign * outputs.array[:, outputs.column(bound.output)]

    def output_range(self, output: str) -> float:
        """Return the range of an output over all samples, the unit of its slopes; 1 if it is 0."""
        values = self.campaign.samples.values
        column = values.array[:, values.column(output)]
        span = float(np.ptp(column))
        return span if span >= np.finfo(float).tiny else 1.0

    def largest_slope(self, point: Array, output: str) -> float:
        """Return the largest slope of an output at a point of the cut, to either side.

        Differences have a step of 1e-4 of the width of an input's cut. They are taken along each
        input that is farther than a step from both ends of its cut.

        Args:
            point: Values of all inputs, shape (inputs,).
            output: Name of the output.

        Returns:
            The largest magnitude of the slopes, for inputs in widths of their cuts and the output
            in units of its range over all samples so far; 0 if all inputs are at an end.

        Raises:
            SpentError: The budget does not carry the evaluations, two for each such input and one.
            CampaignError: The model failed at a point.
        """
        step = SEARCH.large_difference  # 1e-4; with it the noise of an iterative solver is no slope
        unit = self.unit(point[None])[0]
        inner_inputs = np.flatnonzero((unit > step) & (unit < 1 - step))
        steps = step * np.eye(len(unit))[inner_inputs]
        # At a kink the slopes to both sides differ, so that one of them is not small.
        probes = np.concatenate([unit[None], unit + steps, unit - steps])
        values = self.values(probes, Bound(output, 1.0))
        slopes = np.abs(values[1:] - values[0]) / step / self.output_range(output)
        return float(slopes.max(initial=0.0))

    def descend(self, start: Array, bound: Bound, first_step: float = inf) -> Optimum:
        """Descend by L-BFGS-B from a point inside the cut, and return where the descent ends.

        Unit coordinates are 0 at the lower and 1 at the upper end of the cut of an input.

        Args:
            start: Unit coordinates where the descent begins, shape (uncertain inputs,).
            bound: Name of the output, and the sign (1 or −1) by which it is multiplied before it is
                minimised.
            first_step: Limit of the length of the first step in unit coordinates. A short one does
                not leave the basin of the start.

        Returns:
            The end, after at most 50 steps: `point` with the values of all inputs, shape (inputs,);
            `value`, sign · output there; and `slope`, the largest magnitude of the derivative by an
            input that can still lower the value inside the cut, in ranges of the output per width
            of the cut. At a kink or jump the slope may be large.

        Raises:
            SpentError: The budget does not carry the evaluations.
            CampaignError: The model failed at a point.
        """
        from scipy.optimize import minimize

        output_range = self.output_range(bound.output)
        start_value = float(self.values(start[None], bound)[0])

        def change_and_gradient(unit: Array) -> tuple[float, Array]:
            """Return (sign · output − its value at `start`) / `output_range`, and its gradient.

            The gradient consists of one-sided differences with the step 1e-6, all taken by one
            evaluation of several points of this cut.

            Args:
                unit: Unit coordinates, shape (uncertain inputs,), the shape of the gradient, too.
            """
            difference = SEARCH.difference
            # Differences go to the inside: the model need not exist beyond the cut.
            steps = np.where(unit + difference > 1, -difference, difference)
            values = self.values(np.concatenate([unit[None], unit + np.diag(steps)]), bound)
            changes = (values - start_value) / output_range
            return float(changes[0]), (changes[1:] - changes[0]) / steps

        # The first step of L-BFGS-B is the gradient itself. The objective is multiplied by a factor
        # that makes this step as long as `first_step`, or by 4, with which first steps mostly reach
        # a face of the cut at once. A slope below 1e-12 is none.
        _, start_gradient = change_and_gradient(start)
        slope = float(np.linalg.norm(start_gradient))
        factor = min(4.0, first_step / max(slope, 1e-12))

        def objective(unit: Array) -> tuple[float, Array]:
            """Return the change and its gradient times the factor."""
            change, gradient = change_and_gradient(unit)
            return factor * change, factor * gradient

        # A descent ends by a step that changes the output by 5e-10 of its range, or where the slope
        # is 2.5e-6. Both are below the tolerance of values, 1e-5, with room for several steps.
        options = {"maxiter": 50, "ftol": 5e-10 * factor, "gtol": 2.5e-6 * factor}
        result = minimize(
            objective,
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=[(0.0, 1.0)] * len(start),
            options=options,
        )
        unit = result.x
        gradient = result.jac / factor
        # At a face of the cut a gradient that points out of the cut cannot be followed.
        points_out = ((unit <= 0) & (gradient > 0)) | ((unit >= 1) & (gradient < 0))
        free_gradient = np.where(points_out, 0.0, gradient)
        return Optimum(
            cut=self,
            bound=bound,
            point=self.points(unit[None])[0],
            value=start_value + output_range * float(result.fun) / factor,
            slope=float(np.abs(free_gradient).max(initial=0.0)),
        )


@dataclass(frozen=True, eq=False)
class Optimum:
    """Local optimum that a descent has reached.

    Args:
        cut: The cut in which it was searched.
        bound: Output and sign that were minimised.
        point: Inputs, shape (inputs,).
        value: sign · output at the point.
        slope: Largest slope along an input that can still change, in ranges of the output over the
            width of the cut.
    """

    cut: CutSearch
    bound: Bound
    point: Array
    value: float
    slope: float

    @cached_property
    def is_smooth(self) -> bool:
        """Whether the output has nearly no slope at the optimum: False at kinks and jumps.

        A slope is the change of the output, in units of its range, over the width of an input's
        cut. Only inputs that are not at an end of their cut count. Slopes of up to 0.01 are nearly
        none. If the slope at the end of the descent is larger, longer differences to both sides are
        evaluated, once, and decide. The answer is False if the budget does not allow these.

        Raises:
            CampaignError: The model failed at one of the points.
        """
        if self.slope <= SEARCH.max_slope:
            return True
        try:
            slope = self.cut.largest_slope(self.point, self.bound.output)
        except SpentError:
            return False
        return slope <= SEARCH.max_slope

    def is_optimum_of(self, cut: CutSearch) -> bool:
        """Return whether the point is a local optimum of another α-cut as well.

        It is an optimum of the box `self.cut`. In this cut, and in a narrower one (of a higher
        level), it is an optimum if the cut contains it. In a wider cut (of a lower level) it is an
        optimum unless it lies, to 1e-9 of the width, on a face of its own cut and the wider cut
        reaches beyond this face. Nothing is evaluated.

        Args:
            cut: α-cut of the same inputs, with the index `level` of its α-level, and the ends
                `lower` and `upper` of all inputs, shape (inputs,).
        """
        # Levels rise, and so the cut with the lower level is the wider one.
        if self.cut.level <= cut.level:
            return bool(cut.contains(self.point[None])[0])
        is_at_lower_face = self.point <= self.cut.lower + self.cut.near
        is_at_upper_face = self.point >= self.cut.upper - self.cut.near
        leaves_lower_face = is_at_lower_face & (self.cut.lower > cut.lower)
        leaves_upper_face = is_at_upper_face & (self.cut.upper < cut.upper)
        return not (leaves_lower_face | leaves_upper_face).any()


def cuts_with_width(campaign: Campaign, domain: Domain) -> Iterator[CutSearch]:
    """Yield the cuts in which an input is uncertain, from the narrowest to the widest."""
    for level in reversed(range(len(domain.alpha))):
        cut = CutSearch(campaign, domain, level)
        if len(cut.uncertain_inputs):
            yield cut
