"""Graph Follower in rounds: Taylor models of all nodes propose graphs in batches.

The same idea as `graph_follower` (storage, Taylor models, tolerance, post-processing), turned
around: instead of one node after the other, every round asks the models of the best graphs at all
nodes, takes the proposal that promises most in each window of time, and advances these graphs
together as arrays. Nodes before and after a discovery profit alike, which is what backward sweeps
are for; the points spread at the start look for basins independently of any model.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import global_maximum, local_maximum
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.graph_storage import Places, Storage
from alphacut.frame.methods.independent import SAFETY, independent_excess, needs_parting
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress, subprogress
from alphacut.fuzzy.refused import real
from alphacut.fuzzy.result import Nature

MOST = 64e6
"""Most numbers of Taylor models computed at a time: 512 MB."""
BATCH = 32
"""Graphs computed together."""
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
        real("tolerance", self.tolerance, positive=True)
        real("budget", self.budget, whole=True, least=1)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of two passes from different points, corrected by what their models promise.

        The error is twice what the models still promise and what an independent sample finds
        beyond the bounds, and twice what one pass leads beyond the other. Where neighbouring
        trajectories part there is none, and the bounds are attained, no more.
        """
        start_time, second_pass = time.perf_counter(), replace(self, seed=self.seed + 1)
        first = self.pursue(flow, subprogress(progress, 0.0, 0.4))
        second = second_pass.pursue(flow, subprogress(progress, 0.4, 0.8))
        better = second.bounds > first.bounds
        bounds = np.where(better, second.bounds, first.bounds)
        where = np.where(better[..., None], second.where, first.where)
        limit = self.tolerance * flow.scale[:, None]
        closed = [np.where(x.left <= limit, x.left, 0.0) for x in (first, second)]
        open_ = [np.where(x.left > limit, x.left, 0.0) for x in (first, second)]
        promised = np.maximum(*closed) + np.maximum(*open_)
        gap = around(np.abs(second.bounds - first.bounds).max(-1))
        missed, count = independent_excess(flow, bounds, subprogress(progress, 0.8, 1.0))
        small = self.tolerance / 2 * flow.scale
        error = SAFETY * (promised.max(-1) + small + gap + missed[:, None])
        parts = needs_parting(
            np.maximum(first.storage.steepest, second.storage.steepest), bounds[0]
        )
        notes = (f"stopped at the budget of {self.budget} trajectories",)
        return flow.envelope(
            bounds,
            where,
            None if parts else error,
            method=self.name,
            nature=Nature.ATTAINED if parts else Nature.ESTIMATED,
            evaluations=len(first.storage) + len(second.storage) + count,
            seconds=time.perf_counter() - start_time,
            facts={"gain": self.tolerance, "order": 2},
            notes=notes * bool(np.any(open_)),
        )

    def pursue(self, flow: UnitFlow, progress: Progress) -> Pursued:
        """Pursues all levels of `flow.boxes`, from the narrowest box to the widest."""
        levels, storage = len(flow.boxes.alpha), Storage(flow)
        d, places = len(flow.boxes.names), storage.top.size // 2
        bounds, left = np.zeros((2, levels, *storage.top.shape))
        out = Pursued(bounds, np.zeros((*bounds.shape, d)), left, storage)
        at_once = int(np.clip(MOST / (places * (1 + d + d * d)), 1, BATCH))
        for done, level in enumerate(reversed(range(levels))):
            search = _Level(storage, flow.boxes.unit(level), self.tolerance)
            tick = subprogress(progress, done / levels, (done + 1) / levels)
            limit, first = self.budget * (done + 1) // levels, len(storage)
            points = self._start(storage, *search.box)[: max(1, limit - len(storage))]
            while len(points):
                for chunk in np.array_split(points, -(-len(points) // at_once)):
                    search.ask(storage.add(chunk))
                    tick(min(1.0, (len(storage) - first) / max(1, limit - first)))
                points = search.proposals(min(BATCH, limit - len(storage)))
            # post-processing of the level
            out.bounds[level], out.where[level] = storage.top, storage.points[storage.best]
            out.left[level] = np.maximum(search.promise - storage.top, 0.0)
        return out

    def _start(self, storage: Storage, lower: Array, upper: Array) -> Array:
        boxes = storage.flow.boxes
        modal = boxes.to_unit(boxes.modal)[None]
        if not (upper > lower).any():
            return modal[: 0 if len(storage) else 1]
        middle, half = (lower + upper) / 2, (upper - lower) / 2
        skip = 1 + len(storage) + SEED_STEP * self.seed
        spread = chebyshev_points(len(lower), SPREAD, skip=skip)
        return np.vstack([modal, middle + half * spread])


@dataclass(frozen=True, eq=False)
class Pursued:
    """Outcome of one pass.

    Args:
        bounds: Attained bounds of (−output, output), shape (A, T, m, 2).
        where: Their unit coordinates, shape (A, T, m, 2, d).
        left: What the models still promise, shape (A, T, m, 2); more than the tolerance where the
            budget ended the search.
        storage: All graphs.
    """

    bounds: Array
    where: Array
    left: Array
    storage: Storage


class _Level:
    """Promises of the models of stored graphs in one box, and their places."""

    def __init__(self, storage: Storage, box: tuple[Array, Array], tolerance: float) -> None:
        self.storage, self.box, self.tolerance = storage, box, tolerance
        self.reach = REACH * np.maximum((box[1] - box[0]) / 2, 1e-300)
        self.promise = storage.top.copy()
        self.target = np.zeros((*storage.top.shape, len(box[0])))
        if len(storage):
            self.ask(tuple(np.indices(storage.top.shape).reshape(3, -1)))

    def ask(self, places: Places) -> None:
        """Ask the models that hold the bounds of places about more."""
        if len(places[0]) and (self.box[1] > self.box[0]).any():
            few = len(self.box[0]) <= 4
            optima = self.storage.promised(
                places, self.box, global_maximum if few else local_maximum, reach=self.reach
            )
            self.promise[places], self.target[places] = optima

    def proposals(self, count: int) -> Array:
        """Most promising points of every window of time, apart from others, (≤ count, d)."""
        chosen, top = list[Array](), self.storage.top
        windows = np.array_split(np.arange(len(top)), max(1, min(count, len(top))))
        for window in windows:
            gains = (self.promise - top)[window] / self.storage.flow.scale[:, None]
            for k in np.argsort(-gains, axis=None)[:TRIES]:
                t, o, side = np.unravel_index(k, gains.shape)
                entry = (window[t], o, side)
                if gains[t, o, side] <= self.tolerance:
                    break
                point = np.clip(self.target[entry], *self.box)
                if self.storage.holds(point, near=1e-7):
                    self.promise[entry] = top[entry]  # the model promised too much
                elif all(np.abs(point - neighbour).max() > SPACING for neighbour in chosen):
                    chosen.append(point)
                    break
        return np.array(chosen)[:count].reshape(-1, len(self.box[0]))


def around(gap: Array) -> Array:
    """Largest of values (A, T, m) at the nodes near by, and a tenth of the largest of all."""
    from scipy.ndimage import maximum_filter1d

    near = maximum_filter1d(gap, 2 * (gap.shape[1] // 40) + 1, axis=1)
    return np.asarray(np.maximum(near, 0.1 * gap.max(1, keepdims=True)))
