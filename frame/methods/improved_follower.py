"""Graph Follower in rounds: Taylor models of all nodes propose graphs in batches.

The same idea as `frame.graph_follower` (storage, Taylor models, tolerance, post-processing), turned
around: instead of one node after the other, every round asks the models of the best graphs at all
nodes, takes the proposal that promises most in each window of time, and advances these graphs
together as arrays. Nodes before and after a discovery profit alike, which is what backward sweeps
are for; the points spread at the start look for basins independently of any model.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import gain, global_maximum, local_maximum
from alphacut.frame.calculus.jet import Jet
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.held_models import HeldModels, models_at
from alphacut.frame.methods.independent import SAFETY, beyond, parted
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress, share
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature

APART = 100_003
"""Points of the sequence between those that two seeds spread."""


@dataclass(frozen=True)
class ImprovedFollower:
    """The method and its switches.

    Args:
        tolerance: Predicted gain above which a new graph is computed, in units of the outputs.
        budget: Most graphs over all levels.
        spread: Graphs on a spread of points per level that start the search.
        batch: Graphs computed together.
        reach: Trust region of a Taylor model, as a share of the half width of the box.
        contests: How often, when no model promises more, those of neighbouring nodes are asked
            where the optimum jumps in between.
        seed: Which points are spread.

    Raises:
        RefusedError: A switch is out of its range.
    """

    name: ClassVar[str] = "improved-graph-follower"
    tolerance: float = 7e-5
    budget: int = 5000
    spread: int = 64
    batch: int = 32
    reach: float = 0.6
    contests: int = 1
    seed: int = 0

    def __post_init__(self) -> None:
        if not (self.tolerance > 0 and np.isfinite(self.tolerance)):
            raise RefusedError("tolerance", self.tolerance, "a positive number")
        if min(self.budget, self.spread, self.batch) < 1 or not 0 < self.reach <= 2:
            given = (self.budget, self.spread, self.batch, self.reach)
            raise RefusedError("budget, spread, batch, reach", given, "counts; a reach in (0, 2]")

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of two passes from different points, corrected by what their models promise.

        The error is twice what the models still promise and what an independent sample finds
        beyond the bounds, and twice what one pass found beyond the other. Where neighbouring
        trajectories part there is none, and the bounds are attained, no more.
        """
        begun, other = time.perf_counter(), replace(self, seed=self.seed + 1)
        first = self.pursue(flow, progress=share(progress, 0.0, 0.5))
        second = other.pursue(flow, progress=share(progress, 0.5, 1.0))
        better = second.bounds > first.bounds
        bounds = np.where(better, second.bounds, first.bounds)
        where = np.where(better[..., None], second.where, first.where)
        promised = np.maximum(first.correction, second.correction) + np.maximum(
            first.open_gain, second.open_gain
        )
        apart = around(np.abs(second.bounds - first.bounds).max(-1))
        missed, count = beyond(flow, bounds)
        small = self.tolerance / 2 * flow.scale
        error = SAFETY * (promised.max(-1) + small + apart + missed[:, None])
        parts = parted(np.maximum(first.steepest, second.steepest), bounds[0])
        notes = (f"stopped at the budget of {self.budget} trajectories",)
        return flow.envelope(
            bounds,
            where,
            None if parts else error,
            method=self.name,
            nature=Nature.ATTAINED if parts else Nature.ESTIMATED,
            evaluations=len(first.points) + len(second.points) + count,
            seconds=time.perf_counter() - begun,
            facts={"gain": self.tolerance, "order": 2},
            notes=notes * bool(first.open_gain.any() or second.open_gain.any()),
        )

    def pursue(self, flow: UnitFlow, *, progress: Progress | None = None) -> Pursuit:
        """Pursues all levels of `flow.boxes`, from the narrowest box to the widest."""
        levels = len(flow.boxes.alpha)
        out = Pursuit.empty(flow, beside=self.contests > 0)
        d, places = len(flow.boxes.names), len(flow.time) * len(flow.outputs)
        at_once = int(np.clip(MOST / (places * (1 + d + d * d)), 1, self.batch))
        for done, level in enumerate(reversed(range(levels))):
            lower, upper = flow.boxes.unit(level)
            out.enter(lower, upper, self)
            limit = self.budget * (done + 1) // levels
            points = self._start(flow, lower, upper, out)[: max(1, limit - len(out.points))]
            contests = self.contests
            while len(points):
                for chunk in np.array_split(points, -(-len(points) // at_once)):
                    out.take(chunk)
                if progress:
                    progress(min(1.0, len(out.points) / self.budget))
                points = out.proposals(self, min(self.batch, limit - len(out.points)))
                while not len(points) and contests and len(out.points) < limit:
                    out.contest()
                    contests -= 1
                    points = out.proposals(self, min(self.batch, limit - len(out.points)))
            out.leave(level)
        return out

    def _start(self, flow: UnitFlow, lower: Array, upper: Array, out: Pursuit) -> Array:
        modal = flow.boxes.to_unit(flow.boxes.modal)[None]
        if not (upper > lower).any():
            return modal if not len(out.points) else np.zeros((0, len(lower)))
        middle, half = (lower + upper) / 2, (upper - lower) / 2
        skip = 1 + len(out.points) + APART * self.seed
        spread = chebyshev_points(len(lower), self.spread, skip=skip)
        return np.vstack([modal, middle + half * spread])


@dataclass(eq=False)
class Pursuit:
    """State of the search: best bounds, and what the models of stored graphs propose.

    Arrays over problems have shape (T, m, 2); sides are (−output, output), both to be maximised.

    Args:
        flow: Computes graphs.
        points: Unit coordinates of all graphs so far, shape (G, d).
        value: Attained bounds of the present level.
        at: Unit coordinates that attain them, shape (T, m, 2, d).
        promise: Bound promised by the model of the best graph.
        target: Unit coordinates it promises it at, shape (T, m, 2, d).
        bounds: Attained bounds per finished level, shape (A, T, m, 2).
        where: Their unit coordinates.
        correction: What the final models still promise, at most the tolerance.
        open_gain: What they promise above the tolerance when the budget ends the search.
        held: Models of the graphs that attain the bounds.
        steepest: Largest slope of any graph along a coordinate, shape (m,).
    """

    flow: UnitFlow
    points: Array
    value: Array
    at: Array
    promise: Array
    target: Array
    bounds: Array
    where: Array
    correction: Array
    open_gain: Array
    held: HeldModels
    steepest: Array = field(default_factory=lambda: np.zeros(1))
    lower: Array = field(default_factory=lambda: np.zeros(0))
    upper: Array = field(default_factory=lambda: np.zeros(0))
    tolerance: float = 0.0
    reach: float = 0.6

    @classmethod
    def empty(cls, flow: UnitFlow, *, beside: bool) -> Pursuit:
        """Nothing known yet; `beside` keeps models for contests."""
        d, shape = len(flow.boxes.names), (len(flow.time), len(flow.outputs), 2)
        levels = len(flow.boxes.alpha)
        low, at = np.full(shape, -np.inf), np.zeros((*shape, d))
        many, where = np.zeros((levels, *shape)), np.zeros((levels, *shape, d))
        grids = (low, at, low.copy(), at.copy(), many, where, many.copy(), many.copy())
        held = HeldModels.empty((0,) * (levels > 1) + (-1, 1) * beside, shape, d)
        return cls(flow, np.zeros((0, d)), *grids, held)

    def enter(self, lower: Array, upper: Array, method: ImprovedFollower) -> None:
        """Start a level; attained values stay, models are asked anew in the wider box."""
        self.lower, self.upper = lower, upper
        self.tolerance, self.reach = method.tolerance, method.reach
        self.promise[:] = self.value
        if len(self.points) and (upper > lower).any():
            places = np.nonzero(np.isfinite(self.value))
            found = self._optima(self.at[places], self.held.models(0, places), places[-1])
            self.promise[places], self.target[places] = found

    def leave(self, level: int) -> None:
        """Post-processing of a level."""
        promised = np.maximum(self.promise - self.value, 0.0)
        small = promised <= self.tolerance * self.flow.scale[:, None]
        self.bounds[level], self.where[level] = self.value, self.at
        self.correction[level] = np.where(small, promised, 0.0)
        self.open_gain[level] = np.where(small, 0.0, promised)

    def take(self, points: Array) -> None:
        """Computes graphs, updates the bounds at all nodes and asks their models."""
        jet = self.flow.taylor(points)
        self.points = np.vstack([self.points, points])
        self.steepest = np.maximum(self.steepest, np.abs(jet.first).max((0, 1, 2)))
        self._ask(points, jet)

    def _ask(self, points: Array, jet: Jet) -> None:
        holder = np.full(self.value.shape, -1)
        for s, point in enumerate(points):
            signed = np.stack([-jet.value[s], jet.value[s]], -1)
            better = signed > self.value
            self.value[better], self.at[better], holder[better] = signed[better], point, s
            self._propose(point, jet, s, signed >= self.value)
        self.held.keep(jet, holder)

    def contest(self) -> None:
        """Ask the models that hold a bound at one node about the next node."""
        width = JUMP * (self.upper - self.lower).max()
        jumps = np.argwhere(np.abs(np.diff(self.at, axis=0)).max(-1) > width)
        for shift in (1, -1):  # of the node asked about from that of the rival
            t, o, side = np.add(jumps, [shift < 0, 0, 0]).T
            rivals, places = (t, o, side), (t + shift, o, side)
            found = self._optima(self.at[rivals], self.held.models(shift, rivals), side)
            more = found[0] > self.promise[places]
            places = tuple(x[more] for x in places)
            self.promise[places], self.target[places] = (x[more] for x in found)

    def _propose(self, point: Array, jet: Jet, s: int, close: Array) -> None:
        """Optima of the model of one graph where it is best."""
        places = np.nonzero(close)
        if not len(places[0]) or not (self.upper > self.lower).any():
            return
        points = np.broadcast_to(point, (len(places[0]), len(point)))
        models = models_at(jet, (np.full(len(points), s), *places[:2]))
        self.promise[places], self.target[places] = self._optima(points, models, places[2])

    def _optima(
        self, points: Array, models: tuple[Array, Array, Array], side: Array
    ) -> tuple[Array, Array]:
        """Promises of models about K points, shape (K,), and where they are, shape (K, d)."""
        sign = 2.0 * side - 1
        value, g, H = models[0] * sign, models[1] * sign[:, None], models[2] * sign[:, None, None]
        reach = self.reach * np.maximum((self.upper - self.lower) / 2, 1e-300)
        low = np.maximum(self.lower - points, -reach)
        high = np.minimum(self.upper - points, reach)
        maximise = global_maximum if points.shape[1] <= 4 else local_maximum
        x = maximise(g, H, low, high)
        return value + gain(g, H, x), points + x

    def proposals(self, method: ImprovedFollower, count: int) -> Array:
        """Most promising points of every window of time, apart from others, (≤ count, d)."""
        chosen: list[Array] = []
        for window in np.array_split(
            np.arange(len(self.value)), max(1, min(count, len(self.value)))
        ):
            gains = (self.promise - self.value)[window] / self.flow.scale[:, None]
            for k in np.argsort(-gains, axis=None)[:TRIES]:
                t, o, side = np.unravel_index(k, gains.shape)
                place = (window[t], o, side)
                if gains[t, o, side] <= method.tolerance:
                    break
                point = np.clip(self.target[place], self.lower, self.upper)
                if (np.abs(self.points - point).max(1) < 1e-7).any():
                    # tried already: the model promised too much
                    self.promise[place] = self.value[place]
                elif all(np.abs(point - other).max() > SPACING for other in chosen):
                    chosen.append(point)
                    break
        return np.array(chosen)[:count].reshape(-1, len(self.lower))


def around(apart: Array) -> Array:
    """Largest of values (A, T, m) at the nodes near by, and a tenth of the largest of all."""
    from scipy.ndimage import maximum_filter1d

    near = maximum_filter1d(apart, 2 * (apart.shape[1] // 40) + 1, axis=1)
    return np.asarray(np.maximum(near, 0.1 * apart.max(1, keepdims=True)))


JUMP = 0.05
"""Share of the box's width from which on optima of neighbouring nodes lie in different basins."""
MOST = 64e6
"""Most numbers of Taylor models computed at a time: 512 MB."""
TRIES = 40
"""Proposals looked at per window of time."""
SPACING = 0.02
"""Distance in unit coordinates between graphs of one batch."""
