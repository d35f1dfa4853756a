"""Methods, and designs: the samples of every α-level and how their values become α-cuts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from alphacut.fuzzy.arrays import Array, Ints, Mask
from alphacut.fuzzy.campaign.call import Samples, Values
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import contradiction, negligible
from alphacut.fuzzy.refused import FailedError, require
from alphacut.fuzzy.result import Bounds, Ends, Nature
from alphacut.fuzzy.sets.boxes import Domain, quasi_random_points


class Plan(Protocol):
    """Plan of the evaluations that bound a model over the boxes of its inputs: a dataclass."""

    @property
    def name(self) -> str:
        """The word for it in a case file."""

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Bounds of every output on every level."""


@dataclass(frozen=True)
class Design:
    """Distinct samples (n, inputs) over a domain, and for each level the rows of its samples."""

    domain: Domain
    points: Array
    levels: tuple[Ints, ...]

    @classmethod
    def from_levels(cls, domain: Domain, points: Sequence[Array]) -> Design:
        """Design from the points of each level, shape (n_level, inputs)."""
        distinct, inverse = np.unique(np.concatenate(points), axis=0, return_inverse=True)
        ends = np.cumsum([len(rows) for rows in points])[:-1]
        return cls(domain, distinct, tuple(np.split(inverse.ravel(), ends)))

    def bounds(self, values: Values, method: str) -> Bounds:
        """Attained bounds: extremes over the samples of each level and of all higher levels.

        This is the retransformation of Hanss (2005). `values` are outputs at `points`, NaN where a
        sample failed and was skipped.
        """
        lowest, highest = self._extremes(values.array), self._extremes(-values.array)
        columns = np.arange(values.array.shape[1])
        return Bounds(
            alpha=np.array(self.domain.alpha),
            lower=values.array[lowest, columns],
            upper=values.array[highest, columns],
            lower_at=self.points[lowest],
            upper_at=self.points[highest],
            error=np.zeros(lowest.shape),
            nature=Nature.ATTAINED,
            outputs=values.columns,
            inputs=self.domain.inputs,
            method=method,
        )

    def _extremes(self, values: Array) -> Ints:
        """Row of the sample with the least of the values (n, outputs), shape (levels, outputs)."""
        columns = np.arange(values.shape[1])
        usable = np.where(np.isnan(values), np.inf, values)
        least_rows: list[Ints] = []  # from the highest level down
        for alpha, rows in zip(reversed(self.domain.alpha), reversed(self.levels), strict=True):
            candidates = [*least_rows[-1:]]  # higher levels are contained in lower ones
            if len(rows):
                candidates.insert(0, rows[usable[rows].argmin(axis=0)])
            if not candidates or np.isinf(usable[candidates[0], columns]).any():
                raise FailedError(f"no sample of the cut at α = {alpha:g} has a value")
            stacked = np.array(candidates)
            least_rows.append(stacked[usable[stacked, columns].argmin(axis=0), columns])
        return np.array(least_rows[::-1])


def bounds_of_samples(domain: Domain, samples: Samples, method: str) -> Bounds:
    """Return the bounds that samples attain; each level uses all samples that lie in its cut."""
    levels = tuple(np.flatnonzero(inside) for inside in domain.inside(samples.points))
    return Design(domain, samples.points, levels).bounds(samples.values, method)


def guaranteed_bounds(bounds: Bounds, campaign: Campaign, proved: Mask) -> Bounds:
    """Copy of bounds at corners, guaranteed for the outputs `proved` (outputs,) by the knowledge.

    It is tested by further samples inside the cuts.

    Raises:
        RefusedError: A sample contradicts the knowledge.
    """
    if not proved.any():
        return bounds
    campaign(_test_points(Domain(bounds.inputs, tuple(bounds.alpha)), campaign))
    samples, knowledge = campaign.samples, campaign.knowledge
    signs = knowledge.stated_signs(tuple(bounds.inputs), bounds.outputs)
    is_exceeded = _exceeded_outputs(bounds, samples)
    words, allowed = repr(knowledge.words), "facts that hold over the whole supports"
    for column in np.flatnonzero(proved):
        pair = contradiction(samples.points, samples.values.array[:, column], signs[column])
        agrees, key = pair is None and not is_exceeded[column], bounds.outputs[column]
        cure = f"samples contradict it{_pair_words(bounds, pair)}"
        require(agrees, f"knowledge of {key}", value=words, allowed=allowed, cure=cure)
    natures = tuple(Nature.GUARANTEED if x else Nature.ATTAINED for x in proved)
    evidence = f"which {len(samples.points):,} samples do not contradict"
    return replace(
        bounds,
        natures=natures,
        nature=Nature.weakest(natures),
        basis=(f"{knowledge.words}, {evidence}",),
        inner=Ends(bounds.lower, bounds.upper),
    )


def _test_points(domain: Domain, campaign: Campaign) -> Array:
    """Points inside the cuts at which stated knowledge is tested, shape (n, inputs)."""
    # the narrowest cut with a width gets all tests, each wider one a quarter as many: points of a
    # narrower cut lie in the wider ones, too
    lower, upper = domain.boxes
    widths, tests, points = upper - lower, campaign.knowledge.tests, list[Array]()
    ends = np.hstack([lower, upper])
    differs = np.append(True, (np.diff(ends, axis=0) != 0).any(axis=1))  # from the cut below
    for level in np.flatnonzero(differs & widths.any(axis=1))[::-1]:
        count = -(-tests // 4) if points else tests
        unit_points = quasi_random_points(len(domain.names), count, skip=len(points))
        points += list(lower[level] + widths[level] * unit_points)
    return np.array(points[: campaign.remaining]).reshape(-1, len(domain.names))


def _exceeded_outputs(bounds: Bounds, samples: Samples) -> Mask:
    """Mask of the outputs that exceed their bounds at a sample of the cut, shape (outputs,)."""
    sampled = bounds_of_samples(Domain(bounds.inputs, tuple(bounds.alpha)), samples, "")
    tolerance = negligible(samples.values.array)
    below = sampled.lower < bounds.lower - tolerance
    return np.asarray((below | (sampled.upper > bounds.upper + tolerance)).any(axis=0))


def _pair_words(bounds: Bounds, pair: tuple[Array, Array] | None) -> str:
    """Text that names the two samples which contradict a sign; empty without a pair."""
    if pair is None:
        return ""
    first, second = (
        ", ".join(f"{name} = {x:.6g}" for name, x in zip(bounds.inputs, point, strict=True))
        for point in pair
    )
    return f": at {first} it is larger than at {second}"
