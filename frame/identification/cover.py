"""Covers of the set that measured modes leave of a frame's parameters, its members, its motions.

The set of a level is often much smaller than the box around it: frequencies leave a thin sheet. The
box is bisected; each half is narrowed by `enclosure` or proved to be empty. What remains covers the
set, so that the union of bounds over its boxes holds for the set. Members of the set are found by
rejection: points of the cover whose modes lie in the measured ranges.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import require
from alphacut.base.progress_bar import Progress
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.integrators import Exact
from alphacut.frame.identification.enclosure import enclosure
from alphacut.frame.identification.identify import Evidence, Identified, RefutedError
from alphacut.frame.identification.modes import chain_modes
from alphacut.frame.methods.method import Method
from alphacut.frame.propagation import envelope
from alphacut.frame.result import Ends, Envelope
from alphacut.frame.structures.linear import LinearSystem
from alphacut.frame.verification.self_test import with_motions_tested
from alphacut.fuzzy import FuzzyNumber, Interval
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.claimed import ClaimedNumber
from alphacut.fuzzy.sets.numbers import Stepwise


def cover(learned: Identified, level: int, count: int) -> Array:
    """Return boxes that together contain all parameters which agree with the modes on a level.

    Args:
        learned: Result of an identification that is not refuted.
        level: Index of the level.
        count: Number of boxes, unless fewer remain.

    Returns:
        Ends of the boxes in SI units, shape (boxes, 2, parameters); none if the set is proved to be
        empty.
    """
    evidence = learned.evidence
    modes = evidence.modes(float(learned.alpha[level]))
    nominal = evidence.chain.nominal
    boxes = [np.log(np.stack([learned.lower[level], learned.upper[level]]) / nominal)]
    while boxes and len(boxes) < count:
        # The widest box is bisected across its widest side.
        k = int(np.argmax([np.ptp(box, axis=0).max() for box in boxes]))
        box = boxes.pop(k)
        side = int(np.ptp(box, axis=0).argmax())
        middle = float(box[:, side].mean())
        for end in (0, 1):
            half = box.copy()
            half[1 - end, side] = middle
            found = enclosure(evidence.chain, half[0], half[1], modes)
            if found is not None:
                boxes.append(np.stack(found))
    # Outwards by more than the roundings of quotient, logarithm, exponential and product.
    outwards = np.array([[1 - 1e-14], [1 + 1e-14]])
    return np.array([nominal * np.exp(box) * outwards for box in boxes])


def contains(evidence: Evidence, points: Array, alpha: float) -> Mask:
    """Return which parameters agree with the measured modes on a level, shape (points,).

    Args:
        evidence: Priors and measured modes.
        points: Parameters in SI units, shape (points, parameters), within their priors.
        alpha: The level.
    """
    chain = evidence.chain
    stiffness_powers, mass_powers = chain.powers
    logs = np.log(points / chain.nominal)
    stiffness = chain.stiffness * np.exp(logs @ stiffness_powers.T)
    mass = chain.mass * np.exp(logs @ mass_powers.T)
    values, shapes = chain_modes(stiffness, mass)
    is_inside = np.ones(len(points), bool)
    for name, number in evidence.prior.items():
        low, high = evidence.cut(number, alpha)
        column = points[:, chain.names.index(name)]
        is_inside &= (column >= low) & (column <= high)
    for mode, cut in zip(evidence.measured, evidence.modes(alpha), strict=True):
        value = values[:, cut.mode - 1]
        is_inside &= (value >= cut.low) & (value <= cut.high)
        for floor, (low, high) in cut.shape.items():
            shape = shapes[:, :, cut.mode - 1]
            ratio = shape[:, floor - 1] / shape[:, mode.reference - 1]
            is_inside &= (ratio >= low - 1e-15) & (ratio <= high + 1e-15)
    return is_inside


def members(learned: Identified, level: int, boxes: Array, count: int, seed: int = 0) -> Array:
    """Return parameters of the set of a level, shape (members, parameters), `count` or fewer.

    Points are drawn uniformly in the boxes of a cover, as often as their volumes say, and kept if
    their modes lie in the measured ranges. At most 100 times `count` points are drawn.
    """
    rng = np.random.default_rng(seed)
    volumes = np.prod(boxes[:, 1] - boxes[:, 0], axis=1)
    chosen = rng.choice(len(boxes), 100 * count, p=volumes / volumes.sum())
    low = boxes[chosen, 0]
    points = low + rng.random(low.shape) * (boxes[chosen, 1] - low)
    is_member = contains(learned.evidence, points, float(learned.alpha[level]))
    return np.asarray(points[is_member][:count])


def learned_envelope(
    model: LinearSystem,
    learned: Identified,
    method: Method | str | None = None,
    *,
    duration: float,
    step: float,
    boxes: int = 16,
    count: int = 200,
    progress: Progress | None = None,
) -> Envelope:
    """Return guaranteed bounds of the motions of all structures of a learned set, on each level.

    Args:
        model: The frame with its load, of which the parameters were learned.
        learned: Result of the identification, not refuted.
        method: Method of the proofs, as of `envelope`.
        duration: Length of the simulation, in s.
        step: Distance of the time nodes, in s.
        boxes: Boxes of the cover of the set on each level.
        count: Members of the set whose motions are computed for attained values, on each level.
        progress: Called with the completed fraction.

    Returns:
        Bounds that are never wider than those of the box around the set. Attained values and their
        inputs belong to members of the set.

    Raises:
        RefusedError: The method proves nothing; or as of `envelope`.
        RefutedError: The frame is refuted.
        FailedError: No bounds are found.
    """

    def bounded(inputs: Mapping[str, FuzzyNumber], alpha: Sequence[float]) -> Envelope:
        """Return the envelope over boxes of inputs."""
        if progress is not None:
            progress(min(next(done) / (1 + boxes * len(learned.alpha)), 1.0))
        return envelope(
            model, inputs, method, duration=duration, step=step, alpha=alpha, progress=False
        )

    done = itertools.count()
    numbers = learned.inputs
    whole = bounded(numbers, [float(alpha) for alpha in learned.alpha])
    is_guaranteed = whole.nature is Nature.GUARANTEED
    require(is_guaranteed, "the envelope", value=str(whole.nature), allowed="a proof over the box")
    lower = whole.lower.copy()
    upper = whole.upper.copy()
    found: Array = np.empty((0, len(numbers)))
    between = whole.between
    bounded_at = learned.alpha.copy()
    for level in range(len(learned.alpha)):
        covering = cover(learned, level, boxes)
        if not len(covering):
            if level == 0:
                raise RefutedError(replace(learned, empty=float(learned.alpha[0])).refutation)
            # The set is empty, and the bounds of the level before are kept for all that remain.
            lower[level:] = lower[level - 1]
            upper[level:] = upper[level - 1]
            bounded_at[level:] = learned.alpha[level - 1]
            break
        # The set of a level lies in that of the level before.
        if level:
            lower[level] = np.maximum(lower[level], lower[level - 1])
            upper[level] = np.minimum(upper[level], upper[level - 1])
        part_lower, part_upper, part_between = [], [], []
        for low, high in covering:
            sides = zip(numbers, map(Interval, low, high), strict=True)
            part = bounded(dict(sides), [0.0])
            # The whole box contains the part. Of one without a proof what is known of it holds.
            is_proved = part.nature is Nature.GUARANTEED
            part_lower.append(part.lower[0] if is_proved else whole.lower[level])
            part_upper.append(part.upper[0] if is_proved else whole.upper[level])
            part_between.append(part.between if is_proved else None)
        # Each structure of the set lies in a box of the cover.
        lower[level] = np.maximum(lower[level], np.min(part_lower, axis=0))
        upper[level] = np.minimum(upper[level], np.max(part_upper, axis=0))
        # Distances between the nodes belong to single responses, so that the lowest level has all.
        if level == 0 and between is not None:
            of_parts = [between if x is None else x for x in part_between]
            between = np.minimum(between, np.max(of_parts, axis=0))
        found = np.concatenate([found, members(learned, level, covering, count)])
    bounds = replace(
        whole,
        lower=lower,
        upper=upper,
        error=np.full_like(lower, np.nan),
        between=between,
        inputs={name: _without_box(number) for name, number in numbers.items()},
        least_peaks=None,
        searched_peaks=None,
        outer=None,
        tested_structures={},
        notes=(*whole.notes, f"over a cover of the learned set by {boxes} boxes"),
    )
    return _with_members(bounds, learned, model, found, bounded_at)


def _without_box(number: FuzzyNumber) -> FuzzyNumber:
    """Return a learned number whose cuts count as sides of the set itself, not of a box around."""
    if isinstance(number, ClaimedNumber):
        return replace(number, number=replace(number.number, encloses=""))
    assert isinstance(number, Stepwise)
    return replace(number, encloses="")


def _with_members(
    bounds: Envelope, learned: Identified, model: LinearSystem, points: Array, bounded_at: Array
) -> Envelope:
    """Add the responses of members of the learned sets as attained values, and their inputs.

    Some of them are compared with the bounds as exact responses by another algorithm.

    Args:
        bounds: Guaranteed bounds of the sets.
        learned: The identification.
        model: The structure.
        points: Members of the set of the lowest level, shape (members, parameters).
        bounded_at: For each level that whose set its bounds hold for: itself, or one before.
    """
    assert bounds.time is not None
    step = float(bounds.time[1] - bounds.time[0])
    flow = LinearFlow(model, learned.names, float(bounds.time[-1]), step, Exact())
    inner = Ends(np.full_like(bounds.lower, np.nan), np.full_like(bounds.lower, np.nan))
    at = Ends(np.full_like(bounds.lower_at, np.nan), np.full_like(bounds.lower_at, np.nan))
    responses = flow.values(points) if len(points) else np.empty((0, *bounds.lower.shape[1:]))
    highest = np.full(len(points), -1)
    for level, alpha in enumerate(learned.alpha):
        is_member = contains(learned.evidence, points, float(alpha))
        has_bounds = contains(learned.evidence, points, float(bounded_at[level]))
        highest[has_bounds] = level
        if is_member.any():
            of_level = responses[is_member]
            inner.lower[level] = of_level.min(axis=0)
            inner.upper[level] = of_level.max(axis=0)
            at.lower[level] = points[is_member][of_level.argmin(axis=0)]
            at.upper[level] = points[is_member][of_level.argmax(axis=0)]
    gap = np.fmax(inner.lower - bounds.lower, bounds.upper - inner.upper)
    found = replace(
        bounds, inner=inner, lower_at=at.lower, upper_at=at.upper, error=np.maximum(gap, 0.0)
    )
    return with_motions_tested(found, model, (points, highest))
