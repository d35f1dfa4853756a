"""The Graph Follower step by step, for pictures of how it works (paper, Figs. 21 to 25)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import UnitFlow
from alphacut.frame.calculus.jet import Array
from alphacut.frame.methods.graph_follower import FollowerStep, GraphFollower
from alphacut.fuzzy.refused import RefusedError


@dataclass(frozen=True, eq=False)
class FollowerRecord:
    """Record of the Graph Follower on one level for one output.

    Args:
        time: Nodes, shape (T,), in s.
        graphs: All graphs in the order of their computation, shape (G, T); the first belongs to the
            modal parameters.
        points: Their parameters, shape (G, d), in SI units.
        steps: One entry per node and side; `guess` and `new` index `graphs`, `predicted` is the
            optimum of the Taylor model.
        local_lower: Lower bound at each node when the sweep left it, shape (T,).
        local_upper: Upper bound likewise.
        lower: Lower bound after post-processing with all graphs, shape (T,).
        upper: Upper bound after post-processing.
    """

    time: Array
    graphs: Array
    points: Array
    steps: tuple[FollowerStep, ...]
    local_lower: Array
    local_upper: Array
    lower: Array
    upper: Array


def record_flow(flow: UnitFlow, *, output: int = 0, tolerance: float = 1e-4) -> FollowerRecord:
    """Record of one output on the first level of a flow.

    Args:
        flow: The trajectories.
        output: Index of the output.
        tolerance: Predicted gain above which a new graph is computed.
    """
    if output not in range(len(flow.outputs)):
        raise RefusedError("output", output, f"0 to {len(flow.outputs) - 1}")
    followed = GraphFollower(tolerance=tolerance, record=True).follow(flow)
    steps = tuple(step for step in followed.steps if step.output == output and step.level == 0)
    graphs = np.array(followed.storage.graphs)[..., output]
    local = {+1: np.full(len(flow.time), -np.inf), -1: np.full(len(flow.time), np.inf)}
    for step in steps:
        seen = [graphs[k, step.node] for k in (step.guess, step.new) if k >= 0]
        local[step.side][step.node] = max(seen) if step.side > 0 else min(seen)
    return FollowerRecord(
        flow.time,
        graphs,
        flow.boxes.to_physical(followed.storage.points),
        steps,
        local[-1],
        local[+1],
        graphs.min(0),
        graphs.max(0),
    )
