"""Graph Follower in rounds: Taylor models of all nodes propose graphs in batches.

The same idea as `graph_follower` (storage, Taylor models, tolerance, post-processing), turned
around: instead of one node after the other, every round asks the models of the best graphs at all
nodes, takes the proposal of largest predicted gain in each window of time, and advances these
graphs together as arrays. Nodes before and after a discovery profit alike, which is what backward
sweeps are for; the points spread at the start look for basins independently of any model.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import global_maximum, local_maximum
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.graph_storage import Places, Storage
from alphacut.frame.methods.independent import SAFETY, independent_excess, trajectories_diverge
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress, subprogress
from alphacut.fuzzy.refused import checked_number
from alphacut.fuzzy.result import Nature
from alphacut.fuzzy.sets.boxes import chebyshev_points

MAX_NUMBERS = 64e6
"""Most numbers of Taylor models computed at a time: 512 MB."""
BATCH = 32
"""Graphs computed together."""
MAX_GLOBAL_INPUTS = 4
"""Inputs up to which Taylor models are maximised globally."""
REACH = 0.6
"""Trust region of a Taylor model, as a share of the half width of the box."""
TRIES = 40
"""Proposals looked at per window of time."""
SPACING = 0.02
"""Distance in unit coordinates between graphs of one batch."""
SPREAD = 64
"""Graphs on a spread of points per level that start the search."""
SEED_STEP = 100_003
"""Points of the sequence between those that two seeds spread."""


@dataclass(frozen=True)
class ImprovedFollower:
    """The method and its switches.

    Args:
        tolerance: Predicted gain above which a new graph is computed, as a share of each
            output's peak, or in the unit of the first displacement (the first output without one)
            where the envelope is not relative.
        budget: Most graphs over all levels.
        seed: Which points are spread.

    Raises:
        RefusedError: A switch is out of its range.

    Example:
        >>> from alphacut.frame import StoreyFrame, envelope
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> inputs = {"m1": Triangular(900, 1000, 1100)}
        >>> str(envelope(frame, inputs, ImprovedFollower(), duration=0.5, step=0.1).nature)
        'estimated'
    """

    name: ClassVar[str] = "improved-graph-follower"
    tolerance: float = 7e-4
    budget: int = 5000
    seed: int = 0

    def __post_init__(self) -> None:
        checked_number("tolerance", self.tolerance, positive=True)
        checked_number("budget", self.budget, whole=True, least=1)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope of two passes from different points, with an estimated error.

        The error is twice what the Taylor models still predict and what an independent sample finds
        beyond the bounds, and twice the difference of the two passes. Where neighbouring
        trajectories diverge there is none, and the bounds are attained only.
        """
        start_time, second_pass = time.perf_counter(), replace(self, seed=self.seed + 1)
        first = self.run_pass(flow, subprogress(progress, 0.0, 0.4))
        second = second_pass.run_pass(flow, subprogress(progress, 0.4, 0.8))
        better = second.bounds > first.bounds
        bounds = np.where(better, second.bounds, first.bounds)
        points = np.where(better[..., None], second.points, first.points)
        missed, count = independent_excess(flow, bounds, subprogress(progress, 0.8, 1.0))
        steepest = np.maximum(first.storage.steepest, second.storage.steepest)
        diverges = trajectories_diverge(steepest, bounds[0])
        limit = self.tolerance * flow.scale[:, None]
        is_stopped = any((x.predicted_gain > limit).any() for x in (first, second))
        note = f"stopped at the budget of {self.budget} trajectories"
        return flow.envelope(
            bounds,
            points,
            None if diverges else self._error(first, second, missed, flow.scale),
            method=self.name,
            nature=Nature.ATTAINED if diverges else Nature.ESTIMATED,
            evaluations=len(first.storage) + len(second.storage) + count,
            seconds=time.perf_counter() - start_time,
            facts={"gain": self.tolerance, "order": 2},
            notes=(note,) if is_stopped else (),
        )

    def _error(self, first: PassBounds, second: PassBounds, missed: Array, scale: Array) -> Array:
        """Return the estimated error of the better bounds of two passes, shape (A, T, m).

        Args:
            first: Bounds of one pass, with the gain (A, T, m, 2) that models still predict.
            second: Those of the other.
            missed: How far an independent sample exceeds the bounds, shape (A, m).
            scale: Factor of each output from a tolerance to the allowed error, shape (m,).
        """
        gains, limit = [first.predicted_gain, second.predicted_gain], self.tolerance * scale
        small = [np.where(gain <= limit[:, None], gain, 0.0) for gain in gains]
        # gains above the tolerance, which remain where the budget ended a pass, come on top
        large = [np.where(gain > limit[:, None], gain, 0.0) for gain in gains]
        predicted = np.maximum(*small) + np.maximum(*large)
        difference = smoothed_maximum(np.abs(second.bounds - first.bounds).max(-1))
        total_error = predicted.max(-1) + limit / 2 + difference + missed[:, None]
        return np.asarray(SAFETY * total_error)

    def run_pass(self, flow: UnitFlow, progress: Progress) -> PassBounds:
        """Return the bounds of one pass on all levels, from the narrowest box to the widest."""
        levels, storage = len(flow.boxes.alpha), Storage(flow)
        d, places = len(flow.boxes.names), storage.top.size // 2
        bounds, gains = np.zeros((2, levels, *storage.top.shape))
        out = PassBounds(bounds, np.zeros((*bounds.shape, d)), gains, storage)
        chunk_size = int(np.clip(MAX_NUMBERS / (places * (1 + d + d * d)), 1, BATCH))
        for done, level in enumerate(reversed(range(levels))):
            search = _Level(storage, flow.boxes.unit(level), self.tolerance)
            tick = subprogress(progress, done / levels, (done + 1) / levels)
            # graphs at the end of the level, at most, and at its beginning
            limit, first = self.budget * (done + 1) // levels, len(storage)
            points = self._start(storage, *search.box)[: max(1, limit - len(storage))]
            while len(points):
                for chunk in np.array_split(points, -(-len(points) // chunk_size)):
                    search.predict(storage.add(chunk))
                    tick(min(1.0, (len(storage) - first) / max(1, limit - first)))
                points = search.proposals(min(BATCH, limit - len(storage)))
            # post-processing of the level
            out.bounds[level], out.points[level] = storage.top, storage.points[storage.best]
            out.predicted_gain[level] = np.maximum(search.predicted - storage.top, 0.0)
        return out

    def _start(self, storage: Storage, lower: Array, upper: Array) -> Array:
        """Return the first unit coordinates of a level, nominal and spread ones, shape (S, d)."""
        boxes = storage.flow.boxes
        nominal = boxes.to_unit(boxes.modal)[None]
        if not (upper > lower).any():  # no other points, and none once it is stored
            return nominal[:0] if len(storage) else nominal
        middle, half = (lower + upper) / 2, (upper - lower) / 2
        # points of the sequence that no other level and no other seed takes
        skip = 1 + len(storage) + SEED_STEP * self.seed
        spread = chebyshev_points(len(lower), SPREAD, skip=skip)
        return np.vstack([nominal, middle + half * spread])


@dataclass(frozen=True, eq=False)
class PassBounds:
    """Bounds of one pass, and the graphs (trajectories) behind them.

    Args:
        bounds: Attained bounds of (−output, output), shape (A, T, m, 2).
        points: Their unit coordinates, shape (A, T, m, 2, d).
        predicted_gain: Gain over the bounds that the models still predict, shape (A, T, m, 2);
            more than the tolerance where the budget ended the search.
        storage: All graphs.
    """

    bounds: Array
    points: Array
    predicted_gain: Array
    storage: Storage


class _Level:
    """Predictions of the stored graphs' Taylor models in one box, by place (T, m, 2).

    Attributes:
        predicted: Predicted values of (−output, output), shape (T, m, 2).
        target: Their unit coordinates, shape (T, m, 2, d).
    """

    def __init__(self, storage: Storage, box: tuple[Array, Array], tolerance: float) -> None:
        self.storage, self.box, self.tolerance = storage, box, tolerance
        self.reach = REACH * np.maximum((box[1] - box[0]) / 2, 1e-300)
        self.predicted = storage.top.copy()
        self.target = np.zeros((*storage.top.shape, len(box[0])))
        if len(storage):
            self.predict(tuple(np.indices(storage.top.shape).reshape(3, -1)))

    def predict(self, places: Places) -> None:
        """Set the predictions at places from the Taylor models of the best graphs there."""
        if len(places[0]) and (self.box[1] > self.box[0]).any():
            maximise = global_maximum if len(self.box[0]) <= MAX_GLOBAL_INPUTS else local_maximum
            optima = self.storage.predicted(places, self.box, maximise, reach=self.reach)
            self.predicted[places], self.target[places] = optima

    def proposals(self, count: int) -> Array:
        """Return the points of largest predicted gain, one per window of time, (≤ count, d).

        A gain must exceed the tolerance; points near stored or other new ones are left out.
        """
        chosen, top = list[Array](), self.storage.top
        windows = np.array_split(np.arange(len(top)), max(1, min(count, len(top))))
        for window in windows:
            gains = (self.predicted - top)[window] / self.storage.flow.scale[:, None]
            for k in np.argsort(-gains, axis=None)[:TRIES]:
                t, o, side = np.unravel_index(k, gains.shape)
                entry = (window[t], o, side)
                if gains[t, o, side] <= self.tolerance:
                    break
                point = np.clip(self.target[entry], *self.box)
                if self.storage.holds(point, near=1e-7):
                    self.predicted[entry] = top[entry]  # the model was wrong
                elif all(np.abs(point - neighbour).max() > SPACING for neighbour in chosen):
                    chosen.append(point)
                    break
        return np.array(chosen)[:count].reshape(-1, len(self.box[0]))


def smoothed_maximum(gap: Array) -> Array:
    """Return the largest of values (A, T, m) over T/20 nodes around, at least a tenth of all."""
    from scipy.ndimage import maximum_filter1d

    near = maximum_filter1d(gap, 2 * (gap.shape[1] // 40) + 1, axis=1)
    return np.asarray(np.maximum(near, 0.1 * gap.max(1, keepdims=True)))
