"""Outputs that two corners of each cut bound, by the signs of differences in the widest cut.

At 24 points of the widest cut each input is changed alone: at 20 along a walk whose coordinates
form a Latin hypercube, and at the two corners at which those signs place the extremes, by a small
and by a large step. A single input takes 15 and no large steps, as all its samples differ in it
alone. Where the differences of every input keep their sign, and no two samples contradict it, all
corners of the cuts among them, two corners of each cut bound the output. This is evidence, not
proof.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs, contradiction, negligible
from alphacut.fuzzy.plans.cut import CutSearch, cuts_with_width

_WALK = 20  # points along the walk
_WALK_OF_ONE = 15  # points along the walk of a single input
_SMALL_STEP = 1e-3  # of the width: detects humps near a corner; the large step detects jumps


class SignWalk:
    """Differences of every input along a walk through the widest cut.

    Attributes:
        steps: Points along the walk at which each input is changed.
        samples: Points of the walk between which each input changes once, in unit coordinates,
            shape (steps + 1, uncertain inputs): a Latin hypercube sample of the cut.
    """

    def __init__(self, campaign: Campaign, widest: CutSearch, seed: int) -> None:
        from scipy.stats import qmc

        self.campaign, self.cut = campaign, widest
        inputs = len(widest.uncertain_inputs)
        self.steps = _WALK if inputs > 1 else _WALK_OF_ONE
        hypercube = qmc.LatinHypercube(inputs, rng=np.random.default_rng([seed, 0]))
        self.samples: Array = hypercube.random(self.steps + 1)

    @property
    def n_points(self) -> int:
        """Points of the widest cut at which each input is changed alone."""
        return self.steps + 2 * (2 if len(self.cut.uncertain_inputs) > 1 else 1)

    def corners_suffice(self) -> Mask:
        """Return the outputs that two corners of each cut bound, by all samples, a mask (outputs,).

        Evaluates those corners, which are samples of the campaign afterwards.
        """
        signs = self._signs_along_walk()
        monotone: Mask = np.asarray((signs != 0).all(axis=1))
        for pattern in np.unique(signs[monotone], axis=0):
            self._evaluate_corners(pattern)
        samples = self.campaign.samples
        points = samples.points[:, self.cut.uncertain_inputs]
        for column in np.flatnonzero(monotone):
            values = samples.values.array[:, column]
            monotone[column] = contradiction(points, values, signs[column]) is None
        return monotone

    def _signs_along_walk(self) -> Signs:
        """Signs of all differences by each input along the walk, shape (outputs, uncertain inputs).

        0 where differences have both signs or are NaN, 1 for an input without effect.
        """
        inputs = len(self.cut.uncertain_inputs)
        steps = self.steps * inputs
        walk = np.empty((steps + 1, inputs))
        for column in range(inputs):  # each step changes one input, in turn
            changes = np.arange(steps + 1) + inputs - 1 - column
            walk[:, column] = self.samples[changes // inputs, column]
        values = self.campaign(self.cut.points(walk)).array
        tolerance = negligible(self.campaign.samples.values.array)
        directions = np.sign(np.diff(walk, axis=0).sum(axis=1))
        differences = np.diff(values, axis=0) * directions[:, None]
        by_input = differences.reshape(self.steps, inputs, -1)
        falls, rises = (by_input < -tolerance).any(axis=0), (by_input > tolerance).any(axis=0)
        is_unknown = (falls & rises) | np.isnan(by_input).any(axis=0)
        return np.where(is_unknown, 0, np.where(falls, -1, 1)).astype(np.int8).T

    def _evaluate_corners(self, signs: Signs) -> None:
        """Evaluate the extreme corners of each cut for effects of these signs, (uncertain inputs,).

        From the two corners of the widest cut steps along each input are evaluated, too.
        """
        greatest = (signs > 0).astype(float)
        corners = np.stack([greatest, 1 - greatest])
        steps = np.eye(len(signs)) * (1 - 2 * corners[:, None])  # inwards
        scaled_steps = _SMALL_STEP * steps
        if len(signs) > 1:
            scaled_steps = np.concatenate([scaled_steps, self.samples[:2, None] * steps], axis=1)
        neighbours = corners[:, None] + scaled_steps
        self.campaign(self.cut.points(neighbours.reshape(-1, len(signs))))
        for cut in cuts_with_width(self.campaign, self.cut.domain):
            extremes = corners[:, np.isin(self.cut.uncertain_inputs, cut.uncertain_inputs)]
            self.campaign(cut.points(np.concatenate([extremes, cut.corners])))
