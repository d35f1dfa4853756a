"""The method that is taken where none is named: corners where they suffice, else single linkage.

Each input is changed alone, at points of the widest cut of two kinds.

- 20 points along a walk whose coordinates form a Latin hypercube.
- Staircases from the two corners at which those signs place the extremes, through the cut to the
  corner opposite: 20 points each, 40 for a single input, at distances from the corner that grow
  from 1e-4 of the width to all of it, as many in each decade. A jump or a wave of the output that
  is small beside its trend can exceed the corner only where the trend has changed the output by
  less: near the corner, at a distance that nobody knows beforehand.

Where the differences of every input keep their sign, and no two samples contradict it, all corners
of the cuts among them, two corners of each cut bound the output. This is evidence, not proof.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
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
# Points along the walk and along each staircase, tuned: 2,700 of 6,000 trends with a wave, jumps or
# humps beside them kept their signs there, and of these 1 exceeded its corners. With 24 points and
# single steps from the corners it was 144 of 898.
_WALK = 20
_STAIRCASE = 20
_STAIRCASE_OF_ONE = 40  # the same of a single input, whose steps are few
_DECADES = 4.0  # of distances from the corner along a staircase: from 1e-4 of the width to 1


@dataclass(frozen=True)
class Automatic:
    """Corners where they suffice, else multi-level single linkage.

    Corners are guaranteed to suffice where the knowledge about the model says so. They are
    estimated to suffice where the differences of every input keep their sign at 60 points of the
    widest cut, 40 of them towards two of its corners (a single input: 100 and 80). Other outputs
    are searched (Rinnooy Kan, Timmer 1987) until the share of each cut that is not yet covered is
    small (Boender, Rinnooy Kan 1987): the bounds are then estimated, to 1e-5 of the range. They are
    attained where the budget ends the search, where a bound lies at a kink or a jump, and where
    differences show jumps or waves beside the corners or optima, over which descents pass. Of more
    than 12 outputs none is searched.

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
        is_rough = np.zeros_like(monotone)
        linkage, ended, notes = None, False, list[str]()
        if cuts := list(cuts_with_width(campaign, domain)):
            try:
                walk = walk_signs(campaign, cuts[-1])
                monotone, is_rough = walk.monotone, walk.is_rough
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
                    wavy = [x for x in linkage.outputs if linkage.passes_over_waves(x)]
                    is_rough = is_rough | np.isin(outputs, wavy)
                    linkage.search()  # further, where a look beside the optima found others
            except SpentError:
                ended = True
        if linkage is not None and linkage.outputs:
            notes.append(linkage.summary())
            if is_rough.any():
                rough = _listed(np.array(outputs)[is_rough])
                notes.append(f"descents may pass over jumps or waves beside a trend of {rough}")
            kinked = () if ended else [name for name in linkage.outputs if linkage.is_rough(name)]
            if kinked:
                notes.append(f"a bound of {_listed(kinked)} lies at a kink or a jump")
        if ended:
            notes.append("the budget ended the search: a larger one may find more")
        has_estimate = [linkage is not None and linkage.is_estimate(output) for output in outputs]
        found_all = np.array(has_estimate, bool) & ~is_rough
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
        is_rough: Outputs with jumps or waves that are small beside a trend, a mask (outputs,):
            differences keep their sign along the walk, and change it there and back beside it.
    """

    samples: Array
    n_points: int
    is_constant: Mask
    monotone: Mask
    is_rough: Mask


def walk_signs(campaign: Campaign, widest: CutSearch) -> SignWalk:
    """Change every input alone along a walk through the widest cut, and along staircases.

    The corners that bound an output by these signs are samples of the campaign afterwards.
    """
    from scipy.stats import qmc

    inputs = len(widest.uncertain_inputs)
    hypercube = qmc.LatinHypercube(inputs, rng=np.random.default_rng([SEED, 0]))
    turns: Array = hypercube.random(_WALK + 1)
    walk = _changed_in_turn(turns)
    values = campaign(widest.points(walk)).array
    tolerance = negligible(campaign.samples.values.array)
    directions = np.sign(np.diff(walk, axis=0).sum(axis=1))
    differences = np.diff(values, axis=0) * directions[:, None]
    by_input = differences.reshape(_WALK, inputs, -1)
    falls, rises = (by_input < -tolerance).any(axis=0), (by_input > tolerance).any(axis=0)
    is_unknown = (falls & rises) | np.isnan(by_input).any(axis=0)
    # an input with an effect here and none there: on a plateau corners tell nothing
    is_tied = np.abs(by_input) <= EQUAL * np.abs(values).max(axis=0)
    is_unknown |= is_tied.any(axis=0) & ~is_tied.all(axis=0)
    is_constant = np.asarray(is_tied.all(axis=(0, 1)))
    signs = np.where(is_unknown, 0, np.where(falls, -1, 1)).astype(np.int8).T
    has_signs: Mask = np.asarray((signs != 0).all(axis=1)) & ~is_constant
    monotone = has_signs.copy()
    turns_once = np.zeros_like(monotone)
    # an output that rises where another falls, with every input, has the same extreme corners
    patterns = signs * signs[:, :1]
    for pattern in np.unique(patterns[monotone], axis=0):
        columns = np.flatnonzero(has_signs & (patterns == pattern).all(axis=1))
        staircases = _climb_staircases(campaign, widest, pattern, signs[columns, 0], columns)
        monotone[columns] = staircases.keeps_signs
        turns_once[columns] = staircases.turns_once
    samples = campaign.samples
    points = samples.points[:, widest.uncertain_inputs]
    for column in np.flatnonzero(monotone):
        output = samples.values.array[:, column]
        monotone[column] = contradiction(points, output, signs[column]) is None
    # at a smooth optimum each input's effect changes its sign once, and descents find the optimum
    is_rough = has_signs & ~monotone & ~turns_once
    n_points = _WALK + 2 * _staircase_points(inputs)
    return SignWalk(turns, n_points, is_constant, monotone, is_rough)


def _changed_in_turn(turns: Array) -> Array:
    """Path through points (n, inputs) in order, shape ((n − 1) inputs + 1, inputs).

    Each step changes one input, the first input first, from its value at a point to that at the
    next one.
    """
    count, inputs = turns.shape
    path = np.empty(((count - 1) * inputs + 1, inputs))
    for column in range(inputs):
        changes = np.arange(len(path)) + inputs - 1 - column
        path[:, column] = turns[changes // inputs, column]
    return path


def _staircase_points(inputs: int) -> int:
    return _STAIRCASE if inputs > 1 else _STAIRCASE_OF_ONE


class _Staircases(NamedTuple):
    """Whether some outputs keep the signs of effects along staircases: masks (outputs,).

    Args:
        keeps_signs: No step changes the output, by more than rounding, against the signs.
        turns_once: Of the steps of each input along a staircase, those against the signs are the
            first ones, or the last ones.
    """

    keeps_signs: Mask
    turns_once: Mask


def _climb_staircases(
    campaign: Campaign, widest: CutSearch, pattern: Signs, first_signs: Signs, columns: Ints
) -> _Staircases:
    """Evaluate the extreme corners of each cut, and staircases from those of the widest one.

    Args:
        campaign: Evaluates the points.
        widest: The widest cut.
        pattern: Signs of the inputs' effects relative to the first input's, shape (inputs,).
        first_signs: Sign of the first input's effect on each of the outputs, shape (outputs,).
        columns: Columns of the outputs in the samples, shape (outputs,).
    """
    inputs = len(pattern)
    count = _staircase_points(inputs)
    rng = np.random.default_rng([SEED, 1])
    first_corner = (pattern > 0).astype(float)
    corners = np.stack([first_corner, 1 - first_corner])
    keeps_signs: Mask = np.ones(len(columns), bool)
    turns_once: Mask = np.ones(len(columns), bool)
    for corner, side in zip(corners, (1, -1), strict=True):
        # one distance of each input in each of equal parts of the logarithmic scale
        exponents = (np.arange(count)[:, None] + rng.random((count, inputs))) / count - 1
        distances = np.concatenate([np.zeros((1, inputs)), 10.0 ** (_DECADES * exponents)])
        points = corner + (1 - 2 * corner) * _changed_in_turn(distances)
        values = campaign(widest.points(points)).array[:, columns]
        tolerance = negligible(campaign.samples.values.array)[columns]
        # by the signs the output falls from its upper corner on, and rises from its lower one
        changes = side * first_signs * np.diff(values, axis=0)
        contradicts = ~(changes <= tolerance)  # also where a sample failed
        keeps_signs &= ~contradicts.any(axis=0)
        by_input = contradicts.reshape(count, inputs, -1)
        turns = by_input[1:] != by_input[:-1]
        turns_once &= (turns.sum(axis=0) <= 1).all(axis=0)
    for cut in cuts_with_width(campaign, widest.domain):
        extremes = corners[:, np.isin(widest.uncertain_inputs, cut.uncertain_inputs)]
        campaign(cut.points(np.concatenate([extremes, cut.corners])))
    return _Staircases(keeps_signs, turns_once)
