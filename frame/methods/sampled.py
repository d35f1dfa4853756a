"""Envelopes by motions alone: quasi-random ones or a search of peaks; what others find beyond."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.envelope import Envelope
from alphacut.fuzzy.campaign.call import Call, SpentError
from alphacut.fuzzy.campaign.campaign import Campaign
from alphacut.fuzzy.plans.design import bounds_of_samples
from alphacut.fuzzy.plans.single_linkage import MIN_SAMPLES, SEED, SingleLinkage
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.boxes import Domain, chebyshev_points, corners

MAX_NUMBERS = 16e6
"""Most numbers of trajectories at a time: 128 MB."""
BATCH = 256
"""Most trajectories at a time."""
SAMPLES = 64
"""Independent points of a kind on each level."""
SKIPPED = 100_003
"""Points of the sequence between those of two levels, which a search does not reach."""
SAFETY = 2.0
"""Factor on what they find beyond the bounds, and on the gain that models still predict."""


@dataclass(frozen=True)
class Sampled:
    """Attained bounds of so many trajectories on each level, from a seed.

    Raises:
        RefusedError: No trajectory is asked for.
    """

    name: ClassVar[str] = "quasi-monte-carlo"
    samples: int = 1024
    seed: int = 0

    def __post_init__(self) -> None:
        checked_number("samples", self.samples, whole=True, least=1)

    def points(self, lower: Array, upper: Array) -> Array:
        """Return Sobol points of a box, denser towards its faces, shape (samples, d)."""
        from scipy.stats import qmc

        unit = qmc.Sobol(len(lower), rng=np.random.default_rng(self.seed)).random(self.samples)
        return np.asarray((lower + upper) / 2 - (upper - lower) / 2 * np.cos(np.pi * unit))

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the attained envelope of all outputs on all levels."""
        levels = len(flow.boxes.alpha)
        shape = (levels, len(flow.time), len(flow.outputs), 2)
        bounds, at = np.full(shape, -np.inf), np.zeros((*shape, len(flow.boxes.names)))
        for done, level in enumerate(reversed(range(levels))):
            if level + 1 < levels:  # what a narrower box attains
                bounds[level], at[level] = bounds[level + 1], at[level + 1]
            points = self.points(*flow.boxes.unit_ends(level))
            tick = subprogress(progress, done / levels, (done + 1) / levels)
            values, index = largest_values(flow, points, tick)
            better = values > bounds[level]
            bounds[level][better], at[level][better] = values[better], points[index][better]
        return flow.envelope(
            bounds,
            flow.boxes.to_physical(at),
            method=self.name,
            nature=Nature.ATTAINED,
            evaluations=levels * self.samples,
        )


@dataclass(frozen=True)
class PeakSearch:
    """Peaks by multi-level single linkage, and the band that all motions made attain.

    For columns that yield, whose motions have kinks. Peaks of magnitudes are estimated where both
    their bounds meet the stopping rule (Boender, Rinnooy Kan 1987), though they may lie at kinks,
    else attained. Their error is `SAFETY` times what independent motions find beyond them, and
    `tolerance` more.

    Args:
        tolerance: Least error, as a fraction of each peak: descents stall at kinks.
        budget: Most motions of the search.
    """

    name: ClassVar[str] = "single-linkage"
    tolerance: float = 5e-3
    budget: int = 12_000

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the attained envelope of all outputs on all levels, with searched peaks."""
        cuts, outputs = flow.boxes, tuple(map(str, flow.outputs))
        domain, motion = Domain(cuts.inputs, tuple(cuts.alpha)), flow.flow
        assert isinstance(motion, YieldingFlow)
        bounds = np.full((len(cuts.alpha), len(flow.time), len(outputs), 2), -np.inf)
        at = np.zeros((*bounds.shape, len(cuts.names)))

        def motion_peaks(**inputs: Array) -> dict[str, Array]:
            """Return the peaks (S,) of motions by output, after the motions widened the band."""
            points = np.column_stack([inputs[name] for name in cuts.names])
            values, peaks = motion.values_and_peaks(points)
            for level, inside in enumerate(domain.inside(points)):
                for row in np.flatnonzero(inside):
                    signed = np.stack([-values[row], values[row]], -1)
                    better = signed > bounds[level]
                    bounds[level][better], at[level][better] = signed[better], points[row]
            return dict(zip(outputs, peaks.T, strict=True))

        call = Call(motion_peaks, cuts.names, vectorised=True)
        motion_peaks(**dict(zip(cuts.names, cuts.probes.T, strict=True)))  # raises what they do
        campaign = Campaign(call, budget=self.budget, progress=progress)
        campaign(cuts.nominal[None])
        linkage, note = SingleLinkage(campaign, domain, outputs, has_kinks=True), ""
        try:
            if linkage.cuts:
                widest, rng = linkage.cuts[0], np.random.default_rng([SEED, 0])
                linkage.run(rng.random((MIN_SAMPLES, len(widest.uncertain_inputs))))
                note = linkage.summary()
        except SpentError as spent:
            note = str(spent)
        searched, motions = bounds_of_samples(domain, campaign.samples, self.name), len(campaign)
        excess = np.zeros(searched.lower.shape)
        for level in range(len(cuts.alpha)):
            points = spread_points(*cuts.unit_ends(level), SAMPLES, SKIPPED * (level + 1))
            peaks = motion.values_and_peaks(cuts.to_physical(points))[1]
            distances = searched.lower[level] - peaks.min(0), peaks.max(0) - searched.upper[level]
            excess[level] = np.maximum(np.max(distances, axis=0), 0.0)
            motions += len(points)
        is_estimate = [not linkage.cuts or linkage.is_estimate(name) for name in outputs]
        natures = tuple(Nature.ESTIMATED if x else Nature.ATTAINED for x in is_estimate)
        error = np.where(is_estimate, SAFETY * excess + self.tolerance * searched.upper, 0.0)
        error[(cuts.lower == cuts.upper).all(1)] = 0.0  # of a level with one motion, which is exact
        return flow.envelope(
            bounds,
            at,
            method=self.name,
            nature=Nature.ATTAINED,
            evaluations=motions,
            searched_peaks=replace(searched, error=error, natures=natures),
            notes=(note,) if note else (),
        )


def independent_excess(flow: UnitFlow, bounds: Array, progress: Progress) -> tuple[Array, int]:
    """Return how far independent motions exceed the bounds on each level, and their number.

    `bounds` (A, T, m, 2) are upper bounds of (−output, output); the excess of each output is the
    largest over time, shape (A, m).
    """
    largest, count = np.zeros((len(bounds), len(flow.outputs))), 0
    for level in range(len(bounds)):
        points = spread_points(*flow.boxes.unit_ends(level), SAMPLES, SKIPPED * (level + 1))
        values, _ = largest_values(flow, points)
        largest[level] = np.maximum((values - bounds[level]).max((0, 2)), 0.0)
        count += len(points)
        progress((level + 1) / len(bounds))
    return largest, count


def spread_points(lower: Array, upper: Array, count: int, skip: int) -> Array:
    """Return points (S, d) of a box: `count` inside, on faces and edges, and of the corners each.

    The first `skip` points of the sequence are left out.
    """
    d = len(lower)
    inside, wide, ends = (chebyshev_points(d, count, skip=skip + k * count) for k in range(3))
    ends = np.sign(ends) if 2**d > count else corners(-np.ones(d), np.ones(d))
    points = np.concatenate([inside, np.clip(2 * wide, -1, 1), ends])
    return np.asarray((lower + upper) / 2 + (upper - lower) / 2 * points)


def largest_values(
    flow: UnitFlow, points: Array, progress: Progress | None = None
) -> tuple[Array, Ints]:
    """Return the largest (−output, output) of motions, shape (T, m, 2), and which has it."""
    largest: Array = np.full((len(flow.time), len(flow.outputs), 2), -np.inf)
    index: Ints = np.zeros(largest.shape, np.int64)
    size = int(np.clip(MAX_NUMBERS / largest.size, 1, BATCH))
    for first in range(0, len(points), size):
        values = flow.values(points[first : first + size])
        signed = np.stack([-values, values], -1)
        best = signed.argmax(0)
        value = np.take_along_axis(signed, best[None], 0)[0]
        better = value > largest
        largest[better], index[better] = value[better], first + best[better]
        if progress:
            progress(first / len(points))
    return largest, index
