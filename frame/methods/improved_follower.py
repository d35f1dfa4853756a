"""Graph Follower in rounds: Taylor models of all nodes propose graphs in batches.

The same idea as `frame.graph_follower` (storage, Taylor models, tolerance, post-processing), turned
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
from alphacut.frame.calculus.low_discrepancy import chebyshev_points
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.independent import SAFETY, beyond, parted
from alphacut.frame.methods.pursuit import Pursuit
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress, share
from alphacut.fuzzy.refused import RefusedError
from alphacut.fuzzy.result import Nature

MOST = 64e6
"""Most numbers of Taylor models computed at a time: 512 MB."""
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
    seed: int = 0

    def __post_init__(self) -> None:
        if not (self.tolerance > 0 and np.isfinite(self.tolerance)):
            raise RefusedError("tolerance", self.tolerance, "a positive number")
        if min(self.budget, self.spread, self.batch) < 1 or not 0 < self.reach <= 2:
            values = (self.budget, self.spread, self.batch, self.reach)
            raise RefusedError("budget, spread, batch, reach", values, "counts; a reach in (0, 2]")

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Envelope of two passes from different points, corrected by what their models promise.

        The error is twice what the models still promise and what an independent sample finds
        beyond the bounds, and twice what one pass leads beyond the other. Where neighbouring
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
        out = Pursuit.empty(flow, self.tolerance, self.reach)
        d, places = len(flow.boxes.names), len(flow.time) * len(flow.outputs)
        at_once = int(np.clip(MOST / (places * (1 + d + d * d)), 1, self.batch))
        for done, level in enumerate(reversed(range(levels))):
            lower, upper = flow.boxes.unit(level)
            out.enter(lower, upper)
            limit = self.budget * (done + 1) // levels
            points = self._start(flow, lower, upper, out)[: max(1, limit - len(out.points))]
            while len(points):
                for chunk in np.array_split(points, -(-len(points) // at_once)):
                    out.take(chunk)
                if progress:
                    progress(min(1.0, len(out.points) / self.budget))
                points = out.proposals(min(self.batch, limit - len(out.points)))
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


def around(apart: Array) -> Array:
    """Largest of values (A, T, m) at the nodes near by, and a tenth of the largest of all."""
    from scipy.ndimage import maximum_filter1d

    near = maximum_filter1d(apart, 2 * (apart.shape[1] // 40) + 1, axis=1)
    return np.asarray(np.maximum(near, 0.1 * apart.max(1, keepdims=True)))
