"""Spatial branch and bound over the inputs, above every proof: bounds over parts of a box.

1. A part takes the bounds that a proof has of it. What may still hold a peak that is higher than
   the incumbent by more than the gap asked for is open; all else is closed with its bounds.
2. A part that the proof refuses, or that is open, is bisected: along the input that the refusal
   names, else along the one with the largest share of the gap; at the geometric middle where the
   ends are positive and far apart, since frequencies are powers of stiffnesses and masses.
3. The part with the largest bound comes first. Where a gap falls too slowly it is left.

A node's bound is the largest over all parts (Adjiman, Floudas 1998; pruning by bounds).
"""

from __future__ import annotations

import hashlib
import logging
import os
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial

import numpy as np

from alphacut.frame.bounds.box_proof import BisectionError, BoxProof, Goal, PartBounds, refusing
from alphacut.frame.bounds.part_store import PartStore
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.flow import LinearFlow, exact_flow
from alphacut.frame.envelope import Ends, Envelope
from alphacut.fuzzy.arrays import Array, Mask
from alphacut.fuzzy.progress_bar import Progress
from alphacut.fuzzy.refused import FailedError
from alphacut.fuzzy.result import Nature

LOG = logging.getLogger(__name__)

BATCH = 2
"""Parts that are bounded with the same incumbents, whatever the number of threads."""
MIN_PROGRESS = 0.8
"""A gap is left where it has fallen by less than this share of an even fall over all parts."""
GRACE = 8
"""Parts that are bounded before the progress of a gap counts."""
WIDE = 0.1
"""Gap of a peak, as a share of it, above which bounds are worth nothing elsewhere either. It is
left where parts are not expected to close it."""
FALL = 3
"""Power of the inputs' widths with which gaps fall at least; remainders are of fourth degree."""
NAMED = 3
"""Inputs that are named with their shares in a gap."""
OWN_WORK = 0.5
"""Share of a part's expected work that its own bounds take, and not its halves."""
ADDED = ("boxes", "evaluations")
"""Facts of parts that are added; of the others the largest counts."""
NARROWED = 0.5
"""Shares pruned from all inputs, in sum, from which on a part is bounded anew, not bisected."""


@dataclass(eq=False)
class Part:
    """A part of the box whose bounds are to be improved.

    Args:
        boxes: Its L levels.
        levels: Which of all levels they are.
        needed: Bounds that are asked for, shape (L, T, m, 2).
        outer: Bounds that are known, same shape.
        urgency: Excess of the largest known bound over the incumbent, in units of the wanted gap.
        work: Fraction of all work that it is expected to take, with its halves.
    """

    boxes: Boxes
    levels: list[int]
    needed: Mask
    outer: Array
    urgency: float = np.inf
    work: float = 1.0

    def restricted(self, chosen: Sequence[int], needed: Mask) -> Part:
        """Return the part on some levels, given by their rows, with other `needed` bounds."""
        levels = [self.levels[k] for k in chosen]
        return Part(self.boxes.on_levels(chosen), levels, needed, self.outer[list(chosen)])

    def bisected(self, axis: int) -> list[Part]:
        """Return both halves along an input, each with the levels that reach it."""
        halves = []
        for boxes, reached in self.boxes.bisected(axis):
            levels = [self.levels[k] for k in reached]
            halves.append(Part(boxes, levels, self.needed[reached], self.outer[reached]))
        return halves


class _Tick:
    """Progress of all parts from that of a batch of them."""

    def __init__(
        self, progress: Progress | None, waiting: Sequence[Part], batch: Sequence[Part]
    ) -> None:
        self.progress, self.work = progress, [part.work for part in batch]
        self.waiting_work = sum(part.work for part in waiting)
        self.fractions = [0.0] * len(batch)

    def __call__(self, position: int, fraction: float) -> None:
        """Report the completed fraction of part `position` of the batch, as that of all work."""
        self.fractions[position] = max(fraction, self.fractions[position])
        if self.progress is not None:
            pairs = zip(self.work, self.fractions, strict=True)
            remaining = self.waiting_work
            remaining += sum(work * (1 - OWN_WORK * fraction) for work, fraction in pairs)
            self.progress(1 - remaining)


Key = tuple[int, int, int]
"""A peak: its level, output and side."""


@dataclass(eq=False)
class Queue:
    """Queue of a spatial branch and bound: open parts, and the hull of the bounds of closed ones.

    Args:
        proof: Method that bounds the outputs over a part.
        flow: Exact motions of a linear structure.
        boxes: All levels, A of them.
        scale: As of `Goal`.
        peak: As of `Goal`.
        store: Bounds of parts from an earlier run; None for none.
    """

    proof: BoxProof
    flow: LinearFlow
    boxes: Boxes
    scale: Array
    peak: Array
    store: PartStore | None = None

    def __post_init__(self) -> None:
        """Start with the whole box as the only open part, and an empty hull of closed parts.

        `closed` are proved bounds of closed parts; `inner` are attained bounds, `at` their inputs.
        """
        shape = (len(self.boxes.alpha), len(self.flow.time), len(self.flow.outputs), 2)
        self.closed, self.inner = np.full(shape, -np.inf), np.full(shape, -np.inf)
        self.at = np.zeros((*shape, len(self.boxes.names)))
        self.between, self.attained_error = np.zeros((2, *shape[1:3]))
        self.least_peaks = np.full((shape[0], shape[2]), np.inf)
        self.least_reached = np.full((shape[0], shape[2]), np.inf)
        self.facts: dict[str, float] = {"parts": 0}
        self.refusals, self.refusal = 0, UnprovedError("nothing was tried")
        self.workers = self.proof.workers or os.cpu_count() or 1
        self.gap = self.proof.peak_gap(self.scale, self.peak)
        root = Part(self.boxes, [*range(shape[0])], np.ones(shape, bool), np.full(shape, np.inf))
        self.open = [root]
        self.gap_shares = dict[Key, Array]()
        self.parts_of_peak, self.first_gaps = dict[Key, int](), dict[Key, float]()
        self.abandoned = set[Key]()

    def run(self, progress: Progress | None = None, *, interruptible: bool = False) -> None:
        """Bound and bisect parts until none is open.

        Args:
            progress: Called with the completed fraction of the work.
            interruptible: Whether Ctrl-C ends the work with the bounds known so far, if all parts
                have some; KeyboardInterrupt is raised otherwise.

        Raises:
            UnprovedError: The proof refuses too many parts, or one that bisections would not help.
        """
        batch: list[Part] = []
        pool = ThreadPoolExecutor(self.workers)
        try:
            while batch := self._next():
                tick = _Tick(progress, self.open, batch)
                goals = [
                    self._goal(part, self.workers // len(batch), partial(tick, number))
                    for number, part in enumerate(batch)
                ]
                found = list(pool.map(self._bounds, batch, goals))
                for part, levels in zip(batch, found, strict=True):
                    self._settle(part, levels)
        except KeyboardInterrupt:
            self.open += batch
            are_bounded = (np.isfinite(part.outer[part.needed]).all() for part in self.open)
            if not interruptible or not all(are_bounded):
                raise
            self.facts["interrupted"] = 1.0
            for part in self.open:
                for k, level in enumerate(part.levels):
                    self._close(level, part.needed[k], part.outer[k])
        finally:
            pool.shutdown(wait=False, cancel_futures=True)

    def _next(self) -> list[Part]:
        """Remove the most urgent parts, at most `BATCH`, from the queue and return them.

        Parts in which no bound is to be improved any more are dropped before.
        """
        for part in self.open:
            self._drop_abandoned(part)
        self.open = [part for part in self.open if part.needed.any()]
        self.open.sort(key=lambda part: -part.urgency)
        batch, self.open = self.open[:BATCH], self.open[BATCH:]
        return batch

    def _drop_abandoned(self, part: Part) -> None:
        """Take a part's known bounds of abandoned peaks, whose gaps fall too slowly, as final."""
        for k, level in enumerate(part.levels):
            for abandoned_level, output, side in self.abandoned:
                if abandoned_level == level and part.needed[k, :, output, side].any():
                    entry = (slice(None), output, side)
                    mask = np.zeros_like(part.needed[k])
                    # a part that was refused has no bounds yet
                    mask[entry] = part.needed[k][entry] & np.isfinite(part.outer[k][entry])
                    self._close(level, mask, part.outer[k])
                    part.needed[k] &= ~mask

    def _close(self, level: int, mask: Mask, outer: Array) -> None:
        """Raise the hull of closed parts on a level to the bounds (T, m, 2) under the mask."""
        hull = self.closed[level]
        hull[mask] = np.maximum(hull[mask], outer[mask])

    def _incumbent(self, level: int) -> Array:
        """Return the largest attained value of (−output, output) on a level, (m, 2); at least 0."""
        return np.asarray(np.maximum(self.inner[level:].max((0, 1)), 0.0))

    def _goal(self, part: Part, workers: int, tick: Progress) -> Goal:
        """Return the bounds and the accuracy that the proof is asked for on a part."""
        incumbent = np.stack([self._incumbent(level) for level in part.levels])
        return Goal(
            scale=self.scale,
            peak=self.peak,
            needed=part.needed,
            outer=part.outer,
            incumbent=incumbent,
            workers=max(workers, 1),
            last=self.refusals >= self.proof.parts - 1,
            tick=tick,
        )

    def _bounds(self, part: Part, goal: Goal) -> Sequence[PartBounds | UnprovedError]:
        """Return bounds or refusal on each level of a part, from the store or by the proof."""
        path = None if self.store is None else self.store.path(part.boxes, goal)
        if self.store is not None and path is not None and (stored := self.store.read(path)):
            return stored
        try:
            with refusing():
                found = self.proof.bounds(self.flow, part.boxes, goal)
        except UnprovedError as refusal:
            LOG.info("a part of the box is refused: %s", refusal)
            found = [refusal] * len(part.levels)
        if self.store is not None and path is not None:
            self.store.write(path, found)
        return found

    def _settle(self, part: Part, found: Sequence[PartBounds | UnprovedError]) -> None:
        """Take over the bounds of a part, close tight ones, and queue its halves for the others.

        Args:
            part: The part.
            found: Bounds or refusal on each of its levels.
        """
        self.facts["parts"] += 1
        LOG.debug("part %d is bounded, %d are open", self.facts["parts"], len(self.open))
        for k, level in enumerate(part.levels):
            if isinstance(bounds := found[k], PartBounds):
                part.outer[k] = np.where(
                    part.needed[k], np.minimum(part.outer[k], bounds.outer), part.outer[k]
                )
                self._take(level, bounds)
        # votes for the input to bisect; mask of the bounds that both halves must improve
        votes, children = np.zeros(len(self.boxes.names)), list[Part]()
        open_bounds = np.zeros_like(part.needed)
        for k, level in enumerate(part.levels):
            if isinstance(bounds := found[k], PartBounds):
                open_bounds[k] = self._split(part, k, level, bounds, votes, children)
            else:
                open_bounds[k] = part.needed[k]
                self._count_refusal(bounds, votes)
        levels = [k for k in range(len(part.levels)) if open_bounds[k].any()]
        if levels:
            open_part = part.restricted(levels, open_bounds[levels])
            children += open_part.bisected(self._axis(open_part.boxes, votes))
        for child in children:
            child.work = (1 - OWN_WORK) * part.work / len(children)
        self._put(children)

    def _count_refusal(self, refusal: UnprovedError, votes: Array) -> None:
        """Count a refusal and vote for the input to bisect; raise it if parts do not help."""
        self.refusals, self.refusal = self.refusals + 1, refusal
        if self.refusals >= self.proof.parts or isinstance(refusal, BisectionError):
            raise refusal
        if refusal.along is not None:
            votes[refusal.along] += 1.0

    def _take(self, level: int, bounds: PartBounds) -> None:
        """Merge the bounds of a part of the box into those of a level.

        Larger attained values and their inputs replace smaller ones. The larger error and the
        smaller bound of the smallest peak are kept. Facts in `ADDED` are added; of others the
        largest is kept.
        """
        better = bounds.inner > self.inner[level]
        self.inner[level][better], self.at[level][better] = bounds.inner[better], bounds.at[better]
        self.between = np.maximum(self.between, bounds.between)
        if bounds.attained_error is not None:
            self.attained_error = np.maximum(self.attained_error, bounds.attained_error)
        if bounds.least_peaks is not None:
            reached = self.least_reached[level]
            self.least_reached[level] = np.minimum(reached, bounds.least_peaks.upper)
        for name, value in bounds.facts.items():
            earlier = self.facts.get(name)
            if earlier is not None:
                value = earlier + value if name in ADDED else max(earlier, value)
            self.facts[name] = value

    def _split(
        self,
        part: Part,
        k: int,
        level: int,
        bounds: PartBounds,
        votes: Array,
        children: list[Part],
    ) -> Mask:
        """Close bounds that are tight enough, and return the mask (T, m, 2) of those still open.

        Peaks that can only lie in a smaller box leave the mask; that box is appended to `children`.

        Args:
            part: The part.
            k: Row of the level in the part.
            level: Row of the level in all levels.
            bounds: The part's bounds on the level.
            votes: Votes for the inputs to bisect, shape (n,); shares in open gaps are added.
            children: Parts for the queue.
        """
        needed, outer = part.needed[k], part.outer[k]
        # a bound may hold a peak above the incumbent by more than the wanted gap
        limit, is_wide = self._incumbent(level) + self.gap[:, None], False
        above = needed & (outer > limit)
        if bounds.pruned is not None:
            self._close(level, above, bounds.pruned)
        for output, side in _peaks(above):
            key = (level, output, side)
            peak = float(outer[:, output, side].max())
            self.gap_shares[key] = bounds.shares[output, side]
            if self._is_hopeless(key, peak, bounds.shares[output, side]):
                self.abandoned.add(key)
                above[:, output, side] = False
            elif peak > limit[output, side] + WIDE * self.peak[output]:
                votes += bounds.shares[output, side]
                is_wide = True
        if is_wide:  # so are the bounds elsewhere: all of them are open
            return np.asarray(needed)
        if needed.all():  # parts of this one are asked for their largest peaks alone
            least = 0.0 if bounds.least_peaks is None else bounds.least_peaks.lower
            self.least_peaks[level] = np.minimum(self.least_peaks[level], least)
        self._close(level, needed & ~above, outer)
        for output, side in _peaks(above):
            votes += bounds.shares[output, side]
            ends = None if bounds.remaining is None else bounds.remaining[:, output, side]
            if ends is None or not self._is_narrower(ends, part.boxes.on_levels([k])):
                continue
            mask = np.zeros_like(above)
            mask[:, output, side] = above[:, output, side]
            above = above & ~mask
            child = part.restricted([k], mask[None])
            radius = child.boxes.radius
            child.boxes = child.boxes.within(*ends)
            pruned = 1 - child.boxes.radius / np.where(radius > 0, radius, 1.0)
            if pruned[radius > 0].sum() >= NARROWED:
                children.append(child)
            else:
                axis = self._axis(child.boxes, bounds.shares[output, side])
                children += child.bisected(axis)
        return np.asarray(above)

    @staticmethod
    def _is_narrower(ends: Array, boxes: Boxes) -> bool:
        return bool((ends[0] > boxes.lower[0]).any() or (ends[1] < boxes.upper[0]).any())

    def _is_hopeless(self, key: Key, peak: float, shares: Array) -> bool:
        """Return True if bisections are not expected to close the gap of a peak.

        It has fallen too slowly, or will after all parts that are allowed: by 2^−`FALL` for each
        halving of the inputs that it depends on.

        Args:
            key: Level, output and side of the peak.
            peak: Its upper bound in the part.
            shares: Fraction of each input in its gap, shape (n,).
        """
        level, output, side = key
        other_bounds = [  # of the peak in parts that wait
            float(part.outer[k, :, output, side][part.needed[k, :, output, side]].max(initial=0))
            for part in self.open
            for k, part_level in enumerate(part.levels)
            if part_level == level
        ]
        incumbent, max_parts = self._incumbent(level)[output, side], self.proof.parts
        upper_bound = max([peak, *(bound for bound in other_bounds if np.isfinite(bound))])
        gap = upper_bound - incumbent
        count = self.parts_of_peak[key] = self.parts_of_peak.get(key, 0) + 1
        first_gap = self.first_gaps.setdefault(key, gap)
        even_fall = (first_gap - self.gap[output]) * count / max_parts
        if count >= GRACE and gap > first_gap - MIN_PROGRESS * even_fall:
            return True
        final_gap = gap * 2.0 ** (-FALL * halvings(shares, max_parts))
        is_wide = gap > WIDE * self.peak[output]
        return count > max_parts or (is_wide and final_gap > 2 * self.gap[output])

    def notes(self, outer: Array, inner: Array) -> Iterator[str]:
        """Yield sentences on an interruption, and on the inputs to narrow if a gap remains.

        Args:
            outer: Proved bounds, shape (A, T, m, 2).
            inner: Attained bounds, same shape.
        """
        if "interrupted" in self.facts:
            yield f"interrupted, with {len(self.open)} parts left whose bounds are wider than asked"
        gaps = (outer.max(1) - inner.max(1)) / self.peak[:, None]  # (A, m, 2)
        key: Key = max(self.gap_shares, key=lambda key: gaps[key], default=(-1, 0, 0))
        if key not in self.gap_shares or gaps[key] * self.peak[key[1]] <= self.gap[key[1]]:
            return
        shares = self.gap_shares[key]
        largest = [axis for axis in np.argsort(-shares)[:NAMED] if shares[axis] > 0]
        words = ", ".join(f"{self.boxes.names[axis]} {shares[axis]:.0%}" for axis in largest)
        if largest:
            name = self.boxes.names[largest[0]]
            yield (
                f"gap of {self.flow.outputs[key[1]]}, {gaps[key]:.2g} of its peak, by input:"
                f" {words}; narrow {name} first"
            )

    def _axis(self, boxes: Boxes, votes: Array) -> int:
        """Return the input with most votes; without votes that of largest relative width."""
        width = boxes.upper[0] - boxes.lower[0]
        votes = np.where(width > 0, votes, 0.0)
        if votes.any():
            return int(votes.argmax())
        return int((width / np.maximum(np.abs(boxes.centre), 1e-300)).argmax())

    def _put(self, parts: Sequence[Part]) -> None:
        """Set the urgency of parts and add them to the queue.

        It is the largest excess of a bound over the incumbent, in units of the wanted gap.
        """
        for part in parts:
            excess = [
                (np.where(part.needed[k], part.outer[k], -np.inf).max(0) - self._incumbent(level))
                / np.maximum(self.gap[:, None], 1e-300)
                for k, level in enumerate(part.levels)
            ]
            part.urgency = float(np.max(excess))
            self.open.append(part)


def _peaks(above: Mask) -> list[tuple[int, int]]:
    """Return the pairs (output, side) with a bound under the mask (T, m, 2)."""
    return [(int(output), int(side)) for output, side in np.argwhere(above.any(0))]


def halvings(shares: Array, parts: int) -> float:
    """Return the mean number of bisections of an input, weighted by its share of a gap.

    The log2(parts) bisections are distributed in proportion to the shares; 1 if all are zero.

    Args:
        shares: Fraction of each input in the gap, shape (n,), their sum 1.
        parts: Number of parts.
    """
    return float(np.log2(parts) * (shares**2).sum()) if shares.any() else 1.0


def prove(proof: BoxProof, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
    """Return the guaranteed envelope of all outputs on all levels, by spatial branch and bound.

    Raises:
        UnprovedError: The system is not linear, its integrator not the exact one, or bounds are not
            proved.
    """
    start_time, linear, cuts = time.perf_counter(), exact_flow(flow.flow), flow.boxes
    with refusing():
        proof.forecast(linear, cuts)
    store = None if flow.store is None else PartStore(flow.store, _fingerprint(proof, flow))
    queue = Queue(proof, linear, cuts, flow.scale, flow.peak, store)
    queue.run(progress, interruptible=flow.interruptible)
    outer = np.minimum.accumulate(queue.closed, axis=0)
    inner, at = queue.inner, queue.at
    for level in reversed(range(len(inner) - 1)):  # what a narrower cut attains is attained here
        better = inner[level + 1] > inner[level]
        inner[level][better], at[level][better] = inner[level + 1][better], at[level + 1][better]
    _require_order(inner, outer, flow.outputs)
    least_peaks = Ends(  # a lower bound holds in narrower cuts, what is reached in wider ones
        np.maximum.accumulate(queue.least_peaks, axis=0),
        np.minimum.accumulate(queue.least_reached[::-1], axis=0)[::-1],
    )
    error = (outer - inner).max(-1)
    largest = np.maximum(np.abs(outer).max((1, 3)), 1e-300)
    peak_gaps = (outer.max(1) - inner.max(1)).max(-1) / largest
    facts = {
        **queue.facts,
        "gap": float((error / flow.scale).max()),
        "gap_of_peaks": float(peak_gaps.max()),
    }
    return Envelope(
        alpha=cuts.alpha,
        time=flow.time,
        outputs=flow.outputs,
        inputs=cuts.inputs,
        lower=-outer[..., 0],
        upper=outer[..., 1],
        lower_at=at[..., 0, :],
        upper_at=at[..., 1, :],
        error=error,
        nature=Nature.GUARANTEED,
        method=proof.name,
        units=flow.units,
        basis=("the equations of motion hold",),
        inner=Ends(-inner[..., 0], inner[..., 1]),
        between=queue.between,
        least_peaks=least_peaks,
        attained_error=queue.attained_error if queue.attained_error.any() else None,
        evaluations=int(facts.pop("evaluations", inner.size)),
        seconds=time.perf_counter() - start_time,
        facts=facts,
        notes=(*queue.notes(outer, inner),),
    )


def _fingerprint(proof: BoxProof, flow: UnitFlow) -> bytes:
    """Return a hash of a proof with its options and of the structure's motion at the probes."""
    options = {name: value for name, value in vars(proof).items() if name != "workers"}
    words = repr((proof.name, options, flow.boxes.names))
    motions = flow.flow.values(flow.boxes.probes)
    return hashlib.sha256(words.encode() + motions.tobytes() + flow.scale.tobytes()).digest()


def _require_order(inner: Array, outer: Array, outputs: tuple[str, ...]) -> None:
    """Refuse attained bounds (A, T, m, 2), less their rounding, that exceed proved ones.

    Raises:
        FailedError: One does, or is not a number.
    """
    is_wrong = ~(inner <= outer)  # also where one is NaN
    if is_wrong.any():
        output = outputs[int(np.argwhere(is_wrong)[0, 2])]
        excess = np.nanmax(np.where(is_wrong, inner - outer, np.nan))
        what = f"attained bounds of {output} lie outside the proved ones by {excess:.3g}"
        raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")
