"""Outputs whose corners suffice, as differences of every input in the widest cut show.

At 24 points of the widest cut each input is changed alone: at 20 along a walk whose coordinates
form a Latin hypercube, and at the two corners that the signs seen there name, by a small and by a
large step. A single input takes 15 and no large steps, as all its samples differ in it alone. Where
the differences of every input keep their sign, and no two samples contradict it, all corners of the
cuts among them, two corners of each cut bound the output. This is evidence, not proof.
"""

from __future__ import annotations

import numpy as np

from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs, contradiction, negligible
from alphacut.fuzzy.plans.cut import CutSearch, cuts_with_width

_WALK = 20  # points along the walk
_WALK_OF_ONE = 15  # the same of a single input
_SMALL_STEP = 1e-3  # of the width: sees humps near a corner, the large one sees jumps


class SignWalk:
    """Differences of every input along a walk through the widest cut.

    Args:
        campaign: The model.
        cut: The widest cut.
        seed: Seed of the walk.

    Attributes:
        steps: Points along the walk at which each input is changed.
        base: Points of the walk at which all inputs have changed since the last, in unit
            coordinates, shape (steps + 1, moving): uniform samples of the cut.
    """

    def __init__(self, campaign: Campaign, cut: CutSearch, seed: int) -> None:
        from scipy.stats import qmc

        self.campaign, self.cut = campaign, cut
        hypercube = qmc.LatinHypercube(len(cut.moving), rng=np.random.default_rng([seed, 0]))
        self.steps = _WALK if len(cut.moving) > 1 else _WALK_OF_ONE
        self.base: Array = hypercube.random(self.steps + 1)

    @property
    def points(self) -> int:
        """Points of the widest cut at which each input is changed alone."""
        return self.steps + 2 * (2 if len(self.cut.moving) > 1 else 1)

    def corners_suffice(self) -> Mask:
        """Outputs that the corners of all cuts bound, as far as is seen, shape (outputs,).

        Those corners are among the samples of the campaign afterwards.
        """
        signs = self._signs_along_walk()
        steady: Mask = np.asarray((signs != 0).all(axis=1))
        for pattern in np.unique(signs[steady], axis=0):
            self._run_corners(pattern)
        samples = self.campaign.samples
        points = samples.points[:, self.cut.moving]
        for column in np.flatnonzero(steady):
            values = samples.values.array[:, column]
            steady[column] = contradiction(points, values, signs[column]) is None
        return steady

    def _signs_along_walk(self) -> Signs:
        """Sign of each input's differences; 0 where they have both, shape (outputs, moving).

        An input without any effect has the sign 1.
        """
        inputs = len(self.cut.moving)
        steps = self.steps * inputs
        walk = np.empty((steps + 1, inputs))
        for column in range(inputs):
            changes = np.arange(steps + 1) + inputs - 1 - column
            walk[:, column] = self.base[changes // inputs, column]
        values = self.campaign(self.cut.points(walk)).array
        small = negligible(self.campaign.samples.values.array)
        rises = np.diff(values, axis=0) * np.sign(np.diff(walk, axis=0).sum(axis=1))[:, None]
        by_input = rises.reshape(self.steps, inputs, -1)
        falls = (by_input < -small).any(axis=0)
        mixed = (falls & (by_input > small).any(axis=0)) | np.isnan(by_input).any(axis=0)
        return np.where(mixed, 0, np.where(falls, -1, 1)).astype(np.int8).T

    def _run_corners(self, signs: Signs) -> None:
        """Run the corners of each cut, and steps from two of the widest cut along each input."""
        highest = (signs > 0).astype(float)
        corners = np.stack([highest, 1 - highest])
        steps = np.eye(len(signs)) * (1 - 2 * corners[:, None])  # inwards
        sizes = _SMALL_STEP * steps
        if len(signs) > 1:
            sizes = np.concatenate([sizes, self.base[:2, None] * steps], axis=1)
        around = corners[:, None] + sizes
        self.campaign(self.cut.points(around.reshape(-1, len(signs))))
        for cut in cuts_with_width(self.campaign, self.cut.domain):
            named = corners[:, np.isin(self.cut.moving, cut.moving)]
            self.campaign(cut.points(np.concatenate([named, cut.corners])))
