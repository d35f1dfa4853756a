"""The Graph Follower step by step, for pictures of how it works (paper, Figs. 21 to 25)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from alphacut.frame.boxes import UnitFlow, boxes
from alphacut.frame.calculus.jet import Array
from alphacut.frame.checks.admissible import require_admissible
from alphacut.frame.dynamics.flow import LinearFlow
from alphacut.frame.dynamics.nonlinear import LagrangianFlow
from alphacut.frame.methods.graph_follower import FollowerStep, GraphFollower
from alphacut.frame.structures.lagrangian import LagrangianSystem
from alphacut.frame.structures.linear import LinearSystem
from alphacut.fuzzy import FuzzyNumber


@dataclass(frozen=True, eq=False)
class FollowerRecord:
    """Record of the Graph Follower on one level for one output.

    Args:
        time: Nodes, shape (T,), in s.
        graphs: All graphs in the order of their computation, shape (G, T); the first belongs to the
            modal parameters.
        points: Their parameters, shape (G, d), in SI units.
        steps: One entry per node and side; `guess` and `found` index `graphs`, `predicted` is the
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


def record(
    model: LinearSystem | LagrangianSystem,
    inputs: Mapping[str, FuzzyNumber | float],
    *,
    duration: float,
    step: float,
    alpha: float = 0.0,
    tolerance: float = 1e-4,
    output: int = 0,
) -> FollowerRecord:
    """Follows one output of `model` on one level and keeps every step.

    Args:
        model: The structure.
        inputs: Fuzzy parameters by name, in SI units.
        duration: Length of the simulation, in s.
        step: Step, in s.
        alpha: The level.
        tolerance: Predicted gain above which a new graph is computed.
        output: Index of the output in `model.outputs`.

    Raises:
        ValueError: There is no such output, or a value is outside its range.
    """
    cuts = boxes(inputs, (alpha,))
    require_admissible(model, cuts)
    if isinstance(model, LagrangianSystem):
        flow = UnitFlow(LagrangianFlow(model, cuts.names, duration, step), cuts)
    else:
        flow = UnitFlow(LinearFlow(model, cuts.names, duration, step), cuts)
    return record_flow(flow, output=output, tolerance=tolerance)


def record_flow(flow: UnitFlow, *, output: int = 0, tolerance: float = 1e-4) -> FollowerRecord:
    """As `record`, on the first level of any flow."""
    if output not in range(len(flow.outputs)):
        raise ValueError(
            f"output: {output!r} is not allowed; it must be from 0 to {len(flow.outputs) - 1}, for"
            f" {', '.join(flow.outputs)}"
        )
    followed = GraphFollower(tolerance=tolerance, record=True).follow(flow)
    steps = tuple(step for step in followed.steps if step.output == output and step.level == 0)
    graphs = np.array(followed.storage.graphs)[..., output]
    local = {+1: np.full(len(flow.time), -np.inf), -1: np.full(len(flow.time), np.inf)}
    for step in steps:
        seen = [graphs[k, step.node] for k in (step.guess, step.found) if k >= 0]
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
