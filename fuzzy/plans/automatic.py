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

import numpy as np
from numpy.typing import NDArray

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.fuzzy.campaign.call import SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import Signs, contradiction, negligible
from alphacut.fuzzy.plans.cut import CutSearch, cuts_with_width
from alphacut.fuzzy.plans.design import bounds_of_samples
from alphacut.fuzzy.plans.settings import SEARCH, value_tolerance
from alphacut.fuzzy.plans.single_linkage import SingleLinkage
from alphacut.fuzzy.plans.transformation import Reduced, corners_suffice
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import Domain


@dataclass(frozen=True)
class Automatic:
    """Corners where they suffice, else multi-level single linkage.

    Corners are guaranteed to suffice where the knowledge about the model says so. They are
    estimated to suffice where the differences of every input keep their sign at 60 points of the
    widest cut, 40 of them towards two of its corners (a single input: 100 and 80). Other outputs
    are searched (Rinnooy Kan, Timmer 1987) until the fraction of each cut that is not yet covered
    is small (Boender, Rinnooy Kan 1987): the bounds are then estimated, to 1e-5 of the range. They
    are attained where the budget ends the search, where a bound lies at a kink or a jump, and where
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
        """Return bounds of every output on every level, by corners or by a search.

        If `campaign.knowledge` states signs of all effects, corners of the α-cuts give guaranteed
        bounds. Otherwise the widest cut is sampled and outputs are searched, as far as the budget
        goes: a search that the budget ends gives the bounds that its samples attain, with a note.
        If no input has a width, the nominal point is the only sample.

        Args:
            campaign: Evaluates the model within its budget, and keeps the samples.
            domain: Inputs and levels; the cut of a level is the box of the α-cuts of all inputs.

        Returns:
            Bounds, shape (levels, outputs), each guaranteed, estimated to within a stated error, or
            attained; the inputs that attain them; and notes, one sentence each.

        Raises:
            SpentError: The budget does not carry the first sample.
            RefusedError: Signs are stated, and the budget does not carry all corners or a sample
                contradicts a sign; or the knowledge names an output that the model does not have.
            CampaignError: The model failed at some samples.
            FailedError: The store of samples cannot be written, or a worker process died.
        """
        outputs = campaign.output_names(domain)
        stated = campaign.knowledge.stated_signs(domain.names, outputs)
        if corners_suffice(domain, stated).all():
            return replace(Reduced().run(campaign, domain), method=self.name)
        search = _AutomaticSearch(campaign, domain, np.array(outputs))
        cuts = list(cuts_with_width(campaign, domain))
        if cuts:
            try:
                search.run(cuts[-1])
            except SpentError:
                search.was_ended = True
        bounds = bounds_of_samples(domain, campaign.samples, self.name)
        estimated = _with_errors(bounds, search.is_estimated(), domain)
        return replace(estimated, notes=tuple(search.all_notes()))


class _AutomaticSearch:
    """Walk, staircases and single linkage of one domain, as far as the budget carries them.

    Attributes:
        is_monotone: Outputs that two corners of each cut bound, shape (outputs,).
        is_rough: Outputs with jumps or waves that are small beside a trend, shape (outputs,).
        linkage: Search of the other outputs; None where there are none, or it has not begun.
        was_ended: Whether the budget ended the search.
        notes: A sentence for each finding of the walk.
    """

    def __init__(self, campaign: Campaign, domain: Domain, outputs: NDArray[np.str_]) -> None:
        self.campaign = campaign
        self.domain = domain
        self.outputs = outputs
        self.is_monotone: Mask = np.zeros(len(outputs), bool)
        self.is_rough: Mask = np.zeros(len(outputs), bool)
        self.linkage: SingleLinkage | None = None
        self.was_ended = False
        self.notes: list[str] = []

    def run(self, widest: CutSearch) -> None:
        """Walk through the widest cut, and search the outputs that corners do not bound.

        Samples are added to `self.campaign`, from which the bounds are taken afterwards. What is
        found is written to the attributes as soon as it is known:

        - `is_monotone`: outputs whose effects keep their signs along the walk, so that two corners
          of each cut bound them, shape (outputs,);
        - `is_rough`: outputs with jumps or waves that are small beside a trend, shape (outputs,);
        - `linkage`: the search by descents of the outputs that are neither monotone nor constant
          along the walk; None if there are none. If they are more than 12, their cuts are sampled
          without descents;
        - `notes`: a sentence for each finding of the walk, appended.

        Args:
            widest: Cut of the lowest level, in which some input has a width.

        Raises:
            SpentError: The budget ended the search. The attributes say what is known so far.
            CampaignError: The model failed at some samples.
        """
        walk = walk_signs(self.campaign, widest)
        self.is_monotone = walk.is_monotone
        self.is_rough = walk.is_rough
        if walk.is_monotone.any():
            self.notes.append(
                f"corners alone bound {_few_names(self.outputs[walk.is_monotone])}: the differences"
                f" of each input keep their sign at {walk.n_points} points"
            )
        if walk.is_constant.any():
            constant = _few_names(self.outputs[walk.is_constant])
            self.notes.append(f"{constant} does not change along the walk, and is not searched")
        is_searched = ~(walk.is_monotone | walk.is_constant)
        if not is_searched.any():
            return
        searched = tuple(self.outputs[is_searched])
        # The cost of a search is proportional to its outputs, so many are sampled alone.
        if len(searched) > SEARCH.max_searched_outputs:
            searched = ()
        linkage = SingleLinkage(self.campaign, self.domain, searched)
        self.linkage = linkage
        linkage.run(walk.samples)
        wavy = [name for name in searched if linkage.passes_over_waves(name)]
        self.is_rough = self.is_rough | np.isin(self.outputs, wavy)
        linkage.search()  # further, where the look beside the optima found others

    def is_estimated(self) -> Mask:
        """Return the outputs whose bounds are estimated, and not only attained, shape (outputs,).

        They are the monotone ones (`is_monotone`), which two corners of each cut bound. Besides
        they are those whose search by descents (`linkage`) is complete and has shown no jumps or
        waves beside a trend (`is_rough`). A search is complete if, for the minimum and the maximum
        in all cuts, the expected fraction of the cut in basins that were not seen is below 0.002,
        and the output is smooth at the best optimum.
        """
        linkage = self.linkage
        if linkage is None:
            return self.is_monotone
        # Descents that may have passed over waves leave an output attained, whatever the rule says.
        is_found = np.array([linkage.is_estimate(output) for output in self.outputs], bool)
        return np.asarray(self.is_monotone | (is_found & ~self.is_rough))

    def all_notes(self) -> list[str]:
        """Return a sentence for each finding of the walk and of the search, for the user.

        The notes of the walk come first. If outputs were searched by descents, a summary of the
        search follows, and the outputs with jumps or waves beside a trend. The last note says that
        the budget ended the search, or else which outputs have a bound at a kink or a jump. The
        list is new and may be empty.
        """
        notes = list(self.notes)
        if self.linkage is not None and self.linkage.outputs:
            notes.append(self.linkage.summary())
            if self.is_rough.any():
                rough = _few_names(self.outputs[self.is_rough])
                notes.append(f"descents may pass over jumps or waves beside a trend of {rough}")
        if self.was_ended:
            notes.append("the budget ended the search: a larger one may find more")
        elif self.linkage is not None:
            kinked = [name for name in self.linkage.outputs if self.linkage.is_rough(name)]
            if kinked:
                notes.append(f"a bound of {_few_names(kinked)} lies at a kink or a jump")
        return notes


def _with_errors(bounds: Bounds, is_estimated: Mask, domain: Domain) -> Bounds:
    """Return a copy of attained bounds in which the bounds of some outputs are estimated.

    The error of an estimated output is 1e-5 of its range on the lowest level plus 1e-9 of its
    magnitude, the difference below which a search takes two values for one. It is zero on levels
    where no input has a width. The nature of all outputs together is the weakest of theirs.

    Args:
        bounds: Bounds that samples attain, without errors, shape (levels, outputs).
        is_estimated: The outputs whose bounds are estimated, shape (outputs,); the others stay
            attained.
        domain: Inputs and levels of the bounds.
    """
    magnitudes = np.maximum(np.abs(bounds.lower), np.abs(bounds.upper)).max(axis=0)
    ranges = (bounds.upper - bounds.lower)[0]
    errors: Array = np.array([value_tolerance(*x) for x in zip(ranges, magnitudes, strict=True)])
    lower, upper = domain.boxes
    is_crisp = (lower == upper).all(axis=1)[:, None]
    natures = tuple(Nature.ESTIMATED if x else Nature.ATTAINED for x in is_estimated)
    return replace(
        bounds,
        error=np.where(is_estimated & ~is_crisp, errors, 0.0),
        natures=natures,
        nature=Nature.weakest(natures),
    )


def _few_names(names: Iterable[str]) -> str:
    """Return the first four names, with an ellipsis if there are more."""
    all_names = list(names)
    text = ", ".join(all_names[:4])
    if len(all_names) > 4:
        text += " …"
    return text


@dataclass(frozen=True)
class SignWalk:
    """What differences of every input tell of the outputs.

    Args:
        samples: Points of the walk between which each input changes once, in unit coordinates,
            shape (steps + 1, uncertain inputs): a Latin hypercube sample of the widest cut.
        n_points: Points of the widest cut at which each input is changed alone.
        is_constant: Outputs that are the same all along the walk, shape (outputs,).
        is_monotone: Outputs that two corners of each cut bound, by all samples, shape (outputs,).
        is_rough: Outputs with jumps or waves that are small beside a trend, shape (outputs,):
            differences keep their sign along the walk, and change it there and back beside it.
    """

    samples: Array
    n_points: int
    is_constant: Mask
    is_monotone: Mask
    is_rough: Mask


def walk_signs(campaign: Campaign, widest: CutSearch) -> SignWalk:
    """Find the signs of the effects of every input by changing one input at a time.

    This happens along a walk through 21 random points of the widest cut, a Latin hypercube sample,
    and along staircases from the two corners at which the signs place the extremes of an output to
    the opposite corners. A sign is known if all differences have it, by more than rounding.

    Args:
        campaign: Evaluates the model. Afterwards its samples hold the corners of each α-cut at
            which known signs place the extremes of an output.
        widest: Cut of the lowest level, in unit coordinates of its inputs with a width.

    Returns:
        Which outputs keep the signs of all effects along walk and staircases and in all pairs of
        samples (`is_monotone`), do not change along the walk (`is_constant`), or keep their signs
        along the walk and change one there and back beside it (`is_rough`), shape (outputs,) each;
        and the 21 points in unit coordinates, shape (21, inputs with a width).

    Raises:
        SpentError: The budget does not carry the evaluations.
        CampaignError: The model failed at some points.
    """
    from scipy.stats import qmc

    # Walk through a Latin hypercube sample, and collect the differences by each input.
    inputs = len(widest.uncertain_inputs)
    hypercube = qmc.LatinHypercube(inputs, rng=np.random.default_rng([SEARCH.seed, 0]))
    turns: Array = hypercube.random(SEARCH.walk_points + 1)
    walk = _changed_in_turn(turns)
    values = campaign(widest.points(walk)).array
    tolerance = negligible(campaign.samples.values.array)
    # A step may go up or down along its input: differences are taken as if it went up.
    directions = np.sign(np.diff(walk, axis=0).sum(axis=1))
    differences = np.diff(values, axis=0) * directions[:, None]
    by_input = differences.reshape(SEARCH.walk_points, inputs, -1)  # (steps, inputs, outputs)

    # A sign is known where all differences have it.
    falls = (by_input < -tolerance).any(axis=0)
    rises = (by_input > tolerance).any(axis=0)
    is_unknown = falls & rises
    # An input that has an effect here and none there moves the output off a plateau, of which
    # corners tell nothing.
    is_tied = np.abs(by_input) <= SEARCH.tie * np.abs(values).max(axis=0)
    is_unknown |= is_tied.any(axis=0) & ~is_tied.all(axis=0)
    is_constant: Mask = np.asarray(is_tied.all(axis=(0, 1)))
    known_signs = np.where(falls, -1, 1)
    signs: Signs = np.where(is_unknown, 0, known_signs).astype(np.int8).T  # (outputs, inputs)
    has_signs: Mask = np.asarray((signs != 0).all(axis=1)) & ~is_constant

    # Climb staircases. Outputs of which one rises where the other falls, with every input, have the
    # same extreme corners, and share them.
    is_monotone = has_signs.copy()
    turns_once = np.zeros_like(is_monotone)
    # Relative to the first input, an output and its negative have the same pattern.
    patterns = signs * signs[:, :1]
    for pattern in np.unique(patterns[has_signs], axis=0):
        columns = np.flatnonzero(has_signs & (patterns == pattern).all(axis=1))
        staircases = _climb_staircases(
            campaign, widest, pattern=pattern, first_signs=signs[columns, 0], columns=columns
        )
        is_monotone[columns] = staircases.keeps_signs
        turns_once[columns] = staircases.turns_once

    # Test the signs by all pairs of samples.
    samples = campaign.samples
    points = samples.points[:, widest.uncertain_inputs]
    for column in np.flatnonzero(is_monotone):
        output = samples.values.array[:, column]
        is_monotone[column] = contradiction(points, output, signs[column]) is None

    # At a smooth optimum the effect of each input changes its sign once, and descents find it.
    is_rough = has_signs & ~is_monotone & ~turns_once
    n_points = SEARCH.walk_points + 2 * _staircase_points(inputs)
    return SignWalk(turns, n_points, is_constant, is_monotone, is_rough)


def _changed_in_turn(turns: Array) -> Array:
    """Return a path from point to point that changes one input at a time, the first one first.

    Args:
        turns: The points in their order, shape (n, inputs), n ≥ 1.

    Returns:
        Points of the path, shape ((n − 1) inputs + 1, inputs). Row k · inputs is row k of `turns`,
        counted from 0.
    """
    count, inputs = turns.shape
    path = np.empty(((count - 1) * inputs + 1, inputs))
    for column in range(inputs):
        # The steps column, column + inputs, …, counted from 0, change this input.
        changes = np.arange(len(path)) + inputs - 1 - column
        path[:, column] = turns[changes // inputs, column]
    return path


def _staircase_points(inputs: int) -> int:
    """Return the number of points along each staircase of a cut with so many inputs."""
    return SEARCH.walk_points if inputs > 1 else SEARCH.staircase_points_of_one_input


@dataclass(frozen=True)
class _Staircases:
    """Whether some outputs keep the signs of effects along staircases, shape (outputs,) each.

    Args:
        keeps_signs: No step changes the output, by more than rounding, against the signs.
        turns_once: Of the steps of each input along a staircase, those against the signs are the
            first ones, or the last ones.
    """

    keeps_signs: Mask
    turns_once: Mask


def _climb_staircases(
    campaign: Campaign, widest: CutSearch, *, pattern: Signs, first_signs: Signs, columns: Ints
) -> _Staircases:
    """Test the signs of effects on some outputs along two staircases through the widest cut.

    A staircase begins at one of the two corners where the signs place the extremes, and changes one
    input at a time towards the opposite corner. Each input takes 20 points (40 if it is the only
    one), whose distances from the corner grow from 1e-4 of the width to all of it. The extreme
    corners of all cuts are evaluated, too.

    Args:
        campaign: Evaluates the points, and keeps them as samples.
        widest: Cut of the lowest level; only its inputs with a width are changed.
        pattern: For each of these inputs 1 if its effect has the sign of the first input's effect,
            else −1, shape (inputs,). It is the same for all outputs here.
        first_signs: Sign (1 or −1) of the effect of the first input on each of the outputs, shape
            (outputs,).
        columns: Columns of these outputs in the samples, shape (outputs,).

    Returns:
        For each output, shape (outputs,): whether all steps of both staircases change it by the
        signs, to rounding (`keeps_signs`); and whether, for each input, the steps against its sign
        are the first ones or the last ones of a staircase (`turns_once`).

    Raises:
        SpentError: The budget does not carry the evaluations.
        CampaignError: The model failed at some points.
    """
    inputs = len(pattern)
    count = _staircase_points(inputs)
    rng = np.random.default_rng([SEARCH.seed, 1])
    upper_corner = (pattern > 0).astype(float)  # where the output is largest if first_signs is 1
    corners = np.stack([upper_corner, 1 - upper_corner])
    keeps_signs: Mask = np.ones(len(columns), bool)
    turns_once: Mask = np.ones(len(columns), bool)
    for corner, side in zip(corners, (1, -1), strict=True):
        # The logarithmic scale from 1e-4 to 1 is divided into equal parts, and each input takes one
        # random distance from the corner in each part.
        places = (np.arange(count)[:, None] + rng.random((count, inputs))) / count
        distances = 10.0 ** (4.0 * (places - 1))
        path = _changed_in_turn(np.concatenate([np.zeros((1, inputs)), distances]))
        points = corner + (1 - 2 * corner) * path
        values = campaign(widest.points(points)).array[:, columns]
        tolerance = negligible(campaign.samples.values.array)[columns]
        # By the signs the output falls from its upper corner on, and rises from its lower one.
        changes = side * first_signs * np.diff(values, axis=0)
        contradicts = changes > tolerance
        keeps_signs &= ~contradicts.any(axis=0)
        by_input = contradicts.reshape(count, inputs, -1)
        n_turns = (by_input[1:] != by_input[:-1]).sum(axis=0)
        # A hump turns once, and descents find it. Waves and jumps turn back.
        turns_once &= (n_turns <= 1).all(axis=0)  # for all inputs
    for cut in cuts_with_width(campaign, widest.domain):
        # In a narrower cut fewer inputs may have a width, so that its corners have fewer columns.
        extremes = corners[:, np.isin(widest.uncertain_inputs, cut.uncertain_inputs)]
        campaign(cut.points(np.concatenate([extremes, cut.corners])))
    return _Staircases(keeps_signs, turns_once)
