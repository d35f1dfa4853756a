"""Graph Follower (section 5.3, eq. 21): envelopes from few graphs and their Taylor models.

This differs from the paper in: 1. One storage serves all outputs, both sides and all levels: levels
are treated from the narrowest box to the widest, so that every stored graph is admissible and
α-cuts are nested by construction. 2. A new graph is computed only where the Taylor model promises
more than an explicit tolerance.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import gain, linear_maximum, local_maximum
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.graph_storage import Index, Places, Storage
from alphacut.frame.methods.independent import SAFETY, beyond, parted
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature


class FollowerStep(NamedTuple):
    """Record of one node for one bound (Figs. 21 to 23).

    Args:
        level: Index of the α-cut.
        node: Index of the time node.
        output: Index of the output.
        side: +1 upper bound, −1 lower bound.
        guess: Index of the best stored graph, the initial guess.
        new: Index of the new graph, or −1 when the guess stays.
        predicted: The bound that the Taylor model promises.
    """

    level: int
    node: int
    output: int
    side: int
    guess: int
    new: int
    predicted: float


@dataclass(eq=False)
class Followed:
    """Outcome of the Graph Follower.

    Args:
        bounds: Upper bounds of ±output after post-processing, shape (A, T, m, 2), the sides last:
            (−output, output).
        best: Index of the graph that attains each, shape (A, T, m, 2).
        left: What Taylor models still promise at most, same shape.
        storage: All graphs.
        steps: The record, where it was asked for.
        exhausted: Whether the budget ended the search.
    """

    bounds: Array
    best: Index
    left: Array
    storage: Storage
    steps: list[FollowerStep] = field(default_factory=list)
    exhausted: bool = False


@dataclass(frozen=True)
class GraphFollower:
    """Graph Follower: envelopes of any structure from few trajectories ("graphs").

    At each node Taylor models of the trajectories computed so far point to the inputs that move the
    output furthest. Where they promise enough, the trajectory of those inputs is computed as well.

    Args:
        order: Degree κ of the Taylor models, 1 or 2.
        tolerance: Promised gain above which a new trajectory is computed, in the unit of the first
            output.
        budget: Most trajectories to compute; None for no limit.
        record: Keep every step.

    Raises:
        RefusedError: A switch is out of its range.
    """

    name: ClassVar[str] = "graph-follower"
    order: int = 2
    tolerance: float = 1e-4
    budget: int | None = None
    record: bool = False

    def __post_init__(self) -> None:
        if self.order not in (1, 2):
            raise RefusedError("order", self.order, "1 and 2, the degrees of a Taylor model")
        if not (self.tolerance > 0 and np.isfinite(self.tolerance)):
            raise RefusedError("tolerance", self.tolerance, "a positive number")
        if self.budget is not None and self.budget < 1:
            raise RefusedError("budget", self.budget, "whole numbers from 1 on")

    def run(self, flow: UnitFlow, progress: Callable[[float], None] | None = None) -> Envelope:
        """Envelope of all outputs on all levels.

        Its error is what the models still promise, and twice what an independent sample finds
        beyond the bounds. Where neighbouring trajectories part there is none, and the bounds are
        attained, no more.
        """
        begun = time.perf_counter()
        followed = self.follow(flow, progress)
        missed, count = beyond(flow, followed.bounds)
        apart = parted(followed.storage.steepest, followed.bounds[0])
        error = followed.left.max(-1) + SAFETY * missed[:, None]
        notes = (f"stopped at the budget of {self.budget} trajectories",) * followed.exhausted
        return flow.envelope(
            followed.bounds,
            followed.storage.points[followed.best],
            None if apart else error,
            method=self.name,
            nature=Nature.ATTAINED if apart else Nature.ESTIMATED,
            evaluations=len(followed.storage) + count,
            seconds=time.perf_counter() - begun,
            facts={"order": self.order, "gain": self.tolerance},
            notes=notes,
        )

    def follow(self, flow: UnitFlow, progress: Callable[[float], None] | None = None) -> Followed:
        """Follows the graphs on all levels of `flow.boxes`."""
        storage = Storage(flow, self.record)
        storage.add(flow.boxes.to_unit(flow.boxes.modal)[None])
        levels = len(flow.boxes.alpha)
        shape = (levels, *storage.top.shape)
        out = Followed(np.empty(shape), np.empty(shape, np.int64), np.zeros(shape), storage)
        for done, level in enumerate(reversed(range(levels))):
            self._sweep(out, level, progress, done / levels)
            # post-processing: the best of all graphs at every node (Fig. 24)
            out.bounds[level], out.best[level] = storage.top, storage.best
        return out

    def _sweep(
        self, out: Followed, level: int, progress: Callable[[float], None] | None, start: float
    ) -> None:
        storage, box = out.storage, out.storage.flow.boxes.unit(level)
        if not (box[1] > box[0]).any():
            return
        levels, nodes = out.bounds.shape[:2]
        promise, target = storage.top.copy(), np.zeros((*storage.top.shape, len(box[0])))
        self._ask(storage, tuple(np.indices(promise.shape).reshape(3, -1)), box, promise, target)
        for node in range(nodes):
            if progress and node % 100 == 0:
                progress(start + node / nodes / levels)
            if self.budget is not None and len(storage) >= self.budget:
                out.exhausted = True
                out.left[level] = np.maximum(promise - storage.top, 0.0)
                return
            guess = storage.best[node].flatten()
            tried, new = self._tried(storage, node, promise, target)
            if new:
                won = storage.add(np.array(new))
                ahead = tuple(place[won[0] > node] for place in won)
                self._ask(storage, ahead, box, promise, target)
            if self.record:
                _note(out, level, node, guess, tried)
        limit = self.tolerance * storage.flow.scale[:, None]
        out.left[level] = np.clip(promise - storage.top, 0.0, limit)

    def _tried(
        self, storage: Storage, node: int, promise: Array, target: Array
    ) -> tuple[dict[int, tuple[int, float]], list[Array]]:
        """New graphs for bounds of a node, and what was promised for each, as in `FollowerStep`."""
        limit = self.tolerance * storage.flow.scale[:, None]
        tried: dict[int, tuple[int, float]] = {}
        new: list[Array] = []
        for k in np.flatnonzero(promise[node] > storage.top[node] + limit):
            point = target[node, k // 2, k % 2]
            fresh = not storage.holds(point) and all(
                np.abs(point - other).max() > 1e-9 for other in new
            )
            graph = len(storage) + len(new) if fresh else -1
            tried[int(k)] = graph, float(promise[node, k // 2, k % 2])
            if fresh:
                new.append(point)
        return tried, new

    def _ask(
        self,
        storage: Storage,
        places: Places,
        box: tuple[Array, Array],
        promise: Array,
        target: Array,
    ) -> None:
        """Sets what the Taylor models of the best graphs promise at places, and at which points."""
        side = 2.0 * places[2] - 1
        _, first, second = storage.held.models(places)
        g, H = side[:, None] * first, side[:, None, None] * second
        at = storage.points[storage.best[places]]
        low, high = box[0] - at, box[1] - at
        # optima of eq. 22
        x = local_maximum(g, H, low, high) if self.order == 2 else linear_maximum(g, low, high)
        promised = gain(g, H if self.order == 2 else 0 * H, x)
        promise[places], target[places] = storage.top[places] + promised, np.clip(at + x, *box)


def _note(
    out: Followed, level: int, node: int, guess: Index, tried: dict[int, tuple[int, float]]
) -> None:
    for k, best in enumerate(guess):
        side = 2 * (k % 2) - 1
        graph, value = tried.get(k, (-1, float("nan")))
        out.steps.append(FollowerStep(level, node, k // 2, side, int(best), graph, side * value))
