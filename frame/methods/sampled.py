"""Envelopes by sampling: quasi-random trajectories, or a search of the largest peaks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress
from alphacut.frame.bounds.box_proof import take_larger
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.dynamics.yielding import YieldingFlow
from alphacut.frame.methods.method import Method
from alphacut.frame.result import Envelope
from alphacut.fuzzy.campaign.call import Call, SpentError
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.boxes import Domain, chebyshev_points, corners

SKIPPED = 100_003
"""Points of the quasi-random sequence between those of two levels; no search reaches that far."""
SAFETY = 2.0
"""Factor of what independent points find beyond the bounds, and of the gain that models still
predict (tuned on random structures; a larger one overestimates errors)."""


@dataclass(frozen=True)
class Sampled(Method):
    """Attained bounds of a number of quasi-random trajectories on each level.

    Args:
        samples: Number of trajectories on each level.
        seed: Seed of the sequence.

    Raises:
        RefusedError: The number is below 1.
    """

    name: ClassVar[str] = "quasi-monte-carlo"
    takes_kinks: ClassVar[bool] = True
    samples: int = 1024
    seed: int = 0

    def __post_init__(self) -> None:
        checked_number("samples", self.samples, whole=True, least=1)

    def points(self, lower: Array, upper: Array) -> Array:
        """Return the points of a Sobol sequence in a box, denser towards its faces.

        The sequence is scrambled by the seed of the method; equal seeds give equal points. The
        shape is (samples, inputs), with the number of samples that the method has.

        Args:
            lower: Lower ends of the box, shape (inputs,).
            upper: Upper ends of the box.
        """
        from scipy.stats import qmc

        # The cosine of a uniform variable has the Chebyshev density, which is largest at the ends:
        # extremes over a box lie on its boundary more often than inside.
        unit = qmc.Sobol(len(lower), rng=np.random.default_rng(self.seed)).random(self.samples)
        return np.asarray((lower + upper) / 2 - (upper - lower) / 2 * np.cos(np.pi * unit))

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the attained envelope of all outputs on all levels, from random trajectories.

        Each level has trajectories of its own, and keeps those of the higher levels, whose boxes
        lie in its own.

        Args:
            flow: The response over the boxes of the inputs.
            progress: Called with the completed fraction.

        Raises:
            RefusedError: A trajectory does not exist or is not finite.
            StepError: A time step did not converge.
        """
        n_levels = len(flow.boxes.alpha)
        shape = (n_levels, len(flow.time), len(flow.outputs), 2)
        bounds = np.full(shape, -np.inf)
        at = np.zeros((*shape, len(flow.boxes.names)))
        for level, tick in flow.boxes.inside_out(progress):
            if level + 1 < n_levels:  # a wider box contains the trajectories of the narrower one
                bounds[level] = bounds[level + 1]
                at[level] = at[level + 1]
            lower, upper = flow.boxes.unit_ends(level)
            points = self.points(lower, upper)
            values, index = largest_values(flow, points, tick)
            take_larger(bounds[level], at[level], values, points[index])
        return flow.envelope(
            bounds,
            flow.boxes.to_physical(at),
            method=self.name,
            nature=Nature.ATTAINED,
            evaluations=n_levels * self.samples,
        )


@dataclass(frozen=True)
class PeakSearch:
    """Peaks by multi-level single linkage, and the band attained by all trajectories computed.

    It is made for columns that yield, whose responses have kinks. The peaks of magnitudes are
    estimated where both of their bounds meet the stopping rule (Boender and Rinnooy Kan,
    Mathematical Programming 37, 59, 1987), although they may lie at kinks, and attained elsewhere.
    Their error is `SAFETY` times the amount by which independent trajectories exceed them, and a
    fraction of each peak.

    Args:
        tolerance: This fraction, since descents stall at kinks.
        budget: Largest number of trajectories of the search.
    """

    name: ClassVar[str] = "single-linkage"
    tolerance: float = 5e-3
    budget: int = 12_000

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope that all trajectories attain, with estimated or attained peaks.

        The peaks of magnitudes are searched by descents from many points, while each trajectory
        widens the envelope of the levels to whose cuts it belongs. A peak is an estimate where the
        stopping rule of the search is met, and attained only where the budget ended it.

        Args:
            flow: The response of a frame whose columns yield, over the boxes of the inputs.
            progress: Called with the completed fraction.

        Returns:
            The attained envelope, with the bounds of the peaks as `searched_peaks`. A note says
            what the search found, or that the budget is spent.

        Raises:
            RefusedError: A trajectory does not exist, for example since the structure collapses.
            StepError: A trajectory has too many events in a step, or its energy is not in balance.
        """
        from alphacut.fuzzy.campaign.campaign import Campaign  # searches take time to import
        from alphacut.fuzzy.plans.design import bounds_of_samples
        from alphacut.fuzzy.plans.settings import SEARCH
        from alphacut.fuzzy.plans.single_linkage import SingleLinkage

        cuts = flow.boxes
        outputs = tuple(map(str, flow.outputs))
        yielding_flow = flow.flow
        assert isinstance(yielding_flow, YieldingFlow)
        domain = Domain(cuts.inputs, tuple(cuts.alpha))
        band = _Band(flow, domain, yielding_flow)
        # The trajectories at the probes belong to the band, too.
        band.peaks(**dict(zip(cuts.names, cuts.probes.T, strict=True)))  # raises their errors here
        call = Call(band.peaks, cuts.names, vectorised=True)
        campaign = Campaign(call, budget=self.budget, progress=progress)
        campaign(cuts.nominal[np.newaxis])
        linkage = SingleLinkage(campaign, domain, outputs, has_kinks=True)
        notes: tuple[str, ...] = ()
        try:
            # Without a width there is nothing to search.
            if linkage.cuts:
                n_uncertain = len(linkage.cuts[0].uncertain_inputs)
                rng = np.random.default_rng([SEARCH.seed, 0])
                linkage.run(rng.random((SEARCH.min_samples, n_uncertain)))
                notes = (linkage.summary(),)
        except SpentError as spent:
            notes = (str(spent),)

        searched = bounds_of_samples(domain, campaign.samples, self.name)
        evaluations = len(campaign)
        excess = np.zeros(searched.lower.shape)  # (levels, outputs)
        for level in range(len(cuts.alpha)):
            points = independent_points(cuts, level)
            peaks = yielding_flow.values_and_peaks(cuts.to_physical(points))[1]
            # Points that the search has not seen show what it may have missed.
            below = searched.lower[level] - peaks.min(axis=0)
            above = peaks.max(axis=0) - searched.upper[level]
            excess[level] = np.maximum(np.maximum(below, above), 0.0)
            evaluations += len(points)
        is_estimate = [not linkage.cuts or linkage.is_estimate(name) for name in outputs]
        names = {True: Nature.ESTIMATED, False: Nature.ATTAINED}
        natures = tuple(names[x] for x in is_estimate)
        error = np.where(is_estimate, SAFETY * excess + self.tolerance * searched.upper, 0.0)
        is_point = (cuts.lower == cuts.upper).all(axis=1)
        error[is_point] = 0.0  # the only trajectory of the level is exact
        return flow.envelope(
            band.bounds,
            band.at,
            method=self.name,
            nature=Nature.ATTAINED,
            evaluations=evaluations,
            searched_peaks=replace(searched, error=error, natures=natures),
            notes=notes,
        )


class _Band:
    """The band that trajectories attain on each level while their peaks are searched.

    Args:
        flow: The problem.
        domain: Its cuts.
        yielding_flow: Its response as a function of inputs in SI units.

    Attributes:
        bounds: Largest values of (-output, output), shape (levels, times, outputs, 2).
        at: Inputs of the trajectories with these values, in SI units, shape (levels, times,
            outputs, 2, inputs).
    """

    def __init__(self, flow: UnitFlow, domain: Domain, yielding_flow: YieldingFlow) -> None:
        """Begin a band that no trajectory attains yet."""
        cuts = flow.boxes
        self.names = cuts.names
        self.outputs = tuple(map(str, flow.outputs))
        self.domain = domain
        self.yielding_flow = yielding_flow
        shape = (len(cuts.alpha), len(flow.time), len(flow.outputs), 2)
        self.bounds = np.full(shape, -np.inf)
        self.at = np.zeros((*shape, len(cuts.names)))

    def peaks(self, **inputs: Array) -> dict[str, Array]:
        """Return the peaks of trajectories by output, and widen the band by the trajectories.

        On each level to whose cut the inputs of a trajectory belong, `self.bounds` is raised to its
        values, and `self.at` gets its inputs there, both in place.

        Args:
            inputs: Inputs by name, in SI units, shape (trajectories,) each; all inputs of the
                problem.

        Returns:
            Largest magnitude over time by output, shape (trajectories,) each.

        Raises:
            RefusedError: A trajectory does not exist, for example since the structure collapses.
            StepError: A trajectory has too many events in a step, or its energy is not in balance.
        """
        points = np.column_stack([inputs[name] for name in self.names])
        values, peaks = self.yielding_flow.values_and_peaks(points)
        for level, is_inside in enumerate(self.domain.inside(points)):
            for row in np.flatnonzero(is_inside):
                signed = np.stack([-values[row], values[row]], axis=-1)
                # A trajectory widens the band of each level to whose cut its inputs belong.
                better = signed > self.bounds[level]
                self.bounds[level][better] = signed[better]
                self.at[level][better] = points[row]
        return dict(zip(self.outputs, peaks.T, strict=True))


def independent_excess(
    flow: UnitFlow, bounds: Array, progress: Callable[[float], None]
) -> tuple[Array, int]:
    """Return how far independent trajectories exceed bounds, and the number of trajectories.

    On each level up to 192 trajectories are computed at points that no search uses.

    Args:
        flow: The response over the boxes of the inputs.
        bounds: Upper bounds on each level of its boxes, shape (levels, times, outputs, 2): on the
            last axis first of the output with its sign changed, then of the output.
        progress: Called with the completed fraction.

    Returns:
        The largest excess over time and over both sides, 0 or more, shape (levels, outputs), and
        the number of trajectories on all levels.

    Raises:
        RefusedError: A trajectory does not exist or is not finite.
        StepError: A time step did not converge.
    """
    excess = np.zeros((len(bounds), len(flow.outputs)))
    count = 0
    for level in range(len(bounds)):
        points = independent_points(flow.boxes, level)
        # The excess at a node tells what the bounds at neighbouring nodes may miss, so that the
        # largest one over time counts.
        values, _ = largest_values(flow, points)
        excess[level] = np.maximum((values - bounds[level]).max(axis=(0, 2)), 0.0)
        count += len(points)
        progress((level + 1) / len(bounds))
    return excess, count


def independent_points(boxes: Boxes, level: int) -> Array:
    """Return points of a box that no search has used, in unit coordinates, (points, inputs)."""
    lower, upper = boxes.unit_ends(level)
    # 64 points of each kind (tuned: the estimate of an error rests on them, and each takes time).
    return spread_points(lower, upper, 64, SKIPPED * (level + 1))


def spread_points(lower: Array, upper: Array, count: int, skip: int) -> Array:
    """Return points spread over a box: first inside, then on faces and edges, then corners.

    All are taken from one quasi-random sequence, so that equal arguments give equal points. A box
    with at most `count` corners gets all of them.

    Args:
        lower: Lower ends of the box, shape (inputs,).
        upper: Upper ends of the box; an input without width stays at its value.
        count: Number of points of each of the three kinds; there may be fewer corners.
        skip: Number of points at the beginning of the sequence that are left out.

    Returns:
        Points, shape (points, inputs), which may repeat.
    """
    d = len(lower)
    inside = chebyshev_points(d, count, skip=skip)
    # A coordinate beyond half of its range is moved to the nearer end.
    on_faces = np.clip(2 * chebyshev_points(d, count, skip=skip + count), -1, 1)
    if 2**d > count:
        # The signs of quasi-random points give corners that are spread evenly, too.
        ends = np.sign(chebyshev_points(d, count, skip=skip + 2 * count))
    else:
        ends = corners(-np.ones(d), np.ones(d))
    points = np.concatenate([inside, on_faces, ends])
    return np.asarray((lower + upper) / 2 + (upper - lower) / 2 * points)


def largest_values(
    flow: UnitFlow, points: Array, progress: Progress | None = None
) -> tuple[Array, Ints]:
    """Return the largest values of outputs over some trajectories, and which ones have them.

    Args:
        flow: The response over the boxes of the inputs.
        points: Inputs of the trajectories, shape (trajectories, inputs), in unit coordinates, in
            which each input runs over [-1, 1] on its widest cut.
        progress: Called with the completed fraction.

    Returns:
        The values and the indices of the trajectories in `points`, shape (times, outputs, 2) each:
        on the last axis first of the output with its sign changed, then of the output. Of equal
        trajectories the first one counts. Without points the values are -∞.

    Raises:
        RefusedError: A trajectory does not exist or is not finite.
        StepError: A time step did not converge.
    """
    largest: Array = np.full((len(flow.time), len(flow.outputs), 2), -np.inf)
    index: Ints = np.zeros(largest.shape, np.int64)
    # At most 256 trajectories or 16 million numbers (128 MB) are computed at a time.
    size = int(np.clip(16e6 / largest.size, 1, 256))
    for first in range(0, len(points), size):
        values = flow.values(points[first : first + size])
        signed = np.stack([-values, values], axis=-1)
        best = signed.argmax(axis=0)
        value = np.take_along_axis(signed, best[np.newaxis], axis=0)[0]
        better = value > largest
        largest[better] = value[better]
        index[better] = first + best[better]
        if progress:
            progress(first / len(points))
    return largest, index
