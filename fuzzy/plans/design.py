"""Methods, and how the values of their samples become α-cuts."""

from __future__ import annotations

from dataclasses import replace
from typing import Protocol

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import RefusedError
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
        """Return bounds of every output on every level.

        Args:
            campaign: Evaluates the model, within a budget.
            domain: Inputs and levels.
        """


def bounds_of_samples(domain: Domain, samples: Samples, method: str) -> Bounds:
    """Return the bounds that samples attain: on each level the extremes of those in its cut.

    For the points of the transformation method this is the retransformation of Hanss (2005).

    Args:
        domain: Inputs and levels; the cut of a level is the box of the α-cuts of all inputs.
        samples: Points, shape (n, inputs), and the values of all outputs there, shape (n, outputs).
        method: Name of the method that took the samples; it is stated in the result.

    Returns:
        Bounds of the nature "attained" without an error, shape (levels, outputs), and the samples
        that attain them. Of equal extremes the first sample is stated.

    Raises:
        ValueError: No sample lies in the cut of a level.
    """
    values = samples.values.array
    rows_by_level = [np.flatnonzero(is_inside) for is_inside in domain.inside(samples.points)]
    # A sample counts on every level whose cut holds it, not only on the one it was taken for.
    min_rows = np.array([rows[values[rows].argmin(axis=0)] for rows in rows_by_level])
    max_rows = np.array([rows[values[rows].argmax(axis=0)] for rows in rows_by_level])
    columns = np.arange(values.shape[1])
    return Bounds(
        alpha=np.array(domain.alpha),
        lower=values[min_rows, columns],
        upper=values[max_rows, columns],
        lower_at=samples.points[min_rows],
        upper_at=samples.points[max_rows],
        error=np.zeros(min_rows.shape),
        nature=Nature.ATTAINED,
        outputs=samples.values.columns,
        inputs=domain.inputs,
        method=method,
    )


def guaranteed_bounds(bounds: Bounds, campaign: Campaign, proved: Mask) -> Bounds:
    """Return a copy of bounds at corners, guaranteed for some outputs by stated signs.

    If an output rises or falls with each input all over the box, its extremes lie at two corners.
    The caller of the analysis states such signs (`campaign.knowledge`). They are tested by further
    samples inside the cuts, as far as the budget goes.

    Args:
        bounds: Bounds that corners of the cuts attain.
        campaign: Evaluates the model, which adds to its samples.
        proved: Outputs for which a sign of every input with a width is stated, shape (outputs,).

    Returns:
        The bounds with the nature "guaranteed" for the proved outputs and "attained" for the
        others. `basis` has the stated knowledge and the number of samples as a text, and `inner`
        the ends, which are attained, too. If nothing is proved, `bounds` itself is returned.

    Raises:
        RefusedError: A sample contradicts a stated sign of a proved output, or lies beyond its
            bounds.
        CampaignError: The model failed at a test point.
    """
    if not proved.any():
        return bounds
    domain = Domain(bounds.inputs, tuple(bounds.alpha))
    campaign(_test_points(domain, campaign))
    samples = campaign.samples
    values = samples.values.array
    sampled = bounds_of_samples(domain, samples, "")
    tolerance = negligible(values)
    is_below = sampled.lower < bounds.lower - tolerance
    is_above = sampled.upper > bounds.upper + tolerance
    is_exceeded = np.asarray((is_below | is_above).any(axis=0))
    signs = campaign.knowledge.stated_signs(tuple(bounds.inputs), bounds.outputs)
    for column in np.flatnonzero(proved):
        # Two tests: pairs of samples that contradict a sign, and samples beyond the bounds.
        pair = contradiction(samples.points, values[:, column], signs[column])
        cure = "samples contradict it"
        if pair is not None:
            first, second = (_point_text(point, bounds) for point in pair)
            cure += f": at {first} it is larger than at {second}"
        if pair is not None or is_exceeded[column]:
            raise RefusedError(
                f"knowledge of {bounds.outputs[column]}",
                repr(campaign.knowledge.words),
                "facts that hold over the whole supports",
                cure,
            )
    natures = tuple(Nature.GUARANTEED if x else Nature.ATTAINED for x in proved)
    evidence = f"which {len(samples.points):,} samples do not contradict"
    # Where all inputs are crisp, no sign of an effect is needed.
    basis: tuple[str, ...] = ()
    if campaign.knowledge.signs:
        basis = (f"{campaign.knowledge.words}, {evidence}",)
    return replace(
        bounds,
        natures=natures,
        nature=Nature.weakest(natures),
        basis=basis,
        inner=Ends(bounds.lower, bounds.upper),
    )


def _point_text(point: Array, bounds: Bounds) -> str:
    """Return the inputs of a point, shape (inputs,), as "a = 1, b = 2"."""
    return ", ".join(f"{name} = {x:.6g}" for name, x in zip(bounds.inputs, point, strict=True))


def _test_points(domain: Domain, campaign: Campaign) -> Array:
    """Return points inside the cuts at which stated knowledge is tested, shape (n, inputs).

    The narrowest cut with a width gets `campaign.knowledge.tests` points, 16 by default, and each
    wider one a quarter of that: points of a narrower cut lie in the wider ones, too. Levels with
    equal cuts count once. The points of a cut fill it evenly, and are the same in each call. Only
    the first ones, as many as evaluations are left in the budget, are returned; there may be none.

    Args:
        domain: Inputs and levels; the cut of a level is the box of the α-cuts of all inputs.
        campaign: Knows the budget and the knowledge; nothing is evaluated here.
    """
    lower, upper = domain.boxes
    widths = upper - lower
    tests = campaign.knowledge.tests
    points: list[Array] = []
    ends = np.hstack([lower, upper])
    differs_from_wider = np.append(True, (np.diff(ends, axis=0) != 0).any(axis=1))
    for level in np.flatnonzero(differs_from_wider & widths.any(axis=1))[::-1]:
        count = tests
        if points:  # in a wider cut than the first one
            count = -(-tests // 4)  # rounded up
        unit_points = quasi_random_points(len(domain.names), count, skip=len(points))
        points += list(lower[level] + widths[level] * unit_points)
    return np.array(points[: campaign.remaining]).reshape(-1, len(domain.names))
