"""Spatial branch and bound over the fuzzy inputs, above every proof (Adjiman, Floudas 1998).

A proof bounds the outputs over a sub-box of the inputs, on all its α-levels at once. What is
branched is decided by the peaks of the outputs and not by all nodes: a peak is fathomed where its
bound exceeds the incumbent, the largest value that an exact trajectory attains, by no more than the
gap asked for. The bound at a node is the largest over all sub-boxes.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from heapq import heappop, heappush

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame import numbers
from alphacut.frame.bounds.box_proof import (
    Answer,
    BisectionError,
    BoxBounds,
    BoxProof,
    Goal,
    Hull,
    refusing,
)
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import exact_flow
from alphacut.frame.result import Envelope

LOG = logging.getLogger(__name__)

OWN_WORK = 0.5
"""Fraction of a sub-box's expected work that its own bounds take, and not its halves; a guess that
the progress bar alone depends on."""


@dataclass(eq=False)
class SubBox:
    """A sub-box of the inputs on L levels, with what is known and what is open there."""

    boxes: Boxes  # its ends on each level
    levels: list[int]  # which of all levels these are
    peaks: Mask  # peaks of (−q, q) that are not fathomed, (L, m, 2)
    upper: Array  # guaranteed upper bounds of (−q, q) that are known, (L, T, m, 2)
    min_peak_lower: Array  # lower bounds of the smallest max |q| over time, (L, m)
    is_wide: Mask  # levels on which bounds are worth little at any node, (L,)
    work: float = 1.0  # fraction of all work that it is expected to take, with its halves

    def on_levels(self, rows: Ints, boxes: Boxes | None = None) -> SubBox:
        """Return a copy on some levels.

        A level is an α-cut of the inputs. Masks and bounds of these levels are copied; the expected
        fraction of all work, `work`, stays.

        Args:
            rows: Which of the present levels are kept, as rows of the arrays, shape (kept levels,).
            boxes: Ends on the kept levels; those of this sub-box unless given.
        """
        return replace(
            self,
            boxes=self.boxes.on_levels(rows) if boxes is None else boxes,
            levels=[self.levels[k] for k in rows],
            peaks=self.peaks[rows],
            upper=self.upper[rows],
            min_peak_lower=self.min_peak_lower[rows],
            is_wide=self.is_wide[rows],
        )

    def bisect(self, axis: int) -> list[SubBox]:
        """Return both halves along an input, each with the levels that reach it."""
        return [self.on_levels(rows, half) for half, rows in self.boxes.bisect(axis)]


def prove(
    proof: BoxProof,
    flow: UnitFlow,
    margin: Callable[[UnitFlow], Array],
    progress: Progress | None = None,
) -> Envelope:
    """Return the guaranteed envelope of all outputs on all α-levels, by bisection of the inputs.

    Args:
        proof: Bounds the outputs over any sub-box of the inputs.
        flow: The response as a function of the fuzzy inputs.
        margin: Returns what covers the rounding of each output, shape (m,).
        progress: Called with the completed fraction, from 0 to 1.

    Raises:
        UnprovedError: The system is not linear, its integrator is not the exact one, bounds are not
            proved, or the margin for rounding exceeds a tenth of the wanted gap of a peak.
        FailedError: The proof contradicts a trajectory, and is wrong.
        RefusedError: A trajectory does not exist, or is not finite.
    """
    queue = Queue(proof, flow, margin)
    queue.run(progress)
    return queue.hull.envelope(proof.name)


class Queue:
    """Open sub-boxes, best first, and the hull of the closed ones, on A levels.

    Arrays with the axes (A, m, 2) belong to the peaks of −q and q of each output on each level.
    """

    def __init__(
        self,
        proof: BoxProof,
        problem: UnitFlow,
        margin: Callable[[UnitFlow], Array],
    ) -> None:
        boxes = problem.boxes
        self.proof = proof
        self.problem = problem
        self.flow = exact_flow(problem.flow)
        self.workers = proof.workers or os.cpu_count() or 1
        with refusing():
            proof.forecast(self.flow, boxes)
            of_outputs = margin(problem)
        self.hull = Hull(problem, self.flow, of_outputs)
        self.gap = proof.peak_gap(problem)[:, np.newaxis]  # wanted gap of each peak, (m, 1)
        if (of_outputs > 0.1 * self.gap[:, 0]).any():
            largest = float((of_outputs / problem.peak).max())
            what = f"rounding of the response may be {largest:.2g} of a peak"
            raise UnprovedError(what, "take a wider gap, or stiffnesses that differ less")
        # gap above which bounds elsewhere are worth little either, (m, 1)
        self.wide_gap = numbers.WIDE * problem.peak[:, np.newaxis]
        self.refusals = 0
        self.pushes = 0
        self.heap: list[tuple[float, int, SubBox]] = []  # by priority, then by age

        shape = self.hull.upper.shape
        levels, _, outputs, _ = shape
        peaks = (levels, outputs, 2)
        self.box_count = np.zeros(peaks, int)  # sub-boxes on which each peak was bounded
        self.first_gap = np.full(peaks, np.nan)  # gap of each peak after the first of them
        self.is_abandoned = np.zeros(peaks, bool)  # whether the gap falls too slowly
        whole_box = SubBox(
            boxes=boxes,
            levels=list(range(levels)),
            peaks=np.ones(peaks, bool),
            upper=np.full(shape, np.inf),
            min_peak_lower=np.zeros((levels, outputs)),
            is_wide=np.ones(levels, bool),
        )
        self._push(whole_box)

    def run(self, progress: Progress | None = None) -> None:
        """Bound and bisect sub-boxes until all peaks are fathomed or abandoned.

        A peak is the largest value over time of one side, −q or q, of an output q on one α-level.
        It is fathomed in a sub-box where its bound exceeds the largest attained value by no more
        than the wanted gap, and abandoned where further bisections are not expected to bring its
        bound so low. Afterwards `self.hull` holds the bounds over the whole box.

        Args:
            progress: Called with the completed fraction of the expected work, from 0 to 1.

        Raises:
            UnprovedError: The proof refuses too many sub-boxes, or one that bisections would not
                help.
        """
        pool = ThreadPoolExecutor(self.workers)
        try:
            while batch := self._next_batch():
                waiting = sum(box.work for _, _, box in self.heap)
                done = 1 - waiting - sum(box.work for box in batch)
                goals = []
                for box in batch:
                    tick = subprogress(progress, done, done + OWN_WORK * box.work)
                    goals.append(self._goal(box, self.workers // len(batch), tick))
                all_answers = list(pool.map(self._bound, batch, goals))
                for box, goal, answers in zip(batch, goals, all_answers, strict=True):
                    self._add_answers(box, goal, answers)
                    self._abandon_slow_peaks(box, answers)
                    self._fathom(box)
                    children = list(self._pruned_children(box, answers))
                    children += self._halves(box, answers)
                    for child in children:
                        child.work = (1 - OWN_WORK) * box.work / len(children)
                        self._push(child)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

    def _push(self, box: SubBox) -> None:
        """Queue a sub-box by the largest excess of its bounds, in units of the gap; ties by age."""
        gap = np.maximum(self.gap, 1e-300)
        excess = [self._excess(box, k) / gap for k in range(len(box.levels))]
        priority = -float(np.max(np.where(box.peaks, excess, -np.inf)))
        self.pushes += 1
        heappush(self.heap, (priority, self.pushes, box))

    def _next_batch(self) -> list[SubBox]:
        """Remove the sub-boxes whose bounds exceed the goal most from the queue.

        Peaks that are closed by now, because attained values have risen or they were abandoned, are
        closed in the hull; sub-boxes without open peaks are dropped.

        Returns:
            Two sub-boxes with open peaks, on the levels that have any; fewer if the queue ends, and
            none at its end. Two are bounded with the same incumbents whatever the number of
            threads, so that the result does not depend on it.
        """
        batch = list[SubBox]()
        while self.heap and len(batch) < 2:
            _, _, box = heappop(self.heap)
            self._fathom(box)  # incumbents have risen since, and peaks were abandoned
            if box.peaks.any():
                batch.append(box.on_levels(_open_levels(box)))
        return batch

    def _excess(self, box: SubBox, k: int) -> Array:
        """Return how far bounds of peaks exceed incumbent + gap on row k of a sub-box, (m, 2)."""
        upper_peaks = box.upper[k].max(axis=0)
        return np.asarray(upper_peaks - self.hull.incumbent(box.levels[k]) - self.gap)

    def _goal(self, box: SubBox, workers: int, tick: Progress) -> Goal:
        """Return which bounds the proof is asked for over a sub-box, and what is known there.

        On a level on which bounds are worth little at any node (`is_wide`), all bounds of open
        peaks are asked for; on others those at time nodes that exceed the attained value by more
        than the gap.

        Args:
            box: The sub-box.
            workers: Number of threads for it; at least one is given.
            tick: Called with the completed fraction of its bounds.

        Returns:
            `needed`, the bounds that are asked for, and `known_upper`, those that are known, shape
            (levels, T, m, 2): levels of the sub-box, time nodes, outputs q, and the sides −q, q;
            `incumbent`, the largest attained values over time, shape (levels, m, 2); and `is_last`,
            whether one more refusal ends the proof.
        """
        incumbent = np.stack([self.hull.incumbent(level) for level in box.levels])
        is_above = box.upper > (incumbent + self.gap)[:, np.newaxis]
        is_wide = box.is_wide[:, np.newaxis, np.newaxis, np.newaxis]
        return Goal(
            scale=self.problem.scale,
            peak=self.problem.peak,
            needed=box.peaks[:, np.newaxis] & (is_above | is_wide),
            known_upper=box.upper,
            incumbent=incumbent,
            workers=max(workers, 1),
            is_last=self.refusals >= self.proof.parts - 1,
            tick=tick,
        )

    def _bound(self, box: SubBox, goal: Goal) -> Sequence[Answer]:
        """Return the proof's bounds on each level of a sub-box, or its refusal for every level."""
        try:
            with refusing():
                return self.proof.bounds(self.flow, box.boxes, goal)
        except UnprovedError as refusal:
            return [refusal] * len(box.levels)

    def _add_answers(self, box: SubBox, goal: Goal, answers: Sequence[Answer]) -> None:
        """Take over, in place, the attained values and bounds that a proof has found for a sub-box.

        The counts of sub-boxes and of refusals go up.

        Args:
            box: The sub-box. Its `upper`, guaranteed bounds of shape (levels, T, m, 2), are lowered
                where they were asked for, and its `min_peak_lower`, bounds of the smallest max |q|
                over time, shape (levels, m), are raised.
            goal: What the proof was asked for.
            answers: For each level of the sub-box its bounds, or the error that says why there are
                none; such a level keeps its bounds.

        Raises:
            UnprovedError: The proof refused a level for a reason that bisections do not mend, or
                has refused too many.
        """
        self.hull.facts["parts"] += 1
        for k, (level, bounds) in enumerate(zip(box.levels, answers, strict=True)):
            if isinstance(bounds, UnprovedError):
                LOG.info("a sub-box is refused: %s", bounds)
                self.refusals += 1
                if self.refusals >= self.proof.parts or isinstance(bounds, BisectionError):
                    raise bounds
                continue
            self.hull.add_attained(level, bounds)
            needed = goal.needed[k]
            box.upper[k][needed] = np.minimum(box.upper[k], bounds.upper)[needed]
            # From −q ≤ upper follows |q| ≥ q ≥ −upper, and likewise from q ≤ upper. So at every
            # node and for each side, −upper is a lower bound of max |q| over time.
            by_nodes = -box.upper[k].min(axis=(0, 2))
            box.min_peak_lower[k] = np.maximum(box.min_peak_lower[k], by_nodes)
            if bounds.least_peaks is not None:
                lower = bounds.least_peaks.lower
                box.min_peak_lower[k] = np.maximum(box.min_peak_lower[k], lower)

    def _abandon_slow_peaks(self, box: SubBox, answers: Sequence[Answer]) -> None:
        """Mark the peaks, in place, whose gaps bisections are not expected to close as abandoned.

        A peak is the largest value over time of one side of an output on a level, and its gap the
        distance of its bound from the largest attained value. An abandoned peak keeps the bound it
        has, which is valid; only its gap is wider than asked. The counts of sub-boxes, first gaps
        and fractions of the gap by input of the open peaks are updated as well.

        Args:
            box: The sub-box that has just been bounded.
            answers: For each level of it the proof's bounds, or an error; levels with an error are
                skipped.
        """
        max_boxes = self.proof.parts
        for k, (level, bounds) in enumerate(zip(box.levels, answers, strict=True)):
            if isinstance(bounds, UnprovedError):
                continue
            is_open = box.peaks[k] & (self._excess(box, k) > 0)
            upper_peaks = np.maximum(box.upper[k].max(axis=0), self._waiting_peaks(level))
            gap = upper_peaks - self.hull.incumbent(level)
            self.box_count[level] += is_open
            is_first = np.isnan(self.first_gap[level])
            first_gap = np.where(is_first, gap, self.first_gap[level])
            self.first_gap[level][is_open] = first_gap[is_open]

            # A gap that falls evenly reaches the wanted one with the last allowed sub-box.
            count = self.box_count[level]
            even_fall = (first_gap - self.gap) * count / max_boxes
            falls_slowly = gap > first_gap - numbers.MIN_GAP_PROGRESS * even_fall
            # Remainders fall with a power of the widths of the inputs that the gap depends on. A
            # wide gap is given up at once if not even twice the wanted one can be expected.
            bisections = halvings(bounds.gap_fractions, max_boxes)
            final_gap = gap * 2.0 ** (-numbers.GAP_POWER * bisections)
            is_out_of_reach = (gap > self.wide_gap) & (final_gap > 2 * self.gap)
            has_no_progress = (count >= numbers.GRACE) & falls_slowly
            is_hopeless = has_no_progress | (count > max_boxes) | is_out_of_reach
            self.is_abandoned[level] |= is_open & is_hopeless

    def _waiting_peaks(self, level: int) -> Array:
        """Return the largest finite bounds of a level's open peaks over all sub-boxes in the queue.

        Args:
            level: Row of the α-cut, 0 for the widest.

        Returns:
            Shape (m, 2): outputs q, then the sides −q, q; 0 where no sub-box has a finite positive
            bound.
        """
        largest: Array = np.zeros(self.first_gap[level].shape)
        for _, _, box in self.heap:
            if level in box.levels:
                k = box.levels.index(level)
                upper_peaks = box.upper[k].max(axis=0)
                is_bounded = box.peaks[k] & np.isfinite(upper_peaks)
                largest = np.maximum(largest, np.where(is_bounded, upper_peaks, 0.0))
        return largest

    def _peaks_with_open_gaps(self, box: SubBox, k: int) -> Mask:
        """Return the peaks on row k of a sub-box whose gaps are still to be closed, (m, 2)."""
        excess = self._excess(box, k)
        # A sub-box that was refused has no bounds yet, whether its peaks are abandoned or not.
        is_left = self.is_abandoned[box.levels[k]] & np.isfinite(excess)
        return np.asarray(box.peaks[k] & (excess > 0) & ~is_left)

    def _fathom(self, box: SubBox) -> None:
        """Close the peaks of a sub-box that need no further bisection, in place.

        These are the peaks that are abandoned with a finite bound, or whose bound exceeds the
        largest attained value by no more than the wanted gap. Their bounds go into the hull. A
        level keeps all its peaks while any open one has a very wide gap. The sub-box's `peaks`, and
        `is_wide` of the levels that have no wide gaps any more, are changed; when a level loses its
        wide gaps, `min_peak_lower` of the sub-box, its lower bounds of the smallest max |q| over
        time, go into the hull as well.

        Args:
            box: The sub-box.
        """
        for k, level in enumerate(box.levels):
            is_open = self._peaks_with_open_gaps(box, k)
            if (is_open & (self._excess(box, k) > self.wide_gap)).any():
                continue  # bounds of other peaks are worth little then
            if box.is_wide[k]:  # from here on only the open peaks of this level are bounded
                box.is_wide[k] = False
                known = self.hull.min_peak_lower[level]
                self.hull.min_peak_lower[level] = np.minimum(known, box.min_peak_lower[k])
            self.hull.close(level, box.peaks[k] & ~is_open, box.upper[k])
            box.peaks[k] = is_open

    def _pruned_children(self, box: SubBox, answers: Sequence[Answer]) -> Iterator[SubBox]:
        """Yield the smaller sub-boxes to which the proof has confined single peaks.

        These peaks leave `box`, in place, and the bounds over what was pruned go into the hull. The
        pruned fractions of the inputs' widths are added up. If the sum is below a half, the halves
        of the smaller sub-box are yielded instead. Peaks for which nothing was pruned stay in
        `box`, and so do all peaks of a level with very wide gaps (`is_wide`).

        Args:
            box: The sub-box that has just been bounded.
            answers: For each level of it the proof's bounds, or an error. In `pruned`, `remaining`
                is the part of the sub-box that may contain each peak, lower and upper ends, shape
                (2, m, 2, inputs), in SI units, and `upper` the bounds over all else.
        """
        for k, bounds in enumerate(answers):
            if isinstance(bounds, UnprovedError) or bounds.pruned is None or box.is_wide[k]:
                continue
            parent = box.boxes.on_levels([k])
            for output, side in np.argwhere(box.peaks[k]):
                low, high = bounds.pruned.remaining[:, output, side]
                child = box.on_levels(np.array([k]), parent.intersect(low, high))
                has_width = parent.radius > 0
                parent_radius = np.where(has_width, parent.radius, 1.0)
                relative_radius = np.where(has_width, child.boxes.radius / parent_radius, 1.0)
                pruned_fraction = (1 - relative_radius).sum()  # of all inputs, in sum
                if pruned_fraction <= 0:
                    continue
                child.peaks[:] = False
                child.peaks[0, output, side] = True
                self.hull.close(box.levels[k], child.peaks[0], bounds.pruned.upper)
                box.peaks[k, output, side] = False
                if pruned_fraction >= numbers.NARROWED:
                    yield child
                else:
                    fractions = bounds.gap_fractions[output, side]
                    yield from child.bisect(_bisection_axis(child.boxes, fractions))

    def _halves(self, box: SubBox, answers: Sequence[Answer]) -> list[SubBox]:
        """Return both halves of a sub-box on the levels that have open peaks; none without any.

        It is bisected along the input with most votes. Each open peak gives as votes the fractions
        of its gap that inputs account for; on a level on which some gaps are very wide, only those
        peaks vote. An error gives one vote to the input that it names, if any.

        Args:
            box: The sub-box; not changed.
            answers: For each level of it the proof's bounds, or an error.
        """
        if not box.peaks.any():
            return []
        votes = np.zeros(len(self.problem.boxes.names))
        for k, bounds in enumerate(answers):
            if isinstance(bounds, BoxBounds):
                is_open = self._peaks_with_open_gaps(box, k)
                is_wide = is_open & (self._excess(box, k) > self.wide_gap)
                voters = is_wide if is_wide.any() else is_open
                votes += bounds.gap_fractions[voters].sum(axis=0)
            elif bounds.along is not None:
                votes[bounds.along] += 1.0
        open_box = box.on_levels(_open_levels(box))
        return open_box.bisect(_bisection_axis(open_box.boxes, votes))


def _open_levels(box: SubBox) -> Ints:
    """Return the rows of the levels of a sub-box that have open peaks."""
    return np.flatnonzero(box.peaks.any(axis=(1, 2)))


def _bisection_axis(boxes: Boxes, votes: Array) -> int:
    """Return the index of the input along which a sub-box is bisected.

    It is the input of nonzero width with most votes, the first one in a tie. Without votes for any
    of these it is the input whose width is largest in comparison with the magnitude of its
    midpoint. If no input has a width, it is 0.

    Args:
        boxes: The sub-box on each of its levels; its widest box, on the first row, decides.
        votes: Votes for each of d inputs, shape (d,), ≥ 0.
    """
    width = boxes.upper[0] - boxes.lower[0]
    votes = np.where(width > 0, votes, 0.0)
    if votes.any():
        return int(votes.argmax())
    return int((width / np.maximum(np.abs(boxes.centre), 1e-300)).argmax())


def halvings(gap_fractions: Array, max_boxes: int) -> Array:
    """Return how often an input can be halved with `max_boxes` sub-boxes, on average over inputs.

    A path through the tree of sub-boxes has log2(max_boxes) bisections, of which each input gets
    its fraction of the gap. The fractions are also the weights of the average.

    Args:
        gap_fractions: Fraction of the gap that each input accounts for, shape (…, inputs).
        max_boxes: Most sub-boxes, at least 1.

    Returns:
        Shape (…,); 1 where all fractions are zero.
    """
    average = np.log2(max_boxes) * (gap_fractions**2).sum(axis=-1)
    return np.where(gap_fractions.any(axis=-1), average, 1.0)
