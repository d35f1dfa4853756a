"""Graph Follower (section 5.3, eq. 21): envelopes from few graphs and their Taylor models.

This differs from the paper in: 1. One storage serves all outputs, both sides and all levels: levels
are treated from the narrowest box to the widest, so that every stored graph is admissible and
α-cuts are nested by construction. 2. A new graph is computed only where the Taylor model predicts
more than an explicit tolerance.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.box_quadratic import local_maximum
from alphacut.frame.envelope import Envelope
from alphacut.frame.methods.graph_storage import Index, Places, Storage
from alphacut.frame.methods.independent import SAFETY, independent_excess, trajectories_diverge
from alphacut.fuzzy.arrays import Array
from alphacut.fuzzy.progress_bar import Progress, subprogress
from alphacut.fuzzy.refused import checked_number, require
from alphacut.fuzzy.result import Nature


@dataclass(eq=False)
class Followed:
    """Bounds that the Graph Follower has found, and the graphs (trajectories) behind them.

    Args:
        bounds: Upper bounds of (−output, output) after post-processing, shape (A, T, m, 2).
        best: Index of the graph that attains each, shape (A, T, m, 2).
        predicted_gain: Gain over the bounds that Taylor models still predict, same shape.
        guess: Index of the best stored graph when a node was reached, same shape (Figs. 21 to 23).
        new: Index of the graph computed there, or −1 where the guess stays, same shape.
        storage: All graphs.
    """

    bounds: Array
    best: Index
    predicted_gain: Array
    guess: Index
    new: Index
    storage: Storage


@dataclass(frozen=True)
class GraphFollower:
    """Graph Follower: envelopes of any structure from few trajectories ("graphs").

    At each node Taylor models of the trajectories computed so far point to the inputs that move the
    output furthest. Where they predict enough, the trajectory of those inputs is computed as well.

    Args:
        order: Degree κ of the Taylor models, 1 or 2.
        tolerance: Promised gain above which a new trajectory is computed, as a share of each
            output's peak, or in the unit of the first displacement (the first output without one)
            where the envelope is not relative.

    Raises:
        RefusedError: A switch is out of its range.

    Example:
        >>> from alphacut.frame import StoreyFrame, envelope
        >>> from alphacut.fuzzy import Triangular
        >>> frame = StoreyFrame(masses=[1e3], stiffness=[4e4], q0=[0.1])
        >>> inputs = {"m1": Triangular(900, 1000, 1100)}
        >>> str(envelope(frame, inputs, GraphFollower(), duration=0.5, step=0.1).nature)
        'estimated'
    """

    name: ClassVar[str] = "graph-follower"
    order: int = 2
    tolerance: float = 1e-3

    def __post_init__(self) -> None:
        """Refuse an order other than 1 and 2 and a tolerance that is not positive."""
        require(
            self.order in (1, 2),
            "order",
            value=self.order,
            allowed="1 and 2, the degrees of a Taylor model",
        )
        checked_number("tolerance", self.tolerance, positive=True)

    def run(self, flow: UnitFlow, progress: Progress | None = None) -> Envelope:
        """Return the envelope of all outputs on all levels, estimated or attained.

        Its error is the gain that the models still predict, and twice what an independent sample
        finds beyond the bounds. Where neighbouring trajectories diverge there is none, and the
        bounds are attained only.
        """
        start_time = time.perf_counter()
        followed = self.follow(flow, subprogress(progress, 0.0, 0.8))
        missed, count = independent_excess(flow, followed.bounds, subprogress(progress, 0.8, 1.0))
        diverges = trajectories_diverge(followed.storage.steepest, followed.bounds[0])
        error = followed.predicted_gain.max(-1) + SAFETY * missed[:, None]
        return flow.envelope(
            followed.bounds,
            followed.storage.points[followed.best],
            None if diverges else error,
            method=self.name,
            nature=Nature.ATTAINED if diverges else Nature.ESTIMATED,
            evaluations=len(followed.storage) + count,
            seconds=time.perf_counter() - start_time,
            facts={"order": self.order, "gain": self.tolerance},
        )

    def follow(self, flow: UnitFlow, progress: Progress | None = None) -> Followed:
        """Return bounds on all levels by Taylor models, from the narrowest box to the widest."""
        storage = Storage(flow)
        storage.add(flow.boxes.to_unit(flow.boxes.modal)[None])
        levels = len(flow.boxes.alpha)
        shape = (levels, *storage.top.shape)
        out = Followed(
            bounds=np.empty(shape),
            best=np.full(shape, 0),
            predicted_gain=np.zeros(shape),
            guess=np.full(shape, 0),
            new=np.full(shape, -1),
            storage=storage,
        )
        for done, level in enumerate(reversed(range(levels))):
            self._sweep(out, level, subprogress(progress, done / levels, (done + 1) / levels))
            # post-processing: the best of all graphs at every node (Fig. 24)
            out.bounds[level], out.best[level] = storage.top, storage.best
        return out

    def _sweep(self, out: Followed, level: int, progress: Progress) -> None:
        """Compute new graphs (trajectories) node by node where a gain over the bounds is predicted.

        They are added to the storage; `guess`, `new` and `predicted_gain` of the level are set.
        """
        storage, box = out.storage, out.storage.flow.boxes.unit(level)
        if not (box[1] > box[0]).any():
            return
        nodes = out.bounds.shape[1]
        predicted, target = storage.top.copy(), np.zeros((*storage.top.shape, len(box[0])))
        all_places = tuple(np.indices(predicted.shape).reshape(3, -1))
        self._predict(storage, all_places, box, predicted, target)
        for node in range(nodes):
            progress(node / nodes)
            out.guess[level, node] = storage.best[node]
            points = self._new_graphs(out, level, node, predicted, target)
            if points:  # predict anew where they are now the best graphs
                improved = storage.add(np.array(points))
                later = tuple(indices[improved[0] > node] for indices in improved)
                self._predict(storage, later, box, predicted, target)
        limit = self.tolerance * storage.flow.scale[:, None]
        out.predicted_gain[level] = np.clip(predicted - storage.top, 0.0, limit)

    def _new_graphs(
        self, out: Followed, level: int, node: int, predicted: Array, target: Array
    ) -> list[Array]:
        """Return the inputs whose trajectories (graphs) are to be computed for bounds at a node.

        They are those, in unit coordinates (d,), at which a bound is predicted to gain more than
        the tolerance. The numbers that the storage will give them are written to `out.new`. Taylor
        models predict values (T, m, 2) at targets (T, m, 2, d).
        """
        storage, points = out.storage, list[Array]()
        limit = self.tolerance * storage.flow.scale[:, None]
        for entry in np.argwhere(predicted[node] > storage.top[node] + limit):
            point = target[node, *entry]
            if not storage.holds(point) and all(np.abs(point - x).max() > 1e-9 for x in points):
                out.new[level, node, *entry] = len(storage) + len(points)
                points.append(point)
        return points

    def _predict(
        self,
        storage: Storage,
        places: Places,
        box: tuple[Array, Array],
        predicted: Array,
        target: Array,
    ) -> None:
        """Maximise the Taylor models of the best graphs at some places (node, output, side).

        Predicted values and their unit coordinates are written to `predicted` and `target`.
        """
        bend = float(self.order > 1)
        predicted[places], optima = storage.predicted(places, box, local_maximum, bend=bend)
        target[places] = np.clip(optima, *box)
