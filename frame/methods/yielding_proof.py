"""Guaranteed envelope of a frame with one yielding storey, by branch and bound over three inputs.

The theory, "A yielding storey" in docs/theory/proofs.md, has the inequality that the bounds over a
sub-box rest on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from heapq import heappop, heappush

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.base.nature import rounded
from alphacut.base.number_text import engineering
from alphacut.base.progress_bar import Progress, is_enough
from alphacut.frame.bounds.interpolated_box import InterpolatedFrame
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import MAX_IMBALANCE, YieldingFlow
from alphacut.frame.methods.sampled import independent_points
from alphacut.frame.result import Ends, Envelope
from alphacut.frame.structures.quantities import of_storey_frame
from alphacut.frame.threshold import Threshold
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import corners

YIELDING_GAP = 0.01
"""Wanted gap of peaks by default, as a fraction of each (tuned: attained values come from corners
and midpoints of sub-boxes, so that closer gaps take many of them)."""
MIN_WIDTH = 2.0**-14
"""Width of a sub-box, as a fraction of that of the whole, at which further ones do not help."""
BISECTED = 0.8
"""Fraction of the work, as progress tells it, at which all sub-boxes are bisected."""
MAX_INPUTS = 3
"""Most inputs with a width: the number of sub-boxes grows as a power of theirs."""
ROOM = 1.5
"""Fraction that events that are left out may spend of the wanted gap, and of the distance of what
follows in a sub-box below the attained peak (tuned)."""
ROOM_TO_LIMIT = 1.5
"""The same of the distance of peaks from a limit (tuned: in the mean over the box, on whose parts
it counts, what is left out costs about a third of its largest cost)."""
SHOWN_RANGES = 3
"""Number of open sub-boxes that a message names."""


class OpenError(UnprovedError):
    """Parts of the box are not bounded; what is known of the others is in the message."""


def prove_yielding(
    flow: UnitFlow,
    name: str,
    gap: Array,
    *,
    budget: float,
    thresholds: Sequence[Threshold] = (),
    progress: Progress | None = None,
) -> Envelope:
    """Return the guaranteed envelope and peaks of a frame with one storey that yields.

    Args:
        flow: The response over the boxes of the inputs.
        name: Name of the method.
        gap: Wanted distance of guaranteed and attained peak of each output, in its unit, (m,).
        budget: Most sub-boxes on a level.
        thresholds: Limits of peaks. With them the effort goes to the question whether they hold,
            and not to the gaps.
        progress: Called with the completed fraction.

    Raises:
        UnprovedError: More or less than one storey yields; more than three inputs have a width; or
            the bounds are not finite within the budget. The message says what is known, where it
            is open, and which input to narrow.
        RefusedError: A trajectory does not exist.
        FailedError: An attained value exceeds a guaranteed bound: the proof is wrong.
    """
    yielding_flow = flow.flow
    assert isinstance(yielding_flow, YieldingFlow)
    boxes = flow.boxes
    frame = provable_frame(yielding_flow, boxes)
    influence = _influence(yielding_flow, boxes)
    levels: list[_Search] = []
    for row, tick in boxes.inside_out(progress):
        search = _Search(frame, boxes, row, gap, thresholds)
        if levels:  # a wider box contains what the narrower one attains
            search.take_over(levels[-1])
        search.run(budget, tick)
        search.test(boxes, row)
        levels.append(search)
    return _envelope(flow, name, levels[::-1], influence)


def provable_frame(flow: YieldingFlow, boxes: Boxes) -> InterpolatedFrame:
    """Return the frame whose peaks can be proved, with the way to bound it over a box.

    Raises:
        UnprovedError: More or less than one storey yields, or the frame is such that nothing is
            proved of it; or more than three inputs have a width, and the message says which one
            moves the response least.
    """
    active = np.flatnonzero(boxes.upper[0] > boxes.lower[0])
    frame = InterpolatedFrame(flow, active)
    if len(active) > MAX_INPUTS:
        influence = _influence(flow, boxes)
        weakest = boxes.names[active[influence[active].argmin()]]
        raise UnprovedError(
            f"{MAX_INPUTS} inputs of a storey that yields can be proved, not {len(active)}",
            f"take {weakest} as a crisp number: it moves the response least",
        )
    for point in _probes(boxes.lower[0], boxes.upper[0]):
        frame.require_provable(point)
    return frame


def _influence(flow: YieldingFlow, boxes: Boxes) -> Array:
    """Return by how much each input moves the response at the centre, shape (d,).

    It is the sum over the outputs of the largest change over time, as a fraction of the peak, by
    1 % of the width of the input on the widest level, times 100.
    """
    step = 0.01 * boxes.radius
    points = boxes.centre + np.vstack([np.diag(step), -np.diag(step), np.zeros_like(step)])
    values = flow.values(points)
    d = len(step)
    change = np.abs(values[:d] - values[d : 2 * d]).max(axis=1)
    peak = np.maximum(np.abs(values[-1]).max(axis=0), 1e-300)
    return np.asarray((change / peak).sum(axis=1) / 0.01)


@dataclass(frozen=True, eq=False)
class _SubBox:
    """A sub-box with its bounds.

    `low` and `high` are its ends in SI units, shape (d,); `axis` is the number of the input along
    which motions differ by an event, None if they do not. `upper` has the largest values of
    (−output, output) at time nodes and over the steps before them, shape (2, T, m, 2), and `peaks`
    the same over all times, shape (m, 2).
    """

    low: Array
    high: Array
    upper: Array
    peaks: Array
    axis: int | None

    @property
    def least(self) -> Array:
        """Lower bounds of the largest values of (−output, output) over time, shape (m, 2)."""
        # An output is at least minus the bound of its negative at each node.
        return np.asarray((-self.upper[0, :, :, ::-1]).max(axis=0))


_Open = tuple[float, int, _SubBox, Array, int]
"""An open sub-box in the heap: minus its score, its number, it, its largest magnitudes from each
time node on, and the input along which it is to be bisected."""


class _Search:
    """Branch and bound of the peaks on one level.

    A sub-box is closed when it says all that is asked (`is_closed`), else it is bisected along the
    input along which motions differ by an event, or else that which moves the outputs most over it.

    Attributes:
        upper: Guaranteed bounds over closed sub-boxes, at nodes and over steps, (2, T, m, 2).
        peaks: Guaranteed bounds of their peaks, shape (m, 2).
        min_peak: Lower bound of the peak magnitude of each output in them, shape (m,).
        attained: Largest values of trajectories, less their rounding, shape (T, m, 2).
        attained_at: Their inputs, in SI units, shape (T, m, 2, d).
        peak: Largest peak magnitude that a trajectory attains, shape (m,).
        peak_at: Its inputs, shape (m, d).
        least_peak: Smallest peak magnitude of a trajectory, shape (m,).
        least_peak_at: Its inputs, shape (m, d).
        count: Number of sub-boxes.
        open: Sub-boxes that were left when the effort ended.
        finite_peaks: Guaranteed bounds of peaks over sub-boxes that have them, shape (m, 2).
    """

    def __init__(
        self,
        frame: InterpolatedFrame,
        boxes: Boxes,
        row: int,
        gap: Array,
        thresholds: Sequence[Threshold],
    ) -> None:
        """Begin with the nominal trajectory.

        Args:
            frame: The frame.
            boxes: The boxes of all levels.
            row: Which level.
            gap: Wanted gap of the peak of each output, in its unit, shape (m,).
            thresholds: Limits of peaks, if they are what is asked.
        """
        self.gap = np.maximum(gap, 1e-300)
        self.frame = frame
        self.low = low = boxes.lower[row]
        self.high = high = boxes.upper[row]
        self.width = np.where(high > low, high - low, 1.0)
        outputs = list(map(str, frame.flow.outputs))
        self.alpha = float(boxes.alpha[row])
        self.is_to_limits = bool(thresholds)
        self.thresholds = [(outputs.index(x.output), x) for x in thresholds]
        m = len(outputs)
        d = len(low)
        shape = (len(frame.flow.time), m, 2)
        self.upper = np.full((2, *shape), -np.inf)
        self.peaks = np.full((m, 2), -np.inf)
        self.min_peak = np.full(m, np.inf)
        self.attained = np.full(shape, -np.inf)
        self.attained_at = np.zeros((*shape, d))
        self.peak = np.full(m, -np.inf)
        self.peak_at = np.zeros((m, d))
        self.least_peak = np.full(m, np.inf)
        self.least_peak_at = np.zeros((m, d))
        # smallest and largest peak of trajectories that each threshold compares
        self.seen = np.tile([np.inf, -np.inf], (len(self.thresholds), 1))
        self.count = 0
        self.trajectories = 0
        self.open: list[_SubBox] = []
        self.finite_peaks = np.full((m, 2), -np.inf)
        self.attain(boxes.nominal[np.newaxis])

    def take_over(self, narrower: _Search) -> None:
        """Take over, in place, what trajectories of a narrower level attain."""
        better = narrower.attained > self.attained
        self.attained[better] = narrower.attained[better]
        self.attained_at[better] = narrower.attained_at[better]
        higher = narrower.peak > self.peak
        self.peak[higher] = narrower.peak[higher]
        self.peak_at[higher] = narrower.peak_at[higher]
        lower = narrower.least_peak < self.least_peak
        self.least_peak[lower] = narrower.least_peak[lower]
        self.least_peak_at[lower] = narrower.least_peak_at[lower]
        self.seen[:, 0] = np.minimum(self.seen[:, 0], narrower.seen[:, 0])
        self.seen[:, 1] = np.maximum(self.seen[:, 1], narrower.seen[:, 1])

    def run(self, budget: float, progress: Progress) -> None:
        """Bound sub-boxes until all are closed, or the budget is spent; see the class.

        Args:
            budget: Most sub-boxes.
            progress: Called with the completed fraction; ends the effort by an EnoughError.

        Raises:
            UnprovedError: A quantity that must be positive may not be so over any sub-box.
        """
        # Sub-boxes that have no bounds come first, the widest ones before others, and then those
        # that are farthest from an answer.
        heap: list[_Open] = []
        allowed = self._allowed(self._explore(self.low, self.high)[0])
        self._add(heap, self._bounded(self.low, self.high, allowed))
        while heap and self.count < budget:
            _, _, box, later, axis = heappop(heap)
            if self.is_closed(box):  # as attained values have risen since
                self._close(box)
                continue
            if box.high[axis] - box.low[axis] < MIN_WIDTH * self.width[axis]:
                self.open.append(box)
                continue
            allowed = self._allowed(later)
            for low, high in _halves(box, axis):
                self._add(heap, self._bounded(low, high, allowed, box))
            if is_enough(progress, BISECTED * self.count / budget):
                break
        self._bound_roughly([*self.open, *(box for _, _, box, _, _ in heap)], progress)

    def _bound_roughly(self, left: list[_SubBox], progress: Progress) -> None:
        """Bound sub-boxes for which no plan succeeds without one, and keep all as the open ones.

        Those that have no such bounds either are bisected, up to as many as there were sub-boxes.
        """
        self.open = []
        most = self.count + 2 * len(left)
        while left:
            box = left.pop(0)
            if not np.isfinite(box.peaks).all() and self.count < most:
                box = self._bounded(box.low, box.high, None, box)
                if not np.isfinite(box.peaks).all():
                    parts = (box.high - box.low) / self.width
                    axis = int(parts.argmax()) if box.axis is None else box.axis
                    left += [replace(box, low=x, high=y) for x, y in _halves(box, axis)]
                    continue
            self.open.append(box)
            done = len(self.open) / (len(self.open) + len(left))
            is_enough(progress, BISECTED + (1 - BISECTED) * done)

    def is_closed(self, box: _SubBox) -> bool:
        """Return whether a sub-box says all that is asked.

        A threshold is answered by a sub-box whose bounds keep it or exceed it everywhere, and on
        the whole level by two trajectories, one that keeps and one that exceeds it. Finite bounds
        suffice where all thresholds are answered. Without thresholds the peaks must be within the
        wanted gap of the attained ones.
        """
        return self._score(box) <= 1

    def test(self, boxes: Boxes, level: int) -> None:
        """Compare the bounds with trajectories at points that no sub-box has used.

        Raises:
            FailedError: An attained value exceeds a guaranteed bound: the proof is wrong.
        """
        for box in self.open:
            self._close(box)
        self.attain(boxes.to_physical(independent_points(boxes, level)))
        excess = self.attained - self.upper[0]
        peaks = np.maximum(self.peaks.max(axis=1), 0.0)
        if (excess > 0).any() or (self.peak > peaks).any():
            worst = max(float(excess.max()), float((self.peak - peaks).max()))
            what = f"a response lies outside the proved bounds by {worst:.3g}"
            raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")

    @property
    def closed_fraction(self) -> float:
        """Fraction of the box that is closed."""
        active = self.high > self.low
        total = np.prod((self.high - self.low)[active])
        left = sum(float(np.prod((x.high - x.low)[active])) for x in self.open)
        return float(1 - left / total)

    def open_ranges(self, names: Sequence[str]) -> str:
        """Name the ranges of inputs that are open, in their units; empty if there are none."""
        active = np.flatnonzero(self.high > self.low)
        if not self.open:
            return ""
        low = np.min([x.low for x in self.open], axis=0)
        high = np.max([x.high for x in self.open], axis=0)
        shown = [(x.low, x.high) for x in self.open]
        if len(shown) > SHOWN_RANGES:
            shown = [(low, high)]
        texts = []
        for begin, end in shown:
            ranges = []
            for i in active:
                unit = of_storey_frame(names[i]).unit
                lower, upper = (engineering(x, unit, digits=5) for x in (begin[i], end[i]))
                ranges.append(f"{names[i]} from {lower} to {upper}")
            texts.append(" and ".join(ranges))
        within = "within " if len(self.open) > SHOWN_RANGES else ""
        return within + "; ".join(texts)

    def _allowed(self, later: Array) -> Array | None:
        """Return by how much left-out events may widen the outputs over a sub-box, in their units.

        It is a fraction of the distance to the wanted gap above the attained peak, or to the limit.

        Args:
            later: Largest magnitudes in the sub-box from each time node on, shape (T, m).

        Returns:
            From each time node on, shape (T, m); None where all limits are answered, so that any
            finite bounds suffice.
        """
        to_gap = ROOM * (self.gap + np.maximum(self.peak - later, 0.0))
        to_gap[:, later[0] == 0] = np.inf  # what stays at rest
        if not self.is_to_limits:
            return np.asarray(to_gap)
        left = self._left()
        allowed = np.full_like(later, np.inf)
        for column, threshold in left:
            of_column = to_gap[:, column]
            if threshold.value is not None:
                of_column = ROOM_TO_LIMIT * np.abs(threshold.value - later[:, column])
            allowed[:, column] = np.minimum(allowed[:, column], of_column)
        return allowed if left else None

    def _explore(self, low: Array, high: Array) -> tuple[Array, int]:
        """Attain the motions at midpoint and corners of a sub-box.

        Returns:
            Largest magnitudes of each output from each time node on, shape (T, m), and the input
            that moves the outputs most over the sub-box, in the sum over time.
        """
        points = _probes(low, high)
        values = self.attain(points)
        later = np.maximum.accumulate(np.abs(values).max(axis=0)[::-1])[::-1]
        # Points are in the order of their inputs, so that ends of edges are in one order, too.
        above, below = points > (low + high) / 2, points < (low + high) / 2
        moved = [
            np.abs(values[x] - values[y]).sum(axis=(0, 1))
            for x, y in zip(above.T, below.T, strict=True)
        ]
        return later, int((moved / np.maximum(later[0], 1e-300)).sum(axis=1).argmax())

    def _bounded(
        self, low: Array, high: Array, allowed: Array | None, parent: _SubBox | None = None
    ) -> _SubBox:
        """Return a sub-box with its bounds, which are at most those of its parent."""
        self.count += 1
        try:
            found = self.frame.bounds(low, high, allowed)
        except UnprovedError:  # what must be positive may be so on narrower boxes
            found = self.frame.infinite
        upper = np.stack([found.upper, found.steps])
        peaks = found.peaks
        if parent is not None:
            upper = np.minimum(upper, parent.upper)
            peaks = np.minimum(peaks, parent.peaks)
        return _SubBox(low, high, upper, peaks, found.axis)

    def _add(self, heap: list[_Open], box: _SubBox) -> None:
        """Close a sub-box if its bounds suffice, and else add it to the heap."""
        if not self.is_closed(box):
            later, axis = self._explore(box.low, box.high)
            if box.axis is not None:
                axis = box.axis
        if self.is_closed(box):
            self._close(box)
        else:
            heappush(heap, (-self._score(box), self.count, box, later, axis))

    def _score(self, box: _SubBox) -> float:
        """Return how far a sub-box is from an answer: above 1 where it is open."""
        if not np.isfinite(box.peaks).all():
            return np.inf
        gaps = (box.peaks.max(axis=1) - self.peak) / self.gap
        if not self.is_to_limits:
            return float(gaps.max(initial=0.0))
        score = 0.0
        for column, threshold in self._left():
            limit = threshold.value
            if limit is None:
                score = max(score, float(gaps[column]))
                continue
            keeps = threshold.peak(box.peaks[column]) <= limit
            exceeds = threshold.peak(box.least[column]) > limit
            if not (keeps or exceeds):
                score = max(score, 1 + float(threshold.peak(box.peaks[column]) - limit))
        return score

    def _left(self) -> list[tuple[int, Threshold]]:
        """Return the thresholds, with their outputs, that no two trajectories answer."""
        left = []
        for (column, threshold), (least, most) in zip(self.thresholds, self.seen, strict=True):
            limit = threshold.value
            is_seen = limit is not None and least <= limit < most
            if not is_seen and threshold.answered < self.alpha:
                left.append((column, threshold))
        return left

    def _close(self, box: _SubBox) -> None:
        """Add the bounds of a sub-box to those of the level."""
        self.upper = np.maximum(self.upper, box.upper)
        self.peaks = np.maximum(self.peaks, box.peaks)
        if np.isfinite(box.peaks).all():
            self.finite_peaks = np.maximum(self.finite_peaks, box.peaks)
        # A magnitude is at least the distance of the bounds at a node from zero.
        least = np.maximum(-box.upper[0], 0.0).max(axis=(0, 2))
        self.min_peak = np.minimum(self.min_peak, least)

    def attain(self, points: Array) -> Array:
        """Raise attained values by the trajectories at points in SI units, shape (points, d).

        Returns:
            The trajectories, shape (points, T, m).
        """
        values, peaks = self.frame.flow.values_and_peaks(points)
        self.trajectories += len(points)
        # A trajectory is exact but for rounding, which the balance of its energy bounds.
        rounding = MAX_IMBALANCE * np.abs(values).max(axis=1)[:, np.newaxis, :, np.newaxis]
        signed = np.stack([-values, values], axis=-1) - rounding
        best = signed.argmax(axis=0)
        value = np.take_along_axis(signed, best[np.newaxis], axis=0)[0]
        better = value > self.attained
        self.attained[better] = value[better]
        self.attained_at[better] = points[best[better]]
        columns = np.arange(peaks.shape[1])
        for better_than, chosen, kept, kept_at in (
            (np.greater, peaks.argmax(axis=0), self.peak, self.peak_at),
            (np.less, peaks.argmin(axis=0), self.least_peak, self.least_peak_at),
        ):
            found = peaks[chosen, columns] * (1 - MAX_IMBALANCE)
            is_better = better_than(found, kept)
            kept[is_better] = found[is_better]
            kept_at[is_better] = points[chosen[is_better]]
        for (column, threshold), seen in zip(self.thresholds, self.seen, strict=True):
            least, most = known_peaks(threshold, values[:, :, column], peaks[:, column])
            seen[0] = min(seen[0], most.min())
            seen[1] = max(seen[1], least.max())
        return values


def known_peaks(threshold: Threshold, values: Array, peaks: Array) -> Array:
    """Return the least and the most that a threshold's peaks of trajectories can be, shape (2, S).

    Args:
        threshold: The threshold.
        values: Its output at time nodes, shape (S, T).
        peaks: Largest magnitudes over time, shape (S,).
    """
    # A trajectory is exact but for rounding, which the balance of its energy bounds.
    if threshold.side is None:
        return np.asarray(peaks * np.array([[1 - MAX_IMBALANCE], [1 + MAX_IMBALANCE]]))
    # Between the nodes of a side there may be more, so that nothing is known to keep the limit.
    outwards = values if threshold.side else -values
    least = outwards.max(axis=1) - MAX_IMBALANCE * np.abs(values).max(axis=1)
    return np.stack([least, np.full(len(peaks), np.inf)])


def _halves(box: _SubBox, axis: int) -> list[tuple[Array, Array]]:
    """Return the ends of the two halves of a sub-box along an input."""
    low, high = box.low.copy(), box.high.copy()
    low[axis] = high[axis] = (box.low[axis] + box.high[axis]) / 2
    return [(box.low, high), (low, box.high)]


def _probes(low: Array, high: Array) -> Array:
    """Return the midpoint and the corners of a box, shape (points, d), without repetitions."""
    return np.asarray(np.unique(np.vstack([(low + high) / 2, corners(low, high)]), axis=0))


def _envelope(flow: UnitFlow, name: str, levels: list[_Search], influence: Array) -> Envelope:
    """Return the envelope of all levels, from the widest on.

    Raises:
        UnprovedError: A bound is infinite.
        FailedError: An attained value exceeds a guaranteed bound.
    """
    upper = np.minimum.accumulate(np.stack([x.upper[0] for x in levels]), axis=0)
    steps = np.stack([x.upper[1] for x in levels])
    peaks = np.stack([x.peaks.max(axis=1) for x in levels])
    peaks = np.minimum.accumulate(peaks, axis=0)
    strongest = flow.boxes.names[int(influence.argmax())]
    if not np.isfinite(upper).all() or not np.isfinite(peaks).all():
        raise OpenError(_what_is_known(flow, levels[0]), f"narrow {strongest} first")
    attained = np.stack([x.attained for x in levels])
    at = np.stack([x.attained_at for x in levels])
    reached = np.stack([x.peak for x in levels])
    # The gap of an output that stays at rest has no peak that it could be a fraction of.
    scale = np.where(flow.at_rest, flow.peak, np.maximum(peaks, 1e-300))
    gap = float(((peaks - reached) / scale).max())
    nature = Nature.GUARANTEED
    # The largest excess over the ends of a step of both sides, on all levels.
    ends = np.maximum(upper, np.concatenate([upper[:, :1], upper[:, :-1]], axis=1))
    between = np.maximum((steps - ends).max(axis=(0, 3)), 0.0)
    searched = Bounds(
        alpha=flow.boxes.alpha,
        lower=np.maximum.accumulate(np.stack([x.min_peak for x in levels]), axis=0),
        upper=peaks,
        lower_at=np.stack([x.least_peak_at for x in levels]),
        upper_at=np.stack([x.peak_at for x in levels]),
        error=np.maximum(peaks - reached, 0.0),
        nature=nature,
        natures=(nature,) * len(flow.outputs),
        outputs=tuple(map(str, flow.outputs)),
        inputs=flow.boxes.inputs,
        method=name,
        units=flow.units,
        inner=Ends(np.stack([x.least_peak for x in levels]), reached),
    )
    counts = sum(x.count for x in levels)
    notes = [f"{counts} sub-boxes prove peaks within {gap:.2g} of attained ones"]
    if levels[0].is_to_limits:
        notes = [f"{counts} sub-boxes; peaks are not sought closer than their limits ask"]
    closed = levels[0].closed_fraction
    if levels[0].open:
        ranges = levels[0].open_ranges(flow.boxes.names)
        notes.append(f"{100 * closed:.3g} % of the box is closed; open is {ranges}")
    if gap > YIELDING_GAP and not levels[0].is_to_limits:
        notes.append(f"narrow {strongest} first, which moves the response most")
    return flow.envelope(
        upper,
        at,
        np.maximum((upper - attained).max(axis=-1), 0.0),
        method=name,
        nature=nature,
        basis=("the equations of motion hold",),
        inner=Ends(-attained[..., 0], attained[..., 1]),
        between=between,
        searched_peaks=searched,
        evaluations=sum(x.trajectories for x in levels),
        facts={
            "gap_of_peaks": gap,
            "boxes": float(counts),
            "closed_fraction": closed,
            "sought_to_limits": float(levels[0].is_to_limits),
            "motions_tested": sum(x.trajectories for x in levels),
        },
        notes=tuple(notes),
    )


def _what_is_known(flow: UnitFlow, search: _Search) -> str:
    """Say what is proved of the part of a box that is closed, and which one is open."""
    found = [x for x in search.open if np.isfinite(x.peaks).all()]
    unknown = [x for x in search.open if not np.isfinite(x.peaks).all()]
    search.open = unknown
    what = f"{search.count} sub-boxes do not bound all orders of events"
    ranges = search.open_ranges(flow.boxes.names)
    bounded = search.closed_fraction
    if not np.isfinite(search.finite_peaks).all():
        return f"{what}; open is {ranges}"
    peaks = np.maximum.reduce([search.finite_peaks, *[x.peaks for x in found]]).max(axis=1)
    upwards = [rounded(peak, "upper", Nature.GUARANTEED, 5) for peak in peaks]
    texts = [
        f"{name} ≤ {engineering(peak, unit, digits=5)}"
        for name, unit, peak in zip(flow.flow.outputs, flow.units, upwards, strict=True)
    ]
    of_box = f"over {100 * bounded:.3g} % of the box {', '.join(texts)}"
    return f"{what}; guaranteed {of_box}; open is {ranges}"
