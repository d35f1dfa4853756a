"""Graph Follower in rounds: Taylor models of all nodes propose graphs in batches.

The same idea as `graph_follower` (storage, Taylor models, tolerance, post-processing), turned
around: instead of one node after the other, every round asks the models of the best graphs at all
nodes, takes the proposal of largest predicted gain in each window of time, and advances these
graphs together as arrays. Nodes before and after a discovery profit alike, which is what backward
sweeps are for; the points spread at the start look for basins independently of any model. With many
inputs basins are also looked for among crossings: optima of some nodes with a few inputs of others.
Peaks, which are read more than other nodes, are followed to a smaller gain.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isqrt
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Mask
from alphacut.base.errors import checked_number
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import global_maximum, local_maximum
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.graph_follower import Places, Storage, trajectories_diverge
from alphacut.frame.methods.sampled import SAFETY, independent_excess, largest_values, spread_points
from alphacut.frame.structures.linear import frequencies
from alphacut.fuzzy.result import Nature

MAX_NUMBERS = 64e6
"""Most numbers of Taylor models computed at a time: 512 MB."""
BATCH = 32
"""Graphs computed together."""
MAX_GLOBAL_INPUTS = 4
"""Inputs up to which Taylor models are maximised globally."""
REACH = 0.6
"""Trust region of a Taylor model, as a fraction of the half width of the box."""
TRIES = 40
"""Proposals looked at per window of time."""
SPACING = 0.02
"""Distance in unit coordinates between graphs of one batch."""
NEAR_PEAK, PEAK_SHARE = 0.02, 0.02
"""Distance from a peak, as a fraction of it, within which a gain of this part of the tolerance is
worth a graph: a Newton step or two for each peak."""
LEAST_GAIN = 1e-10
"""Gain, as a fraction of a peak, that may be rounding."""
SPREAD = 64
"""Graphs on a spread of points per level that start the search."""
EXPLORED = 256
"""Motions of a kind per level whose values alone are looked at, for basins that no model shows."""
CROSSINGS, MOTIONS_PER_GRAPH, REDRAWN = 8, 8, 2.0
"""Rounds in which crossed optima of more inputs than `MAX_GLOBAL_INPUTS` are tried, at most; their
motions, whose values alone are looked at, for each graph; and the inputs drawn anew, on average."""
SEED_STEP = 100_003
"""Points of the sequence between those that two seeds spread."""


@dataclass(frozen=True)
class ImprovedFollower:
    """The method and its switches.

    Args:
        tolerance: Predicted gain above which a new graph is computed, as a fraction of each
            output's peak, or in the unit of the first displacement (the first output without one)
            where the envelope is not relative.
        budget: Most graphs over all levels.
        seed: Which points are spread.

    Raises:
        RefusedError: A switch is out of its range.
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
        from scipy.ndimage import maximum_filter1d

        limit = self._limit(flow)
        passes = [
            replace(self, seed=self.seed + k).run_pass(
                flow, subprogress(progress, 0.4 * k, 0.4 * (k + 1))
            )
            for k in range(2)
        ]
        first, second = passes
        gains = np.array([x.predicted_gain for x in passes])
        # gains above the tolerance, which remain where the budget ended a pass, come on top
        small, large = (np.where(x, gains, 0.0) for x in (gains <= limit, gains > limit))
        predicted = small.max(0) + large.sum(0)
        difference = np.abs(second.bounds - first.bounds).max(-1)
        # the largest over T/20 nodes around, at least a tenth of all
        near = maximum_filter1d(difference, 2 * (len(flow.time) // 40) + 1, axis=1)
        difference = np.maximum(near, 0.1 * difference.max(1, keepdims=True))
        points = np.where((second.bounds > first.bounds)[..., None], second.points, first.points)
        bounds = np.maximum(first.bounds, second.bounds)
        missed, count = independent_excess(flow, bounds, subprogress(progress, 0.8, 1.0))
        error = SAFETY * (predicted.max(-1) + limit[:, 0] / 2 + difference + missed[:, None])
        steepest = np.maximum(first.storage.steepest, second.storage.steepest)
        diverges = trajectories_diverge(steepest, bounds[0])
        note = f"stopped at the budget of {self.budget} trajectories"
        return flow.envelope(
            bounds,
            flow.boxes.to_physical(points),
            None if diverges else error,
            method=self.name,
            nature=Nature.ATTAINED if diverges else Nature.ESTIMATED,
            evaluations=first.evaluations + second.evaluations + count,
            facts={"gain": self.tolerance, "order": 2},
            notes=(note,) if large.any() else (),
        )

    def run_pass(
        self, flow: UnitFlow, progress: Progress | None = None, asked: Mask | None = None
    ) -> PassBounds:
        """Return the bounds of one pass on all levels, from the narrowest box to the widest.

        `asked` (A, T, m, 2) are the bounds whose gain counts, all unless given.
        """
        levels, storage, d = len(flow.boxes.alpha), Storage(flow), len(flow.boxes.names)
        bounds, gains = np.zeros((2, levels, *storage.top.shape))
        out = PassBounds(bounds, np.zeros((*bounds.shape, d)), gains, storage)
        states = 2 * len(frequencies(flow.flow.system)) if isinstance(flow.flow, LinearFlow) else 0
        # of a graph: outputs at all nodes, and powers of the step map within a block of nodes
        count = max(flow.time.size * len(flow.outputs), (isqrt(flow.time.size) + 1) * states**2)
        chunk_size = int(np.clip(MAX_NUMBERS / (count * (1 + d + d * d)), 1, BATCH))
        nominal = flow.boxes.to_unit(flow.boxes.nominal)[None]
        has_crossings = d > MAX_GLOBAL_INPUTS and states > 0
        for done, level in enumerate(reversed(range(levels))):
            # points of the sequence that no other level and no other seed takes
            box, skip = flow.boxes.unit_ends(level), SEED_STEP * (levels * self.seed + level + 1)
            tick = subprogress(progress, done / levels, (done + 1) / levels)
            # graphs at the end of the level, at most, and at its beginning
            limit, first = self.budget * (done + 1) // levels, len(storage)
            if (box[1] > box[0]).any():
                explored = spread_points(*box, EXPLORED, skip)
                points = np.vstack([nominal, explored[:SPREAD]])
            else:  # no other points, and none once it is stored
                explored, points = nominal, nominal[: not len(storage)]
            models = _LevelModels(
                storage, box, self._limit(flow), asked if asked is None else asked[level]
            )
            if done:  # what a narrower box reaches
                models.sampled[:] = out.bounds[level + 1]
                models.sampled_at[:] = out.points[level + 1]
            models.explore(explored)
            for crossing in range(1 + CROSSINGS * (has_crossings and len(explored) > 1)):
                if crossing:
                    explored = models.crossed_optima(np.random.default_rng([skip, crossing]))
                    models.explore(explored)
                    points = models.proposals(limit - len(storage))
                out.evaluations += len(explored)
                while len(points):
                    points = points[: max(1, limit - len(storage))]
                    for chunk in np.array_split(points, -(-len(points) // chunk_size)):
                        models.predict(storage.add(chunk))
                        tick(min(1.0, (len(storage) - first) / max(1, limit - first)))
                    points = models.proposals(limit - len(storage))
            # optima of the models that are not worth a graph are worth their values
            if has_crossings and (models.predicted > storage.top).any():
                targets = np.unique(models.target[models.predicted > storage.top], axis=0)
                models.explore(targets)
                out.evaluations += len(targets)
            # post-processing of the level
            better, best_points = models.sampled > storage.top, storage.points[storage.best]
            out.bounds[level] = np.maximum(models.sampled, storage.top)
            out.points[level] = np.where(better[..., None], models.sampled_at, best_points)
            out.predicted_gain[level] = np.maximum(models.predicted - out.bounds[level], 0.0)
        out.evaluations += len(storage)
        return out

    def _limit(self, flow: UnitFlow) -> Array:
        """Return the gain of each output that is left aside, shape (m, 1), rounding at least."""
        allowed = np.maximum(self.tolerance * flow.scale, LEAST_GAIN * flow.peak)
        return np.asarray(allowed[:, None])


@dataclass(eq=False)
class PassBounds:
    """Reached bounds of (−output, output) of one pass, shape (A, T, m, 2)."""

    bounds: Array
    points: Array  # their unit coordinates, shape (A, T, m, 2, d)
    predicted_gain: Array  # by the models; above the tolerance where the budget ended the pass
    storage: Storage  # of all graphs
    evaluations: int = 0  # graphs, and motions whose values alone were looked at


class _LevelModels:
    """Predictions of the stored graphs' Taylor models in one box, by place (T, m, 2)."""

    def __init__(
        self, storage: Storage, box: tuple[Array, Array], limit: Array, asked: Mask | None
    ) -> None:
        self.storage, self.box, self.limit, self.asked = storage, box, limit, asked
        self.reach = REACH * np.maximum((box[1] - box[0]) / 2, 1e-300)
        # largest values of explored motions, and where they are, shape (T, m, 2, d)
        self.sampled: Array = np.full(storage.top.shape, -np.inf)
        self.sampled_at = np.zeros((*storage.top.shape, len(box[0])))
        # the same of the models
        self.predicted, self.target = storage.top.copy(), np.zeros(self.sampled_at.shape)
        if len(storage):
            self.predict(storage.all_places)

    def explore(self, points: Array) -> None:
        """Let the values of motions at points (S, d) count as predictions where they are larger."""
        values, index = largest_values(self.storage.flow, points)
        better = values > self.sampled
        self.sampled[better], self.sampled_at[better] = values[better], points[index][better]

    def crossed_optima(self, rng: np.random.Generator) -> Array:
        """Return optima of random places with some inputs of others or drawn anew, shape (S, d)."""
        storage, d = self.storage, len(self.box[0])
        count = MOTIONS_PER_GRAPH * len(storage)
        optima, partners = storage.points[rng.choice(storage.best.ravel(), (2, count))]
        # a third of the drawn values at the ends of their range
        drawn = (
            np.clip(rng.uniform(-1.5, 1.5, optima.shape), -1, 1) * (self.box[1] - self.box[0]) / 2
        )
        drawn += (self.box[0] + self.box[1]) / 2
        further = np.where(rng.random((count, 1)) < 0.5, drawn, partners)
        return np.where(rng.random(optima.shape) < REDRAWN / d, further, optima)

    def predict(self, places: Places) -> None:
        """Set the predictions at places from the Taylor models of the best graphs there."""
        if len(places[0]) and (self.box[1] > self.box[0]).any():
            maximise = global_maximum if len(self.box[0]) <= MAX_GLOBAL_INPUTS else local_maximum
            optima = self.storage.predicted(places, self.box, maximise, reach=self.reach)
            self.predicted[places], self.target[places] = optima

    @property
    def least_gains(self) -> Array:
        """Gain of each bound that is worth a graph, shape (T, m, 2)."""
        top, peak = self.storage.top, self.storage.flow.peak[:, None]
        near_peak = top >= (1 - NEAR_PEAK) * np.maximum(top.max(0), 0.0)
        least = np.maximum(self.limit * np.where(near_peak, PEAK_SHARE, 1.0), LEAST_GAIN * peak)
        return least if self.asked is None else np.where(self.asked, least, np.inf)

    def proposals(self, count: int) -> Array:
        """Return distinct points worth a graph, one per window of time, shape (≤ count, d)."""
        gains = (np.maximum(self.predicted, self.sampled) - self.storage.top) / self.least_gains
        chosen, count = list[Array](), min(count, BATCH)
        windows = np.array_split(np.arange(len(gains)), max(1, min(count, len(gains))))
        for window in windows:
            for k in np.argsort(-gains[window], axis=None)[:TRIES]:
                t, o, side = np.unravel_index(k, gains[window].shape)
                place = (window[t], o, side)
                if gains[place] <= 1:
                    break
                is_sampled = self.sampled[place] > self.predicted[place]
                point = (self.sampled_at if is_sampled else self.target)[place]
                if self.storage.holds(point, near=1e-7):
                    self.predicted[place] = self.storage.top[place]  # the model was wrong
                elif all(np.abs(point - neighbour).max() > SPACING for neighbour in chosen):
                    chosen.append(point)
                    break
        return np.array(chosen)[:count].reshape(-1, len(self.box[0]))
