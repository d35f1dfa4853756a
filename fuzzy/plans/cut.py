"""One α-cut in unit coordinates: values of an output there, and descents by gradients."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import inf
from typing import Any

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.design import bounds_of_samples
from alphacut.fuzzy.result import Bounds
from alphacut.fuzzy.sets.boxes import Domain
from alphacut.fuzzy.sets.interaction import first_allowed_point

_DIFFERENCE = 1e-6  # step of a derivative, as a share of the width of the cut
# the same of the slope at the end of a descent: models that solve to 1e-8 are as noisy
_LARGE_DIFFERENCE = 1e-4
_MAX_SLOPE = 0.01  # ranges of the output over the width of a cut: at a kink or jump it is larger
_FACE = 1e-9  # of the width: a point this close to a face of the cut lies on it
_STEEPNESS = 4.0  # of the objective's unit: so first steps mostly reach a face at once
_FLAT = 1e-12  # ranges of the output over the width of the cut: no slope
# ranges of the output at which a descent ends: by its last step, and by its slope
_LEAST_CHANGE, _LEAST_SLOPE = 5e-10, 2.5e-6
_LEAST_MODEL_CHANGE = 2.5e-7  # the same of SLSQP, which predicts its last step's change
_MAX_ITERATIONS = 50  # of a descent
_MAX_CORNER_INPUTS = 6  # inputs up to which all corners are evaluated, 64 at most
_FAILED = 1e6  # ranges of the output that stand for a sample without a value


@dataclass(frozen=True)
class Bound:
    """The lower or upper bound of an output, searched as a minimum of sign · output.

    Args:
        output: Name of the output.
        sign: 1 for the lower bound, −1 for the upper one.
    """

    output: str
    sign: float


class CutSearch:
    """One α-cut under search, in unit coordinates of the uncertain inputs: those with a width."""

    def __init__(self, campaign: Campaign, domain: Domain, level: int) -> None:
        self.campaign, self.domain, self.level = campaign, domain, level
        self.alpha = domain.alpha[level]
        self.lower, self.upper = (ends[level] for ends in domain.boxes)
        self.near = _FACE * (self.upper - self.lower)
        self.uncertain_inputs = np.flatnonzero(self.upper > self.lower)

    @cached_property
    def corners(self) -> Array:
        """Allowed corners of the unit cube, (n, uncertain inputs); empty for over six inputs."""
        inputs = len(self.uncertain_inputs)
        if inputs > _MAX_CORNER_INPUTS:
            return np.empty((0, inputs))
        corners = np.array(list(product((0.0, 1.0), repeat=inputs)))
        return np.asarray(corners[self.slack(corners) >= 0])

    def points(self, unit: Array) -> Array:
        """Inputs of points (n, uncertain inputs) of the unit cube, shape (n, inputs)."""
        points = np.repeat(self.lower[None], len(unit), axis=0)
        width = (self.upper - self.lower)[self.uncertain_inputs]
        points[:, self.uncertain_inputs] = self.lower[self.uncertain_inputs] + unit * width
        return np.clip(points, self.lower, self.upper)

    def unit(self, points: Array) -> Array:
        """Points (n, inputs) in unit coordinates, shape (n, uncertain inputs)."""
        width = (self.upper - self.lower)[self.uncertain_inputs]
        unit: Array = np.clip((points - self.lower)[:, self.uncertain_inputs] / width, 0, 1)
        return unit

    def slack(self, unit: Array) -> Array:
        """Slack of the interactions at points of the unit cube, ≥ 0 where allowed, shape (n,)."""
        return self.domain.slack(self.points(unit), self.alpha)

    def contains(self, points: Array) -> Mask:
        """Mask of the points (n, inputs) that lie in the cut, shape (n,)."""
        return np.asarray(self.domain.inside(points)[self.level])

    def values(self, unit: Array, bound: Bound) -> Array:
        """Evaluate sign · output at points (n, uncertain inputs) of the unit cube, shape (n,).

        It is infinite where the interactions do not allow a point or its sample failed.
        """
        is_allowed = self.slack(unit) >= 0
        values: Array = np.full(len(unit), np.inf)
        if is_allowed.any():
            outputs = self.campaign(self.points(unit[is_allowed]))
            values[is_allowed] = bound.sign * outputs.array[:, outputs.column(bound.output)]
        return np.where(np.isnan(values), np.inf, values)

    def output_range(self, output: str) -> float:
        """Return the range of an output over all samples, the unit of its slopes; 1 if it is 0."""
        values = self.campaign.samples.values
        column = values.array[:, values.column(output)]
        span = float(np.nanmax(column) - np.nanmin(column))
        return span if span >= np.finfo(float).tiny else 1.0

    def largest_slope(self, point: Array, output: str) -> float:
        """Largest slope of an output at a point, along the inputs that are inside their cuts there.

        Differences to both sides are taken, so that kinks and jumps show.

        Args:
            point: Inputs, shape (inputs,).
            output: Name of the output.

        Returns:
            The slope in ranges of the output over the width of the cut; 0 if all inputs are at an
            end.
        """
        unit = self.unit(point[None])[0]
        inner = np.flatnonzero((unit > _LARGE_DIFFERENCE) & (unit < 1 - _LARGE_DIFFERENCE))
        steps = _LARGE_DIFFERENCE * np.eye(len(unit))[inner]
        probes = np.concatenate([unit[None], unit + steps, unit - steps])
        here, *around = self.values(probes, Bound(output, 1.0))
        allowed = np.array([value for value in around if np.isfinite(value)])
        slopes = np.abs(allowed - here) / _LARGE_DIFFERENCE / self.output_range(output)
        return float(slopes.max(initial=0.0))

    def descend(self, start: Array, bound: Bound, first_step: float = inf) -> Optimum:
        """Local optimum that a gradient descent inside the cut reaches.

        L-BFGS-B, or SLSQP with interactions, on differences; all samples stay in the campaign.

        Args:
            start: Allowed point in unit coordinates, shape (uncertain inputs,).
            bound: Output and sign that are minimised.
            first_step: Longest first step in unit coordinates: a short one does not leave the basin
                of its start. Without limit it mostly reaches a face at once.
        """
        objective = _Objective(self, bound, start, first_step)
        if self.domain.interactions:
            return self._descend_with_interactions(objective, start)
        factor = objective.factor
        tolerances = {"ftol": _LEAST_CHANGE * factor, "gtol": _LEAST_SLOPE * factor}
        result = objective.minimise(start, "L-BFGS-B", tolerances)
        value = objective.start_value + objective.unit * float(result.fun) / factor
        slope = _free_slope(result.x, result.jac / factor)
        return Optimum(self, bound, self.points(result.x[None])[0], value, slope)

    def _descend_with_interactions(self, objective: _Objective, start: Array) -> Optimum:
        """Better of the start and SLSQP's result, which is moved back until it is allowed."""
        slack = {"type": "ineq", "fun": lambda unit: float(self.slack(unit[None])[0])}
        tolerances = {"ftol": _LEAST_MODEL_CHANGE * objective.factor}
        result = objective.minimise(start, "SLSQP", tolerances, constraints=[slack])
        end = first_allowed_point(np.clip(result.x, 0, 1), start, self.slack)
        candidates = np.stack([start, end])
        values = self.values(candidates, objective.bound)
        best = int(values.argmin())
        point = self.points(candidates)[best]
        return Optimum(self, objective.bound, point, float(values[best]), np.inf)


class _Objective:
    """Change of sign · output from the start of a descent, in ranges of the output.

    It is scaled by `factor`, since both minimisers begin with a step of one gradient.

    Args:
        cut: Where the descent takes place.
        bound: Output and sign that are minimised.
        start: Allowed point in unit coordinates, shape (uncertain inputs,).
        first_step: Longest first step in unit coordinates.
    """

    def __init__(self, cut: CutSearch, bound: Bound, start: Array, first_step: float) -> None:
        self.cut, self.bound = cut, bound
        self.unit = cut.output_range(bound.output)
        self.start_value = float(cut.values(start[None], bound)[0])
        self.factor = 1.0
        slope = float(np.linalg.norm(self(start)[1]))
        self.factor = min(_STEEPNESS, first_step / max(slope, _FLAT))

    def __call__(self, unit: Array) -> tuple[float, Array]:
        """Return value and gradient at a point of the unit cube, by one-sided differences."""
        steps = np.where(unit + _DIFFERENCE > 1, -_DIFFERENCE, _DIFFERENCE)
        points = self.cut.points(np.concatenate([unit[None], unit + np.diag(steps)]))
        rows = self.cut.campaign(points)
        values = self.bound.sign * rows.array[:, rows.column(self.bound.output)]
        changes = np.nan_to_num((values - self.start_value) / self.unit, nan=_FAILED)
        gradient = (changes[1:] - changes[0]) / steps
        return self.factor * float(changes[0]), self.factor * gradient

    def minimise(
        self, start: Array, algorithm: str, tolerances: Mapping[str, float], **settings: object
    ) -> Any:
        """Minimise over the unit cube; SciPy's `OptimizeResult`."""
        from scipy.optimize import minimize

        options = {"maxiter": _MAX_ITERATIONS, **tolerances}
        cube = [(0.0, 1.0)] * len(start)
        return minimize(
            self, start, jac=True, bounds=cube, method=algorithm, options=options, **settings
        )


@dataclass(frozen=True, eq=False)
class Optimum:
    """Local optimum that a descent has reached.

    Args:
        cut: The cut in which it was searched.
        bound: Output and sign that were minimised.
        point: Inputs, shape (inputs,).
        value: sign · output there.
        slope: Largest slope along an input that can still change, in ranges of the output over the
            width of the cut; infinite where it was not computed.
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


def _free_slope(unit: Array, gradient: Array) -> float:
    """Return the largest component of a gradient that does not point out of the unit cube."""
    stopped = ((unit <= 0) & (gradient > 0)) | ((unit >= 1) & (gradient < 0))
    return float(np.abs(np.where(stopped, 0.0, gradient)).max(initial=0.0))


def cuts_with_width(campaign: Campaign, domain: Domain) -> Iterator[CutSearch]:
    """Yield the cuts in which an input is uncertain, from the narrowest to the widest."""
    for level in reversed(range(len(domain.alpha))):
        cut = CutSearch(campaign, domain, level)
        if len(cut.uncertain_inputs):
            yield cut


def attained_bounds(campaign: Campaign, domain: Domain, method: str, *, ended: bool) -> Bounds:
    """Return the bounds that all samples of a search attain; a note says if the budget ended it."""
    bounds = bounds_of_samples(domain, campaign.samples, method)
    note = "the budget ended the search: a larger one may find more"
    return replace(bounds, notes=(note,)) if ended else bounds
