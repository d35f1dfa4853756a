"""Guaranteed envelope of one yielding storey, by branch and bound over up to three inputs.

`frame.bounds.yielding_element` has the inequality that the bounds over a sub-box rest on.
"""

from __future__ import annotations

from dataclasses import dataclass
from heapq import heappop, heappush

import numpy as np

from alphacut.base.arrays import Array
from alphacut.base.errors import FailedError
from alphacut.base.progress_bar import Progress
from alphacut.frame.bounds.yielding_box import MAX_ERROR, YieldingStorey
from alphacut.frame.boxes import Boxes, UnitFlow
from alphacut.frame.calculus.unproved import UnprovedError
from alphacut.frame.dynamics.yielding import MAX_IMBALANCE, YieldingFlow
from alphacut.frame.methods.sampled import independent_points
from alphacut.frame.result import Ends, Envelope
from alphacut.fuzzy.result import Bounds, Nature
from alphacut.fuzzy.sets.boxes import corners

YIELDING_GAP = 0.01
"""Wanted gap of peaks by default, as a fraction of each (tuned: attained values come from corners
and midpoints of sub-boxes, so that closer gaps take many of them)."""
MIN_WIDTH = 2.0**-14
"""Width of a sub-box, as a fraction of that of the whole, at which further ones do not help."""
MAX_INPUTS = 3
"""Most inputs with a width: the number of sub-boxes grows as a power of theirs."""


def prove_yielding(
    flow: UnitFlow, name: str, gap: Array, *, budget: float, progress: Progress | None = None
) -> Envelope:
    """Return the guaranteed envelope and peaks of one storey that yields.

    Args:
        flow: The response over the boxes of the inputs.
        name: Name of the method.
        gap: Wanted distance of guaranteed and attained peak of each output, in its unit, (m,).
        budget: Most sub-boxes on a level.
        progress: Called with the completed fraction.

    Raises:
        UnprovedError: There is more than one storey; more than three inputs have a width; or the
            bounds are not finite within the budget. The message says which input to narrow.
        RefusedError: A trajectory does not exist.
        FailedError: An attained value exceeds a guaranteed bound: the proof is wrong.
    """
    yielding_flow = flow.flow
    assert isinstance(yielding_flow, YieldingFlow)
    boxes = flow.boxes
    storey = provable_storey(yielding_flow, boxes)
    influence = _influence(yielding_flow, boxes)
    levels: list[_Search] = []
    for row, tick in boxes.inside_out(progress):
        search = _Search(storey, influence, boxes.lower[row], boxes.upper[row], gap)
        if levels:  # a wider box contains what the narrower one attains
            search.take_over(levels[-1])
        search.run(budget, tick)
        search.test(boxes, row)
        levels.append(search)
    return _envelope(flow, name, levels[::-1], influence)


def provable_storey(flow: YieldingFlow, boxes: Boxes) -> YieldingStorey:
    """Return the storey whose peaks can be proved.

    Raises:
        UnprovedError: There is more than one storey, or it is such that nothing is proved of it; or
            more than three inputs have a width, and the message says which one moves the response
            least.
    """
    active = np.flatnonzero(boxes.upper[0] > boxes.lower[0])
    storey = YieldingStorey(flow, active)
    if len(active) > MAX_INPUTS:
        influence = _influence(flow, boxes)
        weakest = boxes.names[active[influence[active].argmin()]]
        raise UnprovedError(
            f"{MAX_INPUTS} inputs of a storey that yields can be proved, not {len(active)}",
            f"take {weakest} as a crisp number: it moves the response least",
        )
    return storey


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

    `low` and `high` are its ends in SI units, shape (d,). `upper` has the largest values of
    (−output, output) at time nodes and over the steps before them, shape (2, T, m, 2), and `peaks`
    the same over all times, shape (m, 2). `error` bounds the error in the energy norm, in m/s.
    """

    low: Array
    high: Array
    upper: Array
    peaks: Array
    error: float


class _Search:
    """Branch and bound of the peaks on one level.

    A sub-box is closed when its peaks exceed the attained ones by no more than the tolerance and
    its error is small, else it is bisected along the input that moves the response most over it.

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
    """

    def __init__(
        self, storey: YieldingStorey, influence: Array, low: Array, high: Array, gap: Array
    ) -> None:
        """Begin with the trajectories at corners and centre of the box of a level.

        Args:
            storey: The storey.
            influence: By how much each input moves the response, shape (d,).
            low: Lower ends of the box, in SI units, shape (d,).
            high: Upper ends.
            gap: Wanted gap of the peak of each output, in its unit, shape (m,).
        """
        self.gap = np.maximum(gap, 1e-300)
        self.storey = storey
        self.influence = influence
        self.low = low
        self.high = high
        self.width = np.where(high > low, high - low, 1.0)
        m = len(storey.flow.outputs)
        d = len(low)
        shape = (len(storey.flow.time), m, 2)
        self.upper = np.full((2, *shape), -np.inf)
        self.peaks = np.full((m, 2), -np.inf)
        self.min_peak = np.full(m, np.inf)
        self.attained = np.full(shape, -np.inf)
        self.attained_at = np.zeros((*shape, d))
        self.peak = np.full(m, -np.inf)
        self.peak_at = np.zeros((m, d))
        self.least_peak = np.full(m, np.inf)
        self.least_peak_at = np.zeros((m, d))
        self.count = 0
        self.trajectories = 0
        self._attain(_probes(low, high))

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

    def run(self, budget: float, progress: Progress) -> None:
        """Bound sub-boxes until all are closed, or the budget is spent; see the class.

        Args:
            budget: Most sub-boxes.
            progress: Called with the completed fraction.

        Raises:
            UnprovedError: A quantity that must be positive may not be so over a sub-box.
        """
        heap: list[tuple[float, int, _SubBox]] = []
        self._add(heap, self._bounded(self.low, self.high, None))
        while heap and self.count < budget:
            _, _, box = heappop(heap)
            if self._score(box) <= 1:  # as attained values have risen since
                self._close(box)
                continue
            axis = int((self.influence * (box.high - box.low) / self.width).argmax())
            middle = (box.low[axis] + box.high[axis]) / 2
            if box.high[axis] - box.low[axis] < MIN_WIDTH * self.width[axis]:
                self._close(box)
                break
            for is_above in (False, True):
                low = box.low.copy()
                high = box.high.copy()
                if is_above:
                    low[axis] = middle
                else:
                    high[axis] = middle
                self._add(heap, self._bounded(low, high, box))
            progress(self.count / budget)
        for _, _, box in heap:
            self._close(box)

    def test(self, boxes: Boxes, level: int) -> None:
        """Compare the bounds with trajectories at points that no sub-box has used.

        Raises:
            FailedError: An attained value exceeds a guaranteed bound: the proof is wrong.
        """
        self._attain(boxes.to_physical(independent_points(boxes, level)))
        excess = self.attained - self.upper[0]
        peaks = np.maximum(self.peaks.max(axis=1), 0.0)
        if (excess > 0).any() or (self.peak > peaks).any():
            worst = max(float(excess.max()), float((self.peak - peaks).max()))
            what = f"a response lies outside the proved bounds by {worst:.3g}"
            raise FailedError(f"the proof is wrong: {what}", "keep the case and report it")

    def _bounded(self, low: Array, high: Array, parent: _SubBox | None) -> _SubBox:
        """Return a sub-box with its bounds, which are at most those of its parent."""
        found = self.storey.bounds(low, high)
        upper = np.stack([found.upper, found.steps])
        peaks = found.peaks
        self.count += 1
        if parent is not None:
            upper = np.minimum(upper, parent.upper)
            peaks = np.minimum(peaks, parent.peaks)
        return _SubBox(low, high, upper, peaks, found.error)

    def _add(self, heap: list[tuple[float, int, _SubBox]], box: _SubBox) -> None:
        """Close a sub-box if its bounds suffice, and else add it to the heap, the widest first."""
        if self._score(box) > 1:
            self._attain(_probes(box.low, box.high))
        score = self._score(box)
        if score <= 1:
            self._close(box)
        else:
            heappush(heap, (-score, self.count, box))

    def _score(self, box: _SubBox) -> float:
        """Return the largest gap of a peak over the wanted one; above 1 also for wide errors."""
        gap = (box.peaks.max(axis=1) - self.peak) / self.gap
        # A large error makes bounds at time nodes wide, even where no peak lies.
        wide = box.error / (0.1 * MAX_ERROR * self.storey.yield_velocity)
        return float(max(gap.max(initial=0.0), wide))

    def _close(self, box: _SubBox) -> None:
        """Add the bounds of a sub-box to those of the level."""
        self.upper = np.maximum(self.upper, box.upper)
        self.peaks = np.maximum(self.peaks, box.peaks)
        # A magnitude is at least the distance of the bounds at a node from zero.
        least = np.maximum(-box.upper[0], 0.0).max(axis=(0, 2))
        self.min_peak = np.minimum(self.min_peak, least)

    def _attain(self, points: Array) -> None:
        """Raise attained values by the trajectories at points in SI units, shape (points, d)."""
        values, peaks = self.storey.flow.values_and_peaks(points)
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
        what = f"{levels[0].count} sub-boxes do not bound all orders of events"
        raise UnprovedError(what, f"narrow {strongest}, which moves the response most")
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
    if gap > YIELDING_GAP:
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
            "motions_tested": sum(x.trajectories for x in levels),
        },
        notes=tuple(notes),
    )
