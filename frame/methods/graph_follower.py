"""Graph Follower (section 5.3, eq. 21): envelopes from few graphs and their Taylor models.

This differs from the paper in: 1. One storage serves all outputs, both sides and all levels: levels
are treated from the narrowest box to the widest, so that every stored graph is admissible and
α-cuts are nested by construction. 2. A new graph is computed only where the Taylor model predicts
more than an explicit tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from alphacut.base.arrays import Array, Ints
from alphacut.base.errors import checked_number, require
from alphacut.base.progress_bar import Progress, subprogress
from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import gain, local_maximum
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.sampled import SAFETY, independent_excess
from alphacut.fuzzy.result import Nature

MAX_RATIO = 8.0
"""Slope along a half width of the box, as a fraction of the output's range, from which on
neighbouring trajectories part."""

Places = tuple[Ints, ...]
"""Indices of nodes, outputs and sides, one of each for a place."""


class Storage:
    """All graphs (trajectories) computed so far, and the best of them at each place.

    Arrays over places have shape (T, m, 2): node, output, and side (−output, output).
    """

    def __init__(self, flow: UnitFlow) -> None:
        d, shape = len(flow.boxes.names), (len(flow.time), len(flow.outputs), 2)
        self.flow = flow
        self.points: Array = np.empty((0, d))  # of all graphs, in unit coordinates
        # the best value at each place, and the first graph that has it
        self.top, self.best = np.full(shape, -np.inf), np.zeros(shape, np.int64)
        # derivatives of that graph's output
        self.first, self.second = np.zeros((*shape, d)), np.zeros((*shape, d, d))
        self.steepest = np.zeros(shape[1])  # slope of any graph along a coordinate, (m,)

    def __len__(self) -> int:
        return len(self.points)

    @property
    def all_places(self) -> Places:
        """Indices of all places."""
        return tuple(np.indices(self.top.shape).reshape(3, -1))

    def holds(self, point: Array, near: float = 1e-9) -> bool:
        """Return whether a graph at `point` (d,) is stored, up to the distance `near`."""
        return bool((np.abs(self.points - point).max(1, initial=0.0) < near).any())

    def add(self, points: Array) -> Places:
        """Compute and store the graphs at unit coordinates (S, d); return where one is now best."""
        jet, top = self.flow.taylor(points), self.top.reshape(-1)
        slopes = np.abs(np.moveaxis(jet.first, -1, 0)).reshape(len(self.steepest), -1)
        self.steepest = np.maximum(self.steepest, slopes.max(1))
        best_new = np.full(top.shape, -1)  # which of them is the best; −1 for none
        for s, value in enumerate(jet.value):
            signed = np.stack([-value, value], -1).ravel()
            better = np.flatnonzero(signed > top)
            top[better], best_new[better] = signed[better], s
        improved = np.flatnonzero(best_new >= 0)
        places: Places = np.unravel_index(improved, self.top.shape)
        best = jet[best_new[improved], *places[:2]]  # by graph, node and output
        self.best[places] = len(self) + best_new[improved]
        self.first[places] = best.first.T
        self.second[places] = best.second.T
        self.points = np.vstack([self.points, points])
        return places

    def predicted(
        self,
        places: Places,
        box: tuple[Array, Array],
        maximise: Callable[..., Array],
        *,
        bend: float = 1.0,
        reach: Array | float = np.inf,
    ) -> tuple[Array, Array]:
        """Return maxima (K,) of the best graphs' Taylor models at places, and their points (K, d).

        They are those over a box of unit coordinates (eq. 22 of the paper) within the distance
        `reach` of each graph, found by `maximise` from g and H of g·x + x·H·x/2 and the ends of x;
        `bend` is a factor on H, 0 for linear models.
        """
        side, at = 2.0 * places[2] - 1, self.points[self.best[places]]
        g, H = side[:, None] * self.first[places], bend * side[:, None, None] * self.second[places]
        x = maximise(g, H, np.maximum(box[0] - at, -reach), np.minimum(box[1] - at, reach))
        return self.top[places] + gain(g, H, x), np.clip(at + x, *box)


@dataclass(eq=False)
class Followed:
    """Upper bounds of (−output, output) that the Graph Follower has found, all (A, T, m, 2)."""

    bounds: Array  # after post-processing
    best: Ints  # index of the graph that reaches each
    predicted_gain: Array  # over the bounds, by Taylor models
    guess: Ints  # index of the best stored graph when a node was reached (Figs. 21 to 23)
    new: Ints  # index of the graph computed there, or −1 where the guess stays
    storage: Storage  # of all graphs


@dataclass(frozen=True)
class GraphFollower:
    """Graph Follower: envelopes of any structure from few trajectories ("graphs").

    At each node Taylor models of the trajectories computed so far point to the inputs that move the
    output furthest. Where they predict enough, the trajectory of those inputs is computed as well.

    Args:
        order: Degree κ of the Taylor models, 1 or 2.
        tolerance: Promised gain above which a new trajectory is computed, as a fraction of each
            output's peak, or in the unit of the first displacement (the first output without one)
            where the envelope is not relative.

    Raises:
        RefusedError: A switch is out of its range.
    """

    name: ClassVar[str] = "graph-follower"
    order: int = 2
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        allowed = "1 and 2, the degrees of a Taylor model"
        require(self.order in (1, 2), "order", value=self.order, allowed=allowed)
        checked_number("tolerance", self.tolerance, positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope of all outputs on all levels, estimated or attained.

        Its error is the gain that the models still predict, and twice what an independent sample
        finds beyond the bounds. Where neighbouring trajectories diverge there is none, and the
        bounds are attained only.
        """
        followed = self.follow(flow, subprogress(progress, 0.0, 0.8))
        missed, count = independent_excess(flow, followed.bounds, subprogress(progress, 0.8, 1.0))
        diverges = trajectories_diverge(followed.storage.steepest, followed.bounds[0])
        error = followed.predicted_gain.max(-1) + SAFETY * missed[:, None]
        return flow.envelope(
            followed.bounds,
            flow.boxes.to_physical(followed.storage.points[followed.best]),
            None if diverges else error,
            method=self.name,
            nature=Nature.ATTAINED if diverges else Nature.ESTIMATED,
            evaluations=len(followed.storage) + count,
            facts={"order": self.order, "gain": self.tolerance},
        )

    def follow(self, flow: UnitFlow, progress: Progress | None = None) -> Followed:
        """Return bounds on all levels by Taylor models, from the narrowest box to the widest."""
        storage = Storage(flow)
        storage.add(flow.boxes.to_unit(flow.boxes.nominal)[None])
        levels, (n_nodes, m, _) = len(flow.boxes.alpha), storage.top.shape
        shape = (levels, n_nodes, m, 2)
        zeros, none = np.zeros(shape), np.full(shape, -1)
        out = Followed(zeros.copy(), none.copy(), zeros, none.copy(), none, storage)
        limit, bend = self.tolerance * flow.scale[:, None], float(self.order > 1)
        for done, level in enumerate(reversed(range(levels))):
            tick = subprogress(progress, done / levels, (done + 1) / levels)
            box = flow.boxes.unit_ends(level)
            predicted, target = storage.predicted(storage.all_places, box, local_maximum, bend=bend)
            predicted, target = predicted.reshape(shape[1:]), target.reshape(*shape[1:], -1)
            for node in range(n_nodes):
                tick(node / n_nodes)
                out.guess[level, node] = storage.best[node]
                points = list[Array]()
                for entry in np.argwhere(predicted[node] > storage.top[node] + limit):
                    point = target[node, *entry]
                    if storage.holds(point) or any(np.abs(point - x).max() <= 1e-9 for x in points):
                        continue
                    out.new[level, node, *entry] = len(storage) + len(points)
                    points.append(point)
                if points:  # predict anew where they are the best graphs now
                    improved = storage.add(np.array(points))
                    later = tuple(indices[improved[0] > node] for indices in improved)
                    predicted[later], target[later] = storage.predicted(
                        later, box, local_maximum, bend=bend
                    )
            # post-processing: the best of all graphs at every node (Fig. 24)
            out.bounds[level], out.best[level] = storage.top, storage.best
            out.predicted_gain[level] = np.clip(predicted - storage.top, 0.0, limit)
        return out


def trajectories_diverge(steepest: Array, bounds: Array) -> bool:
    """Return whether neighbouring trajectories diverge, so that Taylor models predict nothing.

    `steepest` (m,) is the largest slope of each output along a unit coordinate, `bounds` (T, m, 2)
    are upper bounds of (−output, output).
    """
    width = (bounds[..., 0].max(0) + bounds[..., 1].max(0)) / 2
    return bool((steepest > MAX_RATIO * width).any())
