"""One α-cut in unit coordinates: values of an output there, and descents by gradients."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from math import inf

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.sets.boxes import Domain

_DIFFERENCE = 1e-6  # step of a derivative, as a share of the width of the cut
# the same of the slope at the end of a descent: models that solve to 1e-8 are as noisy
_LARGE_DIFFERENCE = 1e-4
_MAX_SLOPE = 0.01  # ranges of the output over the width of a cut: at a kink or jump it is larger
_FACE = 1e-9  # of the width: a point this close to a face of the cut lies on it
_STEEPNESS = 4.0  # of the objective's unit: so first steps mostly reach a face at once
_FLAT = 1e-12  # ranges of the output over the width of the cut: no slope
# ranges of the output at which a descent ends: by its last step, and by its slope
_MIN_CHANGE, _MIN_SLOPE = 5e-10, 2.5e-6
_MAX_ITERATIONS = 50  # of a descent
_MAX_CORNER_INPUTS = 6  # inputs up to which all corners are evaluated, 64 at most
_FAILED = 1e6  # ranges of the output that stand for a sample without a value


@dataclass(frozen=True)
class Bound:
    """The lower (`sign` 1) or upper bound (−1) of an output: the minimum of sign · output."""

    output: str
    sign: float


class CutSearch:
    """One α-cut under search, in unit coordinates of the uncertain inputs: those with a width."""

    def __init__(self, campaign: Campaign, domain: Domain, level: int) -> None:
        self.campaign, self.domain, self.level = campaign, domain, level
        self.lower, self.upper = (ends[level] for ends in domain.boxes)
        self.near = _FACE * (self.upper - self.lower)
        self.uncertain_inputs = np.flatnonzero(self.upper > self.lower)

    @cached_property
    def corners(self) -> Array:
        """Corners of the unit cube, (n, uncertain inputs); none for more than six inputs."""
        inputs = len(self.uncertain_inputs)
        if inputs > _MAX_CORNER_INPUTS:
            return np.empty((0, inputs))
        return np.array(list(product((0.0, 1.0), repeat=inputs)))

    def points(self, unit: Array) -> Array:
        """Inputs of points (n, uncertain inputs) of the unit cube, shape (n, inputs)."""
        points = np.repeat(self.lower[None], len(unit), axis=0)
        width = (self.upper - self.lower)[self.uncertain_inputs]
        points[:, self.uncertain_inputs] = self.lower[self.uncertain_inputs] + unit * width
        return np.clip(points, self.lower, self.upper)

    def unit(self, points: Array) -> Array:
        """Points (n, inputs) in unit coordinates, shape (n, uncertain inputs)."""
        width = (self.upper - self.lower)[self.uncertain_inputs]
        return np.asarray(np.clip((points - self.lower)[:, self.uncertain_inputs] / width, 0, 1))

    def contains(self, points: Array) -> Mask:
        """Mask of the points (n, inputs) that lie in the cut, shape (n,)."""
        return np.asarray(self.domain.inside(points)[self.level])

    def values(self, unit: Array, bound: Bound) -> Array:
        """Evaluate sign · output at points (n, uncertain inputs), shape (n,); ∞ where it failed."""
        if not len(unit):
            return np.empty(0)
        outputs = self.campaign(self.points(unit))
        values = bound.sign * outputs.array[:, outputs.column(bound.output)]
        return np.where(np.isnan(values), np.inf, values)

    def output_range(self, output: str) -> float:
        """Return the range of an output over all samples, the unit of its slopes; 1 if it is 0."""
        values = self.campaign.samples.values
        column = values.array[:, values.column(output)]
        span = float(np.nanmax(column) - np.nanmin(column))
        return span if span >= np.finfo(float).tiny else 1.0

    def largest_slope(self, point: Array, output: str) -> float:
        """Largest slope of an output at a point (inputs,), along inputs inside their cuts there.

        It is in ranges of the output over the width of the cut, 0 if all inputs are at an end.
        """
        unit = self.unit(point[None])[0]
        inner = np.flatnonzero((unit > _LARGE_DIFFERENCE) & (unit < 1 - _LARGE_DIFFERENCE))
        steps = _LARGE_DIFFERENCE * np.eye(len(unit))[inner]
        probes = np.concatenate([unit[None], unit + steps, unit - steps])  # so that kinks show
        here, *around = self.values(probes, Bound(output, 1.0))
        finite = np.array([value for value in around if np.isfinite(value)])
        slopes = np.abs(finite - here) / _LARGE_DIFFERENCE / self.output_range(output)
        return float(slopes.max(initial=0.0))

    def descend(self, start: Array, bound: Bound, first_step: float = inf) -> Optimum:
        """Return the local optimum that a descent by L-BFGS-B reaches inside the cut.

        The gradient is one of differences. `first_step` limits the first step in unit coordinates:
        a short one does not leave the basin of the start (uncertain inputs,).
        """
        from scipy.optimize import minimize

        output_range = self.output_range(bound.output)
        start_value = float(self.values(start[None], bound)[0])

        def change(unit: Array) -> tuple[float, Array]:
            """Change of sign · output from the start, in ranges of the output, and its gradient."""
            steps = np.where(unit + _DIFFERENCE > 1, -_DIFFERENCE, _DIFFERENCE)
            points = self.points(np.concatenate([unit[None], unit + np.diag(steps)]))
            rows = self.campaign(points)
            values = bound.sign * rows.array[:, rows.column(bound.output)]
            changes = np.nan_to_num((values - start_value) / output_range, nan=_FAILED)
            return float(changes[0]), (changes[1:] - changes[0]) / steps

        # the minimiser begins with a step of one gradient, which the factor makes long or short
        slope = float(np.linalg.norm(change(start)[1]))
        factor = min(_STEEPNESS, first_step / max(slope, _FLAT))

        options = {"ftol": _MIN_CHANGE * factor, "gtol": _MIN_SLOPE * factor}
        result = minimize(
            lambda unit: tuple(factor * x for x in change(unit)),
            start,
            jac=True,
            method="L-BFGS-B",
            bounds=[(0.0, 1.0)] * len(start),
            options={"maxiter": _MAX_ITERATIONS, **options},
        )
        value = start_value + output_range * float(result.fun) / factor
        unit, gradient = result.x, result.jac / factor
        points_out = ((unit <= 0) & (gradient > 0)) | ((unit >= 1) & (gradient < 0))
        free_slope = float(np.abs(np.where(points_out, 0.0, gradient)).max(initial=0.0))
        return Optimum(self, bound, self.points(unit[None])[0], value, free_slope)


@dataclass(frozen=True, eq=False)
class Optimum:
    """Local optimum that a descent has reached.

    Args:
        cut: The cut in which it was searched.
        bound: Output and sign that were minimised.
        point: Inputs, shape (inputs,).
        value: sign · output there.
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

        Also False if the budget does not allow the samples that decide it.
        """
        if self.slope <= _MAX_SLOPE:
            return True
        try:
            return self.cut.largest_slope(self.point, self.bound.output) <= _MAX_SLOPE
        except SpentError:
            return False

    def is_optimum_of(self, cut: CutSearch) -> bool:
        """Whether the point is a local optimum of another cut as well.

        It stays one of a narrower cut (higher α) that contains it, and of a wider cut (lower α)
        unless it lies on a face of its own cut which the wider one moves outwards.
        """
        if self.cut.level <= cut.level:
            return bool(cut.contains(self.point[None])[0])
        is_wider = self.cut.lower > cut.lower, self.cut.upper < cut.upper
        at_face = (self.point <= self.cut.lower + self.cut.near) & is_wider[0]
        at_face |= (self.point >= self.cut.upper - self.cut.near) & is_wider[1]
        return not at_face.any()


def cuts_with_width(campaign: Campaign, domain: Domain) -> Iterator[CutSearch]:
    """Yield the cuts in which an input is uncertain, from the narrowest to the widest."""
    for level in reversed(range(len(domain.alpha))):
        cut = CutSearch(campaign, domain, level)
        if len(cut.uncertain_inputs):
            yield cut
