"""Spatial branch and bound over the fuzzy inputs, above every proof (Adjiman, Floudas 1998).

A proof bounds the outputs over a box of the inputs, on all its α-levels at once. The outputs'
peaks, not all nodes, decide what is branched: a peak is fathomed where its bound exceeds the
incumbent, the largest value that an exact motion reaches, by no more than the gap asked for. The
bound at a node is the largest over all boxes.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from heapq import heappop, heappush

import numpy as np

from alphacut.base.arrays import Array, Ints, Mask
from alphacut.base.progress_bar import Progress
from alphacut.base.threads import KernelThreads
from alphacut.frame import numbers
from alphacut.frame.bounds.box_proof import Answer, BisectionError, BoxProof, Goal, Hull, refusing
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import exact_flow
from alphacut.frame.envelope import Envelope

LOG = logging.getLogger(__name__)

BATCH = 2
"""Boxes that are bounded with the same incumbents, whatever the number of threads."""
OWN_WORK = 0.5
"""Fraction of a box's expected work that its own bounds take, and not its halves."""


@dataclass(eq=False)
class SubBox:
    """A box of inputs on L levels, with what is known and what is open there."""

    boxes: Boxes  # its ends on each level
    levels: list[int]  # which of all levels these are
    peaks: Mask  # peaks of (−output, output) that are not fathomed, (L, m, 2)
    outer: Array  # upper bounds of (−output, output) that are known, (L, T, m, 2)
    least_lower: Array  # lower bounds of each output's least peak over time, (L, m)
    is_wide: Mask  # levels on which bounds are worth little at any node, (L,)
    work: float = 1.0  # fraction of all work that it is expected to take, with its halves
    done: float = 0.0  # completed fraction of its own bounds

    def on_levels(self, rows: Ints, boxes: Boxes | None = None) -> SubBox:
        """Copy on some levels, given by their rows, with the ends of `boxes` if given."""
        boxes = self.boxes.on_levels(rows) if boxes is None else boxes
        levels, peaks, outer = [self.levels[k] for k in rows], self.peaks[rows], self.outer[rows]
        return SubBox(
            boxes, levels, peaks, outer, self.least_lower[rows], self.is_wide[rows], self.work
        )

    def bisect(self, axis: int) -> list[SubBox]:
        """Both halves along an input, each with the levels that reach it."""
        return [self.on_levels(rows, half) for half, rows in self.boxes.bisect(axis)]


def prove(proof: BoxProof, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
    """Return the guaranteed envelope of all outputs on all levels.

    Raises:
        UnprovedError: The system is not linear, its integrator not the exact one, or bounds are not
            proved.
    """
    queue = Queue(proof, flow)
    queue.run(progress)
    return queue.hull.envelope(proof.name, queue.notes())


class Queue:
    """Open boxes, best first, and the hull of the closed ones, on A levels."""

    def __init__(self, proof: BoxProof, problem: UnitFlow) -> None:
        self.proof, self.problem, boxes = proof, problem, problem.boxes
        self.flow, self.workers = exact_flow(problem.flow), proof.workers or os.cpu_count() or 1
        with refusing():
            proof.forecast(self.flow, boxes)
        self.hull = Hull(problem, self.flow)
        self.gap = proof.peak_gap(problem)[:, None]
        self.wide = numbers.WIDE * problem.peak[:, None]
        self.refusals, self.pushes = 0, 0
        self.heap: list[tuple[float, int, SubBox]] = []
        levels, _, outputs, _ = shape = self.hull.closed.shape
        peaks = (levels, outputs, 2)  # boxes that each was bounded on, and its gap after the first
        self.number, self.first_gap = np.zeros(peaks, int), np.full(peaks, np.nan)
        self.abandoned = np.zeros(peaks, bool)  # whose gaps fall too slowly
        self.gap_shares = np.zeros((*peaks, len(boxes.names)))  # of each input in a peak's gap
        is_open, outer, least = np.ones(peaks, bool), np.full(shape, np.inf), np.zeros(peaks[:2])
        self._push(SubBox(boxes, [*range(levels)], is_open, outer, least, np.ones(levels, bool)))

    def run(self, progress: Progress | None = None) -> None:
        """Bound and branch until all peaks are fathomed or abandoned.

        Raises:
            UnprovedError: The proof refuses too many boxes, or one that bisections would not help.
        """
        pool = KernelThreads(self.workers, self.proof.call_kernels)
        try:
            while batch := self._next():
                tick = partial(self._tick, progress, batch)
                goals = [self._goal(box, self.workers // len(batch), tick) for box in batch]
                found = list(pool.map(self._bound, batch, goals))
                for box, goal, answers in zip(batch, goals, found, strict=True):
                    self._take(box, goal, answers)
                    self._abandon(box, answers)
                    self._fathom(box)
                    children = [*self._pruned(box, answers), *self._halves(box, answers)]
                    for child in children:
                        child.work = (1 - OWN_WORK) * box.work / len(children)
                        self._push(child)
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

    def notes(self) -> Iterator[str]:
        """Yield a sentence on the input to narrow where a gap remains."""
        gaps = np.minimum.accumulate(self.hull.closed.max(1), axis=0)
        gaps -= np.stack([self.hull.incumbent(level) for level in range(len(gaps))])
        gaps = np.where(self.number > 0, gaps, -np.inf) / self.problem.peak[:, None]
        level, output, side = np.unravel_index(gaps.argmax(), gaps.shape)
        gap, shares = gaps[level, output, side], self.gap_shares[level, output, side]
        if gap * self.problem.peak[output] > self.gap[output, 0] and shares.any():
            name, share = self.problem.boxes.names[shares.argmax()], shares.max()
            of_peak = f"gap of {self.flow.outputs[output]}, {gap:.2g} of its peak"
            yield f"{of_peak}: {share:.0%} of it by {name}, which is to be narrowed first"

    def _push(self, box: SubBox) -> None:
        """Queue a box by the largest excess of its bounds, in units of the gap; ties by age."""
        gap = np.maximum(self.gap, 1e-300)
        excess = [self._excess(box, k) / gap for k in range(len(box.levels))]
        priority = -float(np.max(np.where(box.peaks, excess, -np.inf)))
        self.pushes += 1
        heappush(self.heap, (priority, self.pushes, box))

    def _next(self) -> list[SubBox]:
        """Remove the `BATCH` boxes with the largest excess that have open peaks still."""
        batch = list[SubBox]()
        while self.heap and len(batch) < BATCH:
            *_, box = heappop(self.heap)
            self._fathom(box)  # incumbents have risen since, and peaks were abandoned
            if box.peaks.any():
                batch.append(box.on_levels(np.flatnonzero(box.peaks.any((1, 2)))))
        return batch

    def _tick(
        self, progress: Progress | None, batch: Sequence[SubBox], box: SubBox, fraction: float
    ) -> None:
        """Report the completed fraction of a box's bounds as that of all work."""
        box.done = max(fraction, box.done)
        if progress is not None:
            waiting = sum(other.work for *_, other in self.heap)
            progress(1 - waiting - sum(x.work * (1 - OWN_WORK * x.done) for x in batch))

    def _excess(self, box: SubBox, k: int) -> Array:
        """How far peaks may exceed the incumbent by more than the gap, shape (m, 2)."""
        return np.asarray(box.outer[k].max(0) - self.hull.incumbent(box.levels[k]) - self.gap)

    def _goal(self, box: SubBox, workers: int, tick: Callable[[SubBox, float], None]) -> Goal:
        """What is asked for: all bounds on wide levels, else those above an open peak."""
        incumbent = np.stack([self.hull.incumbent(level) for level in box.levels])
        above = box.outer > (incumbent + self.gap)[:, None]
        return Goal(
            scale=self.problem.scale,
            peak=self.problem.peak,
            needed=box.peaks[:, None] & (above | box.is_wide[:, None, None, None]),
            outer=box.outer,
            incumbent=incumbent,
            workers=max(workers, 1),
            last=self.refusals >= self.proof.parts - 1,
            tick=partial(tick, box),
        )

    def _bound(self, box: SubBox, goal: Goal) -> Sequence[Answer]:
        try:
            with refusing():
                return self.proof.bounds(self.flow, box.boxes, goal)
        except UnprovedError as refusal:
            return [refusal] * len(box.levels)

    def _take(self, box: SubBox, goal: Goal, answers: Sequence[Answer]) -> None:
        """Take over bounds and reached values; raise a refusal that bisections do not mend."""
        self.hull.facts["parts"] += 1
        for k, (level, bounds) in enumerate(zip(box.levels, answers, strict=True)):
            if isinstance(bounds, UnprovedError):
                LOG.info("a box is refused: %s", bounds)
                self.refusals += 1
                if self.refusals >= self.proof.parts or isinstance(bounds, BisectionError):
                    raise bounds
                continue
            self.hull.take(level, bounds)
            needed = goal.needed[k]
            box.outer[k][needed] = np.minimum(box.outer[k], bounds.outer)[needed]
            # |output| is at least −outer at any node, on either side; so is its peak over time
            box.least_lower[k] = np.maximum(box.least_lower[k], -box.outer[k].min((0, 2)))
            if bounds.least_peaks is not None:
                box.least_lower[k] = np.maximum(box.least_lower[k], bounds.least_peaks.lower)

    def _abandon(self, box: SubBox, answers: Sequence[Answer]) -> None:
        """Abandon peaks whose gaps bisections are not expected to close."""
        for k, (level, bounds) in enumerate(zip(box.levels, answers, strict=True)):
            if isinstance(bounds, UnprovedError):
                continue
            is_open = box.peaks[k] & (self._excess(box, k) > 0)
            gap = np.maximum(box.outer[k].max(0), self._waiting(level)) - self.hull.incumbent(level)
            self.number[level] += is_open
            number, max_boxes = self.number[level], self.proof.parts
            self.gap_shares[level][is_open] = bounds.shares[is_open]
            first_gap = np.where(np.isnan(self.first_gap[level]), gap, self.first_gap[level])
            self.first_gap[level][is_open] = first_gap[is_open]
            even_fall = (first_gap - self.gap) * number / max_boxes
            falls_slowly = gap > first_gap - numbers.MIN_GAP_PROGRESS * even_fall
            # remainders fall with a power of the widths of the inputs that the gap depends on
            final_gap = gap * 2.0 ** (-numbers.GAP_POWER * halvings(bounds.shares, max_boxes))
            is_wide = gap > self.wide
            is_hopeless = (number >= numbers.GRACE) & falls_slowly | (number > max_boxes)
            is_hopeless |= is_wide & (final_gap > 2 * self.gap)
            self.abandoned[level] |= is_open & is_hopeless

    def _waiting(self, level: int) -> Array:
        """Largest finite bounds of a level's open peaks over the boxes that wait, (m, 2)."""
        largest = np.zeros_like(self.first_gap[level])
        for *_, box in self.heap:
            if level in box.levels:
                k = box.levels.index(level)
                peaks = box.outer[k].max(0)
                is_bounded = box.peaks[k] & np.isfinite(peaks)
                largest = np.maximum(largest, np.where(is_bounded, peaks, 0.0))
        return largest

    def _open_peaks(self, box: SubBox, k: int) -> tuple[Mask, Mask]:
        """Peaks on level k whose gaps are to be closed, and the wide ones of them, (m, 2) each."""
        excess = self._excess(box, k)
        # a box that was refused has no bounds yet, whether its peaks are abandoned or not
        is_left = self.abandoned[box.levels[k]] & np.isfinite(excess)
        is_open = box.peaks[k] & (excess > 0) & ~is_left
        return is_open, is_open & (excess > self.wide)

    def _fathom(self, box: SubBox) -> None:
        """Close peaks that are abandoned or exceed the incumbent by no more than the gap."""
        for k, level in enumerate(box.levels):
            is_open, is_wide = self._open_peaks(box, k)
            if is_wide.any():  # bounds of other peaks are worth little then
                continue
            if box.is_wide[k]:  # from here on the level's open peaks alone are bounded
                box.is_wide[k] = False
                hull = self.hull
                hull.least_lower[level] = np.minimum(hull.least_lower[level], box.least_lower[k])
            self.hull.close(level, box.peaks[k] & ~is_open, box.outer[k])
            box.peaks[k] = is_open

    def _pruned(self, box: SubBox, answers: Sequence[Answer]) -> Iterator[SubBox]:
        """Boxes to which single peaks are confined, which leave `box`; bisected if hardly less."""
        for k, bounds in enumerate(answers):
            if isinstance(bounds, UnprovedError) or bounds.remaining is None or box.is_wide[k]:
                continue
            parent = box.boxes.on_levels([k])
            for output, side in np.argwhere(box.peaks[k]):
                child = box.on_levels(
                    np.array([k]), parent.intersect(*bounds.remaining[:, output, side])
                )
                width = np.where(parent.radius > 0, parent.radius, 1.0)
                cut = np.where(parent.radius > 0, 1 - child.boxes.radius / width, 0.0).sum()
                if cut <= 0:
                    continue
                child.peaks[:] = False
                child.peaks[0, output, side] = True
                if bounds.pruned is not None:
                    self.hull.close(box.levels[k], child.peaks[0], bounds.pruned)
                box.peaks[k, output, side] = False
                if cut >= numbers.NARROWED:
                    yield child
                else:
                    yield from child.bisect(_axis(child.boxes, bounds.shares[output, side]))

    def _halves(self, box: SubBox, answers: Sequence[Answer]) -> list[SubBox]:
        """Both halves along the input that refusals name or with the largest share of the gaps."""
        votes = np.zeros(len(self.problem.boxes.names))
        for k, bounds in enumerate(answers):
            if isinstance(bounds, UnprovedError):
                if bounds.along is not None:
                    votes[bounds.along] += 1.0
                continue
            is_open, is_wide = self._open_peaks(box, k)
            votes += bounds.shares[is_wide if is_wide.any() else is_open].sum(0)
        if not box.peaks.any():
            return []
        rows = np.flatnonzero(box.peaks.any((1, 2)))
        open_box = box.on_levels(rows)
        return open_box.bisect(_axis(open_box.boxes, votes))


def _axis(boxes: Boxes, votes: Array) -> int:
    """Input with a width that has most votes; without votes that of largest relative width."""
    width = boxes.upper[0] - boxes.lower[0]
    votes = np.where(width > 0, votes, 0.0)
    if votes.any():
        return int(votes.argmax())
    return int((width / np.maximum(np.abs(boxes.centre), 1e-300)).argmax())


def halvings(shares: Array, parts: int) -> Array:
    """Return the mean number of bisections of an input, weighted by its share of a gap (…, n).

    The log2(parts) bisections are distributed in proportion to the shares; 1 if all are zero.
    """
    return np.where(shares.any(-1), np.log2(parts) * (shares**2).sum(-1), 1.0)
