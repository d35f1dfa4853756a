"""Methods, and how the values of their samples become α-cuts."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import FailedError, require
from alphacut.fuzzy.campaign.call import Samples
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.knowledge.known import contradiction, negligible
from alphacut.fuzzy.result import Bounds, Ends, Nature
from alphacut.fuzzy.sets.boxes import Domain, quasi_random_points


class Plan(Protocol):
    """Plan of the evaluations that bound a model over the boxes of its inputs: a dataclass."""

    @property
    def name(self) -> str:
        """The word for it in a case file."""

    def run(self, campaign: Campaign, domain: Domain) -> Bounds:
        """Bounds of every output on every level."""


def bounds_of_samples(domain: Domain, samples: Samples, method: str) -> Bounds:
    """Return the bounds that samples attain: on each level the extremes of those in its cut.

    For the points of the transformation method this is the retransformation of Hanss (2005). Values
    are NaN where a sample failed and was skipped.
    """
    values, inside = samples.values.array, domain.inside(samples.points)
    columns = np.arange(values.shape[1])
    rows_of_ends = []
    for signed in (values, -values):
        usable, rows_by_level = np.where(np.isnan(signed), np.inf, signed), []
        for alpha, is_inside in zip(domain.alpha, inside, strict=True):
            rows = np.flatnonzero(is_inside)
            if not len(rows) or np.isinf(usable[rows].min(axis=0)).any():
                raise FailedError(f"no sample of the cut at α = {alpha:g} has a value")
            rows_by_level.append(rows[usable[rows].argmin(axis=0)])
        rows_of_ends.append(np.array(rows_by_level))
    lowest, highest = rows_of_ends
    return Bounds(
        alpha=np.array(domain.alpha),
        lower=values[lowest, columns],
        upper=values[highest, columns],
        lower_at=samples.points[lowest],
        upper_at=samples.points[highest],
        error=np.zeros(lowest.shape),
        nature=Nature.ATTAINED,
        outputs=samples.values.columns,
        inputs=domain.inputs,
        method=method,
    )


def guaranteed_bounds(bounds: Bounds, campaign: Campaign, proved: Mask) -> Bounds:
    """Copy of bounds at corners, guaranteed for the outputs `proved` (outputs,) by the knowledge.

    It is tested by further samples inside the cuts.

    Raises:
        RefusedError: A sample contradicts the knowledge.
    """
    if not proved.any():
        return bounds
    domain = Domain(bounds.inputs, tuple(bounds.alpha))
    campaign(_test_points(domain, campaign))
    samples, knowledge = campaign.samples, campaign.knowledge
    signs = knowledge.stated_signs(tuple(bounds.inputs), bounds.outputs)
    sampled = bounds_of_samples(domain, samples, "")
    tolerance = negligible(samples.values.array)
    below = sampled.lower < bounds.lower - tolerance
    above = sampled.upper > bounds.upper + tolerance
    is_exceeded = np.asarray((below | above).any(axis=0))
    words, allowed = repr(knowledge.words), "facts that hold over the whole supports"
    for column in np.flatnonzero(proved):
        pair = contradiction(samples.points, samples.values.array[:, column], signs[column])
        agrees, key = pair is None and not is_exceeded[column], bounds.outputs[column]
        cure = "samples contradict it"
        if pair is not None:
            named = (zip(bounds.inputs, point, strict=True) for point in pair)
            first, second = (", ".join(f"{name} = {x:.6g}" for name, x in xs) for xs in named)
            cure += f": at {first} it is larger than at {second}"
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
