"""The method that is taken where none is named: corners where they suffice, else single linkage.

At 24 points of the widest cut each input is changed alone: at 20 along a walk whose coordinates
form a Latin hypercube, and at the two corners at which those signs place the extremes, by a small
and by a large step. A single input takes 15 and no large steps, as all its samples differ in it
alone. Where the differences of every input keep their sign, and no two samples contradict it, all
corners of the cuts among them, two corners of each cut bound the output. This is evidence, not
proof.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs, contradiction, negligible
from alphacut.fuzzy.plans.cut import CutSearch, cuts_with_width
from alphacut.fuzzy.plans.design import bounds_of_samples
from alphacut.fuzzy.plans.single_linkage import (
    EQUAL,
    ROUNDING,
    SEED,
    VALUE_TOLERANCE,
    SingleLinkage,
)
from alphacut.fuzzy.plans.transformation import Reduced, corners_suffice
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import Domain

_MAX_SEARCHED = 12  # outputs of which each bound is searched; of more each bound is costly
_WALK = 20  # points along the walk
_WALK_OF_ONE = 15  # points along the walk of a single input
_SMALL_STEP = 1e-3  # of the width: detects humps near a corner; the large step detects jumps


@dataclass(frozen=True)
class Automatic:
    """Corners where they suffice, else multi-level single linkage.

    Corners are guaranteed to suffice where the knowledge about the model says so. They are
    estimated to suffice where the differences of every input keep their sign at 24 points of the
    widest cut (a single input: 17). Other outputs are searched (Rinnooy Kan, Timmer 1987) until the
    share of each cut that is not yet covered is small (Boender, Rinnooy Kan 1987): the bounds are
    then estimated, to 1e-5 of the range. They are attained where the budget ends the search, or
    where a bound lies at a kink or a jump. Of more than 12 outputs none is searched.

    Example:
        >>> from alphacut.fuzzy import Interval, propagate
        >>> bounds = propagate(lambda x: x * (1 - x), {"x": Interval(0, 1)}, Automatic(), alpha=[0])
        >>> bounds.upper.round(6).item(), str(bounds.nature)
        (0.25, 'estimated')
    """

    name = "automatic"

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Bounds of every output: by corners if the knowledge allows, else by a search."""
        outputs = campaign.output_names(domain)
        stated = campaign.knowledge.stated_signs(domain.names, outputs)
        if corners_suffice(domain, stated).all():
            return replace(Reduced().run(campaign, domain), method=self.name)
        monotone: Mask = np.zeros(len(outputs), bool)
        linkage, ended, notes = None, False, list[str]()
        if cuts := list(cuts_with_width(campaign, domain)):
            try:
                walk = walk_signs(campaign, cuts[-1])
                monotone = walk.monotone
                if monotone.any():
                    which = f"keep their sign at {walk.n_points} points"
                    notes.append(
                        f"corners alone bound {_listed(np.array(outputs)[monotone])}:"
                        f" the differences of each input {which}"
                    )
                if walk.is_constant.any():
                    constant = _listed(np.array(outputs)[walk.is_constant])
                    notes.append(f"{constant} does not change along the walk, and is not searched")
                if not (monotone | walk.is_constant).all():
                    names = tuple(np.array(outputs)[~(monotone | walk.is_constant)])
                    searched = names if len(names) <= _MAX_SEARCHED else ()
                    linkage = SingleLinkage(campaign, domain, searched)
                    linkage.run(walk.samples)
            except SpentError:
                ended = True
        if linkage is not None and linkage.outputs:
            notes.append(linkage.summary())
            rough = () if ended else [name for name in linkage.outputs if linkage.is_rough(name)]
            if rough:
                notes.append(f"a bound of {_listed(rough)} lies at a kink or a jump")
        if ended:
            notes.append("the budget ended the search: a larger one may find more")
        found_all = [linkage is not None and linkage.is_estimate(output) for output in outputs]
        bounds = bounds_of_samples(domain, campaign.samples, self.name)
        return replace(_with_errors(bounds, monotone | found_all, domain), notes=tuple(notes))


def _with_errors(bounds: Bounds, is_estimated: Mask, domain: Domain) -> Bounds:
    """Copy of attained bounds in which those of some outputs (outputs,) are estimated."""
    size = np.maximum(np.abs(bounds.lower), np.abs(bounds.upper)).max(axis=0)
    error: Array = VALUE_TOLERANCE * (bounds.upper - bounds.lower)[0] + ROUNDING * size
    lower, upper = domain.boxes
    is_crisp = (lower == upper).all(axis=1)[:, None]
    natures = tuple(Nature.ESTIMATED if x else Nature.ATTAINED for x in is_estimated)
    return replace(
        bounds,
        error=np.where(is_estimated & ~is_crisp, error, 0.0),
        natures=natures,
        nature=Nature.weakest(natures),
    )


def _listed(names: Iterable[str]) -> str:
    first = list(names)
    return ", ".join(first[:4]) + (" …" if len(first) > 4 else "")


class SignWalk(NamedTuple):
    """What differences of every input tell of the outputs.

    Args:
        samples: Points of the walk between which each input changes once, in unit coordinates,
            shape (steps + 1, uncertain inputs): a Latin hypercube sample of the widest cut.
        n_points: Points of the widest cut at which each input is changed alone.
        is_constant: Outputs that are the same all along the walk, a mask (outputs,).
        monotone: Outputs that two corners of each cut bound, by all samples, a mask (outputs,).
    """

    samples: Array
    n_points: int
    is_constant: Mask
    monotone: Mask


def walk_signs(campaign: Campaign, widest: CutSearch) -> SignWalk:
    """Change every input alone along a walk through the widest cut, and beside its corners.

    The corners that bound an output by these signs are samples of the campaign afterwards.
    """
    from scipy.stats import qmc

    inputs = len(widest.uncertain_inputs)
    count = _WALK if inputs > 1 else _WALK_OF_ONE
    hypercube = qmc.LatinHypercube(inputs, rng=np.random.default_rng([SEED, 0]))
    turns: Array = hypercube.random(count + 1)
    walk = np.empty((count * inputs + 1, inputs))
    for column in range(inputs):  # each step changes one input, in turn
        changes = np.arange(len(walk)) + inputs - 1 - column
        walk[:, column] = turns[changes // inputs, column]
    values = campaign(widest.points(walk)).array
    tolerance = negligible(campaign.samples.values.array)
    directions = np.sign(np.diff(walk, axis=0).sum(axis=1))
    differences = np.diff(values, axis=0) * directions[:, None]
    by_input = differences.reshape(count, inputs, -1)
    falls, rises = (by_input < -tolerance).any(axis=0), (by_input > tolerance).any(axis=0)
    is_unknown = (falls & rises) | np.isnan(by_input).any(axis=0)
    # an input with an effect here and none there: on a plateau corners tell nothing
    is_tied = np.abs(by_input) <= EQUAL * np.abs(values).max(axis=0)
    is_unknown |= is_tied.any(axis=0) & ~is_tied.all(axis=0)
    is_constant = np.asarray(is_tied.all(axis=(0, 1)))
    signs = np.where(is_unknown, 0, np.where(falls, -1, 1)).astype(np.int8).T
    monotone: Mask = np.asarray((signs != 0).all(axis=1)) & ~is_constant
    for pattern in np.unique(signs[monotone], axis=0):
        _evaluate_corners(campaign, widest, pattern, turns[:2])
    samples = campaign.samples
    points = samples.points[:, widest.uncertain_inputs]
    for column in np.flatnonzero(monotone):
        output = samples.values.array[:, column]
        monotone[column] = contradiction(points, output, signs[column]) is None
    return SignWalk(turns, count + 2 * (2 if inputs > 1 else 1), is_constant, monotone)


def _evaluate_corners(
    campaign: Campaign, widest: CutSearch, signs: Signs, large_steps: Array
) -> None:
    """Evaluate extreme corners of each cut for such signs, and steps from the widest."""
    greatest = (signs > 0).astype(float)
    corners = np.stack([greatest, 1 - greatest])
    steps = np.eye(len(signs)) * (1 - 2 * corners[:, None])  # inwards
    scaled_steps = _SMALL_STEP * steps
    if len(signs) > 1:
        scaled_steps = np.concatenate([scaled_steps, large_steps[:, None] * steps], axis=1)
    neighbours = corners[:, None] + scaled_steps
    campaign(widest.points(neighbours.reshape(-1, len(signs))))
    for cut in cuts_with_width(campaign, widest.domain):
        extremes = corners[:, np.isin(widest.uncertain_inputs, cut.uncertain_inputs)]
        campaign(cut.points(np.concatenate([extremes, cut.corners])))
